"""The maximum of the likelihood over all displacements, its uncertainty, and how much better it is than the others."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import WINDOW_LOOKS, Spectra
from axialnav.estimators.spectral.problem import Problem, pose
from axialnav.estimators.spectral.search import climb_all, look, peaks, smooth_fit
from axialnav.estimators.spectral.shapes import pair_lags
from axialnav.estimators.spectral.whittle import BLUR, NOISE, PARAMETERS, SHIFT, TEXTURE, UNTIED, misfit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
WIDE_REACH_PX = 24.0  # copies nearer than this leave a comb too wide for the tables
LOWEST, LOW_STARTS = 0.06, 14
MOST = 5
MOST_SLOW, MOST_FAST = 2, 3
STEPS, SHORT_STEPS = 12, 6
BLUR_STEP = 0.1  # relative
BLUR_RATIOS = (0.02, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0)
SAME = 0.01
SEPARATE, SEPARATE_PX = 0.1, 0.3
PRIOR_DOF, TINY, RIDGE = 6.0, 1e-12, 1e-9
CLIMB_REACH = 1.3  # climbs that choose among starts see the ripples of that many times the farthest copies
CLEAR_GAP = 30.0  # groups of bins are too coarse to tell apart what is nearer
SHORTER = (1.0, 0.8)  # of a displacement: where to look for one with a frame missing
MISFIT = 1.25  # the spectra of walls are only nearly smooth; measured on photographs


def light_beyond(problem: Problem, theta: Array, model: Array, frequency: float) -> float:
    """Log-likelihood per row of texture above a frequency [cycles/px], against noise alone.

    A spectrum that fades and stays dark may be that of a lens out of focus; only light on both sides makes a dark line.
    """
    noise = max(math.exp(float(theta[NOISE])), TINY * float(model.max()))
    gain = problem.power / noise - problem.power / model - np.log(model / noise)
    return float(problem.weight @ (gain * (problem.frequency > frequency)))


def _inverse(J: Array) -> Array:
    """Inverse of an information; huge, not infinite, for what the picture does not tell, say a blur of no length."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(J), TINY))
    scaled = J * scale * scale[:, None] + RIDGE * np.eye(len(J))
    if not np.all(np.isfinite(scaled)):
        return np.full_like(J, math.inf)
    return np.asarray(np.linalg.inv(scaled) * scale * scale[:, None])


@dataclass(frozen=True)
class Rival:
    """A value, and its misfit per row."""

    value_px: float
    cost: float


@dataclass(frozen=True)
class Fit:
    """The best model of a spectrum.

    Parameters
    ----------
    theta
        Parameters, shape (p,).
    sigma_px
        Standard deviation of the displacement (or of the blur, if that is what was searched) from the spread of the
        strips [px].
    margin
        Log-likelihood by which it beats the best other value, no motion among them.
    light
        Log-likelihood of light beyond the first dark line.
    rival_px
        That other value [px].
    excess
        Mean squared misfit over the one that the strips' spread explains; 1 for the right model.
    cost
        Misfit per row.
    per_look
        Log-likelihood per misfit per row.
    gap
        Log-likelihood by which a missing frame explains the picture better; not positive for an even composite.
    """

    theta: Array
    sigma_px: float
    margin: float
    light: float
    rival_px: float
    excess: float
    cost: float
    per_look: float
    gap: float = -math.inf


