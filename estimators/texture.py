r"""Smooth power spectra of texture and noise, and the weights that follow from them.

The concentrated likelihood of the positions is a weighted sum of pair products with

.. math:: w(f) = \frac{q(f)}{s(f) \, (s(f) + N q(f))},

where q and s are the power of the texture and of the noise per row and frame.  Both are smooth functions with a handful
of parameters: with a free weight per frequency the fit would reinforce whatever the noise happens to do.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
SLOPES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
LENS_SIGMAS_PX = (0.3, 0.7, 1.2, 2.0)
SINGLE_GROUPS = 12
GROUP_GROWTH = 1.07
NOISE_BLOCKS = 10
PASSES = 3
NOISE_FLOOR, BLUR_FLOOR, TINY = 1e-3, 1e-4, 1e-12
STEPS = np.array([(-1, 0), (1, 0), (0, -1), (0, 1), (-1, 1), (1, -1)])  # slopes, lenses; steep and sharp look alike


@lru_cache(maxsize=64)
def group_starts(count: int) -> NDArray[np.int64]:
    """First bin of every group of neighbouring bins: single ones at first, then ever wider, shape (groups,)."""
    starts, width, at = [], 1.0, 0
    while at < count:
        starts.append(at)
        width = width * GROUP_GROWTH if at >= SINGLE_GROUPS else 1.0
        at += max(1, int(width))
    return np.array(starts, dtype=np.int64)


@kernel
def group_means(values: Array, starts: Index, out: Array) -> None:
    """Mean of ``values`` (f,) in every group, shape (g,)."""
    groups = starts.shape[0]
    for g in range(groups):
        end = starts[g + 1] if g + 1 < groups else values.shape[0]
        total = 0.0
        for f in range(starts[g], end):
            total += values[f]
        out[g] = total / (end - starts[g])


@lru_cache(maxsize=64)
def shape_family(first: int, count: int, length: int) -> Array:
    """Power laws behind Gaussian lenses: candidate shapes of q, shape (shapes, count), 1 at the first bin."""
    f = np.arange(first, first + count) / length
    family = [
        (f / f[0]) ** -slope * np.exp(-((2.0 * np.pi * sigma * f) ** 2)) for slope in SLOPES for sigma in LENS_SIGMAS_PX
    ]
    return np.array(family)


@lru_cache(maxsize=64)
def sharp_family(first: int, count: int, length: int) -> tuple[Array, Array, Index]:
    """Shapes without blur, their means in the groups, and the first bins of the groups."""
    shapes, starts = shape_family(first, count, length), group_starts(count)
    family = np.empty((len(shapes), len(starts)))
    grouped_family(shapes, starts, family)
    return shapes, family, starts


@kernel
def blur_power(length_px: float, omega: Array, out: Array) -> None:
    """Power transfer of a uniform blur at ``omega`` [rad/px], with a floor that keeps its zeros harmless."""
    for f in range(out.shape[0]):
        half = 0.5 * length_px * omega[f]
        ratio = np.sin(half) / half if half > TINY else 1.0
        out[f] = ratio * ratio + BLUR_FLOOR


@kernel
def smooth_noise(incoherent: Array, floor: float, out: Array) -> None:
    """Noise power per frequency (f,): block means of the incoherent power (f,), joined by straight lines."""
    count = incoherent.shape[0]
    blocks = min(NOISE_BLOCKS, count)
    before, level_before = 0.0, 0.0
    at = 0
    for b in range(blocks):
        first, end = b * count // blocks, (b + 1) * count // blocks
        total = 0.0
        for f in range(first, end):
            total += incoherent[f]
        level, middle = max(total / (end - first), floor), 0.5 * (first + end - 1)
        while at < count and at <= middle:
            out[at] = level if b == 0 else level_before + (level - level_before) * (at - before) / (middle - before)
            at += 1
        before, level_before = middle, level
    out[at:] = level_before


@kernel
def grouped_family(shapes: Array, starts: Index, out: Array) -> None:
    """:func:`group_means` of every shape (m, f), shape (m, g)."""
    for m in range(shapes.shape[0]):
        group_means(shapes[m], starts, out[m])


@kernel
def texture_power(
    power: Array, noise: Array, looks: float, shapes: Array, family: Array, starts: Index, out: Array
) -> None:
    """Texture power (f,): the member of ``shapes`` (m, f) that explains ``power - noise`` best.

    Parameters
    ----------
    power
        Measured power, texture and noise together, shape (f,).
    noise
        Noise power in it, shape (f,).
    looks
        Number of independent squares that ``power`` is a mean of.
    shapes, family
        Candidate shapes, and their means in the groups (times those of the blur, if there is one), shape (m, g).
    starts
        First bin of every group of neighbouring bins.
    out
        Result.

    Notes
    -----
    Whittle's likelihood; the amplitude of every candidate by iterated weighted least squares, never below its own
    standard deviation, so that a texture lost in the noise keeps a weight.
    """
    groups = starts.shape[0]
    p, n, sizes = np.empty(groups), np.empty(groups), np.empty(groups)
    group_means(power, starts, p)
    group_means(noise, starts, n)
    for g in range(groups):
        sizes[g] = (starts[g + 1] if g + 1 < groups else power.shape[0]) - starts[g]
    best, amplitude = _best_shape(p, n, family, sizes, looks)
    for f in range(power.shape[0]):
        out[f] = amplitude * shapes[best, f]


@kernel
def _best_shape(p: Array, n: Array, shapes: Array, sizes: Array, looks: float) -> tuple[int, float]:
    """Number and amplitude of the best shape (m, g) for grouped power and noise (g,) with group sizes (g,).

    A walk downhill over slopes and lenses from the middle of the family: a third of its members is asked.
    """
    lenses = len(LENS_SIGMAS_PX)
    slopes = shapes.shape[0] // lenses
    total, cost, amplitude = np.empty(shapes.shape[1]), np.full(shapes.shape[0], np.inf), np.empty(shapes.shape[0])
    best = (slopes // 2) * lenses + 1
    cost[best], amplitude[best] = _shape_cost(p, n, shapes[best], sizes, looks, total)
    centre = -1
    while centre != best:
        centre = best
        slope, lens = centre // lenses, centre % lenses
        for k in range(STEPS.shape[0]):
            i, j = slope + STEPS[k, 0], lens + STEPS[k, 1]
            if i < 0 or i >= slopes or j < 0 or j >= lenses:
                continue
            m = i * lenses + j
            if cost[m] == np.inf:
                cost[m], amplitude[m] = _shape_cost(p, n, shapes[m], sizes, looks, total)
            if cost[m] < cost[best]:
                best = m
    return best, amplitude[best]


@kernel
def _shape_cost(p: Array, n: Array, shape: Array, sizes: Array, looks: float, total: Array) -> tuple[float, float]:
    """Cost and amplitude of one shape (g,); ``total`` (g,) is scratch."""
    amplitude = 0.0
    for g in range(p.shape[0]):
        total[g] = max(p[g], n[g])
    for _ in range(PASSES):
        information, match = 0.0, 0.0
        for g in range(p.shape[0]):
            weighted = sizes[g] * shape[g] / (total[g] * total[g])
            information += weighted * shape[g]
            match += weighted * (p[g] - n[g])
        amplitude = max(match / information, 1.0 / np.sqrt(information * looks))
        for g in range(p.shape[0]):
            total[g] = n[g] + amplitude * shape[g]
    cost = 0.0
    for g in range(p.shape[0]):
        cost += sizes[g] * (np.log(total[g]) + p[g] / total[g])
    return cost, amplitude


@kernel
def smooth_spectra(
    power: Plane,
    pairs: Plane,
    rows: Array,
    frames: int,
    shapes: Array,
    family: Array,
    starts: Index,
    blur: Array,
    out: Array,
) -> None:
    """Smooth texture, smooth noise and raw coherent power per row and frame of every class.

    Parameters
    ----------
    power
        Sums of squares over rows and frames, shape (c, f).
    pairs
        Sums of the pair products at the positions of the wall, shape (c, f).
    rows
        Number of rows, shape (c,).
    frames
        Number of frames.
    shapes, family, starts
        See :func:`texture_power`; without blur.
    blur
        Power transfer of the blur, shape (f,).
    out
        Texture, noise and coherent power less its noise, shape (3, c, f).
    """
    count = power.shape[1]
    coherent, other, share = np.empty(count), np.empty(count), np.empty(count)
    blurred, transfer = np.empty(family.shape), np.empty(starts.shape[0])
    group_means(blur, starts, transfer)
    for m in range(family.shape[0]):
        for g in range(family.shape[1]):
            blurred[m, g] = family[m, g] * transfer[g]
    for c in range(power.shape[0]):
        mean = 0.0
        for f in range(count):
            mean_power = power[c, f] / (frames * rows[c])
            coherent[f] = mean_power / frames + 2.0 * pairs[c, f] / (frames * frames * rows[c])
            other[f] = (mean_power - coherent[f]) * frames / (frames - 1)
            mean += mean_power
        noise = out[1, c]
        smooth_noise(other, NOISE_FLOOR * mean / count + TINY, noise)
        for f in range(count):
            share[f] = noise[f] / frames
            out[2, c, f] = coherent[f] - share[f]
        texture_power(coherent, share, rows[c], shapes, blurred, starts, out[0, c])
        for f in range(count):
            out[0, c, f] *= blur[f]


@kernel
def matched_weight(texture: Array, noise: Array, frames: int, factor: float, out: Plane) -> None:
    """``q / (s (s + N q))`` times a factor for every frequency (f,)."""
    for f in range(out.shape[0]):
        out[f] = factor * texture[f] / (noise[f] * (noise[f] + frames * texture[f]))
