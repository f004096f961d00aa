"""A straight line through a calibration, with what is left over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Line:
    """Least-squares line ``velocity = slope * length + intercept``.

    Parameters
    ----------
    slope_m_s_px, slope_sigma
        Slope and its standard error [m/s per px].
    intercept_m_s, intercept_sigma
        Intercept and its standard error [m/s].
    residual_rms_m_s, residual_max_m_s
        Root mean square and largest absolute residual [m/s].
    points
        How many points were fitted.
    """

    slope_m_s_px: float
    slope_sigma: float
    intercept_m_s: float
    intercept_sigma: float
    residual_rms_m_s: float
    residual_max_m_s: float
    points: int


def fit_line(length_px: Array, velocity_m_s: Array) -> Line | None:
    """Fit a line through the finite points, shape (n,) each; None if fewer than three are left or all are equal."""
    usable = np.isfinite(length_px) & np.isfinite(velocity_m_s)
    x, y = length_px[usable], velocity_m_s[usable]
    spread = float(np.sum((x - x.mean()) ** 2)) if x.size >= MIN_POINTS else 0.0
    if spread <= 0.0:
        return None
    slope = float(np.sum((x - x.mean()) * (y - y.mean()))) / spread
    intercept = float(y.mean()) - slope * float(x.mean())
    residual = y - slope * x - intercept
    variance = float(residual @ residual) / (x.size - 2)
    return Line(
        slope,
        float(np.sqrt(variance / spread)),
        intercept,
        float(np.sqrt(variance * (1.0 / x.size + float(x.mean()) ** 2 / spread))),
        float(np.sqrt(np.mean(residual**2))),
        float(np.abs(residual).max()),
        int(x.size),
    )


MIN_POINTS = 3