def conclude(spectra: Spectra, problem: Problem, theta: Array, tie: float, which: int, rivals: list[Rival]) -> Fit:
    """Uncertainty and doubts of the model at ``theta``, the maximum of ``problem`` (all frequencies, one by one)."""
    model, gradient = problem.model(theta, tie)
    rows = float(spectra.rows.sum())
    strips = spectra.power[:, problem.bins] / model - 1.0
    dispersion = float(np.mean(spectra.rows @ strips**2)) / (len(spectra.rows) - 1)
    other = [BLUR] if tie < 0.0 and which == SHIFT and problem.frames > 1 else []
    free = [which, *other, *range(TEXTURE, PARAMETERS)]
    inverse = _inverse(problem.information(model, gradient)[np.ix_(free, free)])
    if not np.all(np.isfinite(inverse)):
        return Fit(theta, math.inf, 0.0, 0.0, math.nan, math.nan, math.inf, 0.0)
    influence = gradient[:, free] @ inverse[0]
    scores = spectra.rows * (strips @ influence) / rows
    expected = inverse[0, 0] / rows * dispersion * WINDOW_LOOKS
    freedom = len(scores) - 1
    spread = float(np.sum((scores - scores.mean()) ** 2)) * len(scores) / freedom
    variance = (freedom * spread + PRIOR_DOF * expected) / (freedom + PRIOR_DOF)
    excess = float(np.mean((problem.power / model - 1.0) ** 2)) * rows / dispersion
    best = min(rivals, key=lambda rival: rival.cost)
    others = [r for r in rivals if abs(r.value_px - best.value_px) > max(SEPARATE * best.value_px, SEPARATE_PX)]
    rival = min(others, key=lambda other: other.cost, default=best)
    per_look = rows / (dispersion * WINDOW_LOOKS)
    dark = 1.0 / (problem.frames * max(float(theta[which]), TINY))
    light = light_beyond(problem, theta, model, dark) * per_look
    margin = (rival.cost - best.cost) * per_look
    cost = misfit(problem.power, problem.weight, model)
    sigma = MISFIT * math.sqrt(variance * max(1.0, excess))
    return Fit(theta, sigma, margin, light, rival.value_px, excess, cost, per_look)


def best_displacement(spectra: Spectra, usable: Mask, frames: int, ratio: float, reach_px: float) -> Fit:
    """Displacement of a composite.

    Parameters
    ----------
    spectra
        Of the composite.
    usable
        Frequencies to use, shape (f,).
    frames
        N.
    ratio
        Exposure over frame period.
    reach_px
        Largest displacement to look for [px].
    """
    exact = pose(spectra, usable, frames)
    found = starts(spectra, usable, frames, ratio, reach_px)
    farthest = CLIMB_REACH * (frames - 1 + ratio) * max(float(theta[SHIFT]) for theta in found)
    problem = pose(spectra, usable, frames, farthest)
    tops, rivals = _best(problem, found, ratio, SHIFT)
    theta, cost = exact.climb(tops[0], ratio, _free(SHIFT), STEPS)
    fit = conclude(spectra, exact, theta, ratio, SHIFT, rivals)
    least = min(rival.cost for rival in rivals)
    gapped = [(times, *_gapped(problem, times, ratio, tops[:2])) for times in with_gaps(frames)]
    gap = max(((least - other) * fit.per_look for _, _, other in gapped), default=-math.inf)
    if gap > -CLEAR_GAP:
        uneven = [(replace(exact, lags=pair_lags(times)), near) for times, near, _ in gapped]
        others = (copies.climb(near, ratio, _free(SHIFT), STEPS)[1] for copies, near in uneven)
        gap = max((cost - other) * fit.per_look for other in others)
    return replace(fit, gap=gap)


