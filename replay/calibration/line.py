"""Straight lines through scattered points, with standard errors that know how alike neighbouring residuals are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MIN_POINTS = 20
CLIP = 3.5
ROUNDS = 6


@dataclass(frozen=True)
class Line:
    """``y = intercept + slope x``.

    Attributes
    ----------
    slope, intercept
        Of the line.
    sigma_slope, sigma_intercept
        Their standard errors.
    residual
        Root mean square distance of the points from the line, in units of y.
    used, points
        Points that the line goes by, and how many there were; the others lie more than 3.5 robust sigmas away.
    """

    slope: float
    intercept: float
    sigma_slope: float
    sigma_intercept: float
    residual: float
    used: int
    points: int


def fit_line(x: Array, y: Array, *, through_origin: bool = False) -> Line | None:
    """Least squares after clipping; None with fewer than twenty finite points or no spread in ``x``.

    Standard errors are those of white residuals times the root of their correlation time in samples (from their first
    autocorrelation), because neighbouring readings share errors.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < MIN_POINTS or float(np.ptp(x)) == 0.0:
        return None
    matrix = np.stack([x, np.zeros_like(x) if through_origin else np.ones_like(x)], axis=1)
    keep = np.ones(x.size, dtype=bool)
    for _ in range(ROUNDS):
        solution, *_ = np.linalg.lstsq(matrix[keep], y[keep], rcond=None)
        residual = y - matrix @ solution
        off = np.abs(residual - np.median(residual[keep]))
        before, keep = keep, off <= max(CLIP * 1.4826 * float(np.median(off[keep])), 1e-12)
        if keep.sum() < MIN_POINTS:
            return None
        if np.array_equal(before, keep):
            break
    residual = (y - matrix @ solution)[keep]
    rms = float(np.sqrt(np.mean(residual**2)))
    covariance = np.linalg.pinv(matrix[keep].T @ matrix[keep]) * rms**2 * repetition(residual)
    sigma_slope, sigma_intercept = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Line(
        float(solution[0]), float(solution[1]), float(sigma_slope), float(sigma_intercept), rms, int(keep.sum()), x.size
    )


def repetition(residual: Array) -> float:
    """How many neighbouring residuals say the same: (1 + r) / (1 - r) with the lag-1 autocorrelation r, at least 1."""
    power = float(residual @ residual)
    r = float(residual[1:] @ residual[:-1]) / power if power > 0.0 else 0.0
    return max((1.0 + min(r, 0.999)) / (1.0 - min(r, 0.999)), 1.0)
