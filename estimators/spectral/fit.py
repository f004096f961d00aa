"""The maximum of the likelihood over all lengths of blur, its uncertainty, and how much better than others it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import WINDOW_LOOKS, Spectra
from axialnav.estimators.spectral.problem import Problem, pose
from axialnav.estimators.spectral.whittle import BLUR, NOISE, PARAMETERS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MOST = 5
SHORT_STEPS, STEPS = 5, 12
BLUR_STEP = 0.1  # relative
SEPARATE, SEPARATE_PX = 0.1, 0.3
PRIOR_DOF, TINY, RIDGE = 6.0, 1e-12, 1e-9
EVERYTHING = np.ones(PARAMETERS, dtype=np.bool_)
MISFIT = 1.25  # the spectra of walls are only nearly smooth; measured on photographs


def light_beyond(problem: Problem, theta: Array, model: Array, frequency: float) -> float:
    """Log-likelihood per row of texture above a frequency [cycles/px], against noise alone.

    A spectrum that fades and stays dark may be that of a lens out of focus; only light on both sides makes a dark line.
    """
    noise = max(math.exp(float(theta[NOISE])), TINY * float(model.max()))
    gain = problem.power / noise - problem.power / model - np.log(model / noise)
    return float(gain @ (problem.frequency > frequency))


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
    blur_px
        Length of the blur [px].
    sigma_px
        Its standard deviation from the spread of the strips [px].
    margin
        Log-likelihood by which it beats the best other value, no blur among them.
    light
        Log-likelihood of light beyond the first dark line.
    excess
        Mean squared misfit over the one that the strips' spread explains; 1 for the right model.
    """

    blur_px: float
    sigma_px: float
    margin: float
    light: float
    excess: float


def conclude(spectra: Spectra, problem: Problem, theta: Array, rivals: list[Rival]) -> Fit:
    """Uncertainty and doubts of the model at ``theta``, the maximum of ``problem``."""
    model, gradient = problem.model(theta)
    blur, rows = float(theta[BLUR]), float(spectra.rows.sum())
    strips = spectra.power[:, problem.bins] / model - 1.0
    dispersion = float(np.mean(spectra.rows @ strips**2)) / (len(spectra.rows) - 1)
    inverse = _inverse(problem.information(model, gradient))
    if not np.all(np.isfinite(inverse)):
        return Fit(blur, math.inf, 0.0, 0.0, math.nan)
    scores = spectra.rows * (strips @ (gradient @ inverse[BLUR])) / rows
    expected = inverse[BLUR, BLUR] / rows * dispersion * WINDOW_LOOKS
    freedom = len(scores) - 1
    spread = float(np.sum((scores - scores.mean()) ** 2)) * len(scores) / freedom
    variance = (freedom * spread + PRIOR_DOF * expected) / (freedom + PRIOR_DOF)
    excess = float(np.mean((problem.power / model - 1.0) ** 2)) * rows / dispersion
    best = min(rivals, key=lambda rival: rival.cost)
    others = [r for r in rivals if abs(r.value_px - best.value_px) > max(SEPARATE * best.value_px, SEPARATE_PX)]
    rival = min(others, key=lambda other: other.cost, default=best)
    per_look = rows / (dispersion * WINDOW_LOOKS)
    light = light_beyond(problem, theta, model, 1.0 / max(blur, TINY)) * per_look
    sigma = MISFIT * math.sqrt(variance * max(1.0, excess))
    return Fit(blur, sigma, (rival.cost - best.cost) * per_look, light, excess)


def best_blur(spectra: Spectra, usable: Mask, low_px: float, high_px: float) -> Fit:
    """Blur of one exposure between two lengths [px] from spectra of single or aligned frames."""
    problem = pose(spectra, usable)
    smooth, still = smooth_fit(problem)
    found = []
    for blur in np.geomspace(low_px, high_px, max(3, math.ceil(math.log(high_px / low_px) / BLUR_STEP))):
        start = smooth.copy()
        start[BLUR] = blur
        found.append(problem.climb(start, EVERYTHING, SHORT_STEPS))
    found.sort(key=lambda item: item[1] if low_px < item[0][BLUR] < high_px else math.inf)
    tops = [problem.climb(theta, EVERYTHING, STEPS) for theta, _ in found[:MOST]]
    theta, _ = min(tops, key=lambda top: top[1])
    return conclude(spectra, problem, theta, [Rival(0.0, still), *(Rival(float(t[BLUR]), cost) for t, cost in tops)])


def smooth_fit(problem: Problem) -> tuple[Array, float]:
    """Parameters and misfit of a spectrum without blur."""
    return problem.climb(problem.prior[0].copy(), EVERYTHING & (np.arange(PARAMETERS) != BLUR), STEPS)