def with_gaps(frames: int) -> list[tuple[int, ...]]:
    """Times of frames of which one between the others is missing; seen from behind they are the same picture."""
    return [tuple(k + (k >= gap) for k in range(frames)) for gap in range(1, frames // 2 + 1) if frames > 2]


def _gapped(even: Problem, times: tuple[int, ...], ratio: float, near: list[Array]) -> tuple[Array, float]:
    """Parameters of copies at uneven ``times``, and their misfit per row."""
    problem = replace(even, lags=pair_lags(times))
    starts = [theta.copy() for theta in near for _ in SHORTER]
    for start, share in zip(starts, SHORTER * len(near), strict=True):
        start[SHIFT] *= share
    return min((problem.climb(start, ratio, _free(SHIFT), SHORT_STEPS) for start in starts), key=lambda found: found[1])


def free_blur(spectra: Spectra, usable: Mask, frames: int, near: Fit) -> Fit:
    """The same with a blur that is no longer tied to the displacement: for exposures that nobody knows."""
    problem = pose(spectra, usable, frames)
    free = np.ones(PARAMETERS, dtype=np.bool_)
    found = []
    for ratio in BLUR_RATIOS:
        start = near.theta.copy()
        start[BLUR] = ratio * start[SHIFT]
        found.append(problem.climb(start, UNTIED, free, STEPS, fresh=True))
    theta, cost = min(found, key=lambda item: item[1])
    rivals = [Rival(float(theta[SHIFT]), cost), Rival(near.rival_px, math.inf)]
    return replace(conclude(spectra, problem, theta, UNTIED, SHIFT, rivals), margin=near.margin, gap=near.gap)


def best_blur(spectra: Spectra, usable: Mask, low_px: float, high_px: float) -> Fit:
    """Blur of one exposure between two lengths [px] from spectra of single or aligned frames."""
    problem = pose(spectra, usable, 1)
    smooth, _ = smooth_fit(problem)
    grid = np.geomspace(low_px, high_px, max(3, math.ceil(math.log(high_px / low_px) / BLUR_STEP)))
    thetas, cost = climb_all(problem, smooth, grid, UNTIED, BLUR)
    within = (thetas[:, BLUR] > low_px) & (thetas[:, BLUR] < high_px)
    order = np.argsort(np.where(within, cost, math.inf))[:MOST]
    tops, rivals = _best(problem, [thetas[i] for i in order], UNTIED, BLUR)
    return conclude(spectra, problem, tops[0], UNTIED, BLUR, rivals)


def _free(which: int) -> Mask:
    """What a climb may change: the displacement or the blur, and all nuisances."""
    free = np.ones(PARAMETERS, dtype=np.bool_)
    free[BLUR if which == SHIFT else SHIFT] = False
    return free


def _best(problem: Problem, found: list[Array], tie: float, which: int) -> tuple[list[Array], list[Rival]]:
    """Climb from every start: where that ended, best first, and all values and misfits, no motion among them."""
    tops = [problem.climb(start, tie, _free(which), STEPS, fresh=True) for start in found]
    tops.sort(key=lambda top: top[1])
    rivals = [Rival(float(theta[which]), cost) for theta, cost in tops]
    return [theta for theta, _ in tops], [Rival(0.0, smooth_fit(problem)[1]), *rivals]


def starts(spectra: Spectra, usable: Mask, frames: int, ratio: float, reach_px: float) -> list[Array]:
    """Parameters to climb from, most promising first."""
    spread = frames - 1 + ratio
    coarse = pose(spectra, usable, frames, WIDE_REACH_PX)
    smooth, still = smooth_fit(coarse)
    low = WIDE_REACH_PX / spread
    grid = np.geomspace(LOWEST * low, low, LOW_STARTS)
    thetas, cost = climb_all(coarse, smooth, grid, ratio)
    slow = [(theta, still - float(value)) for theta, value in zip(thetas, cost, strict=True)]
    fast = []
    while low < reach_px:
        high = min(2.0 * low, reach_px)
        level = pose(spectra, usable, frames, high * spread)
        at, gain = look(level, smooth, low, high, ratio, spectra.length)
        for i in _tops(gain):
            theta = smooth.copy()
            theta[SHIFT] = at[i]
            fast.append((theta, float(gain[i])))
        low = high
    kept = _most_promising(slow, MOST_SLOW, [])
    return _most_promising(fast, MOST_FAST, kept)


def _most_promising(found: list[tuple[Array, float]], most: int, kept: list[Array]) -> list[Array]:
    """``kept`` and the best of what was found elsewhere.

    Promises of slow displacements come from climbs, those of fast ones from tables, where the texture is only roughly
    right: they can be ranked among themselves, but not against each other.
    """
    kept, room = list(kept), len(kept) + most
    for theta, _ in sorted(found, key=lambda item: -item[1]):
        near = any(abs(theta[SHIFT] - other[SHIFT]) < SAME * other[SHIFT] for other in kept)
        if not near and len(kept) < room:
            kept.append(theta)
    return kept


def _tops(gain: Array) -> list[int]:
    return [int(i) for i in peaks(np.arange(len(gain), dtype=np.float64), gain, MOST)]
