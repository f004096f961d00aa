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
SLOPES = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
LENS_SIGMAS_PX = (0.3, 0.7, 1.2, 2.0)
SINGLE_GROUPS = 12
GROUP_GROWTH = 1.07
NOISE_BLOCKS = 10
PASSES = 3


@lru_cache(maxsize=32)
def group_starts(count: int) -> NDArray[np.int64]:
    """First bin of every group of neighbouring bins: single ones at first, then ever wider, shape (groups,)."""
    starts, width, at = [], 1.0, 0
    while at < count:
        starts.append(at)
        width = width * GROUP_GROWTH if at >= SINGLE_GROUPS else 1.0
        at += max(1, int(width))
    return np.array(starts, dtype=np.int64)


def group_means(values: Array) -> Array:
    """Mean of ``values`` (..., f) in every group, shape (..., groups)."""
    starts = group_starts(values.shape[-1])
    sizes = np.diff(np.append(starts, values.shape[-1]))
    return np.asarray(np.add.reduceat(values, starts, axis=-1) / sizes)


@lru_cache(maxsize=32)
def shape_family(first: int, count: int, length: int) -> Array:
    """Power laws behind Gaussian lenses: candidate shapes of q, shape (shapes, count), 1 at the first bin."""
    f = np.arange(first, first + count) / length
    family = [
        (f / f[0]) ** -slope * np.exp(-((2.0 * np.pi * sigma * f) ** 2)) for slope in SLOPES for sigma in LENS_SIGMAS_PX
    ]
    return np.array(family)


def blur_power(length_px: float, frequency: Array) -> Array:
    """Power transfer of a uniform blur, ``sinc(f l)^2``, with a floor that keeps its zeros harmless."""
    return np.asarray(np.sinc(length_px * frequency) ** 2 + 1e-4)


def smooth_noise(incoherent: Array, floor: float) -> Array:
    """Noise power per frequency: block means of the incoherent power (f,), joined by straight lines."""
    count = incoherent.shape[0]
    edges = np.linspace(0, count, min(NOISE_BLOCKS, count) + 1).astype(np.int64)
    means = np.add.reduceat(incoherent, edges[:-1]) / np.diff(edges)
    middles = 0.5 * (edges[:-1] + edges[1:] - 1)
    return np.asarray(np.interp(np.arange(count), middles, np.maximum(means, floor)))


def texture_power(power: Array, noise: Array, looks: int, shapes: Array) -> Array:
    """Texture power (f,) of the member of ``shapes`` (m, f) that explains ``power - noise`` best.

    Parameters
    ----------
    power
        Measured power, texture and noise together, shape (f,).
    noise
        Noise power in it, shape (f,).
    looks
        Number of independent squares that ``power`` is a mean of.
    shapes
        Candidate shapes.

    Notes
    -----
    Whittle's likelihood; the amplitude of every candidate by iterated weighted least squares, never below its own
    standard deviation, so that a texture lost in the noise keeps a weight.
    """
    starts = group_starts(power.shape[0])
    sizes = np.diff(np.append(starts, power.shape[0])).astype(np.float64)
    best, amplitude = _best_shape(group_means(power), group_means(noise), group_means(shapes), sizes, float(looks))
    return np.asarray(amplitude * shapes[best])


@kernel
def _best_shape(p: Array, n: Array, shapes: Array, sizes: Array, looks: float) -> tuple[int, float]:
    """Number and amplitude of the best shape (m, g) for grouped power and noise (g,) with group sizes (g,)."""
    groups = p.shape[0]
    total = np.empty(groups)
    best, best_amplitude, least = 0, 0.0, np.inf
    for m in range(shapes.shape[0]):
        amplitude = 0.0
        for g in range(groups):
            total[g] = max(p[g], n[g])
        for _ in range(PASSES):
            information, match = 0.0, 0.0
            for g in range(groups):
                weighted = sizes[g] * shapes[m, g] / (total[g] * total[g])
                information += weighted * shapes[m, g]
                match += weighted * (p[g] - n[g])
            amplitude = max(match / information, 1.0 / np.sqrt(information * looks))
            for g in range(groups):
                total[g] = n[g] + amplitude * shapes[m, g]
        cost = 0.0
        for g in range(groups):
            cost += sizes[g] * (np.log(total[g]) + p[g] / total[g])
        if cost < least:
            best, best_amplitude, least = m, amplitude, cost
    return best, best_amplitude


def matched_weight(texture: Array, noise: Array, frames: int) -> Array:
    """``q / (s (s + N q))`` for every frequency."""
    return np.asarray(texture / (noise * (noise + frames * texture)))
