"""Slow aids: barometric height and the autopilot's attitude."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_ATT, E_POS

Array = NDArray[np.float64]


@kernel
def height(p_W: Array, datum_m: float, H: Array) -> float:
    """Predict the barometric height [m] above a datum that was taken at the start; adds to the row ``H`` (18,)."""
    H[E_POS + 2] = 1.0
    return float(p_W[2] + datum_m)


@kernel
def tilt(R_WB: Array, axis: int, H: Array) -> float:
    r"""Predict roll (axis 0) or pitch (axis 1) [rad] of the autopilot (FRD to NED, aerospace order).

    With the up direction in body axes :math:`u = R^\top e_z`, pitch is :math:`\arcsin u_x` and roll
    :math:`\operatorname{atan2}(u_y, u_z)`; :math:`\delta u = u \times \theta`.
    """
    u0, u1, u2 = R_WB[2, 0], R_WB[2, 1], R_WB[2, 2]
    if axis == 0:
        scale = 1.0 / max(u1 * u1 + u2 * u2, 1e-9)
        # d(u_y) = u_z th_x - u_x th_z, d(u_z) = u_x th_y - u_y th_x
        H[E_ATT] = scale * (u2 * u2 + u1 * u1)
        H[E_ATT + 1] = -scale * u1 * u0
        H[E_ATT + 2] = -scale * u2 * u0
        return math.atan2(u1, u2)
    scale = 1.0 / math.sqrt(max(1.0 - u0 * u0, 1e-9))
    H[E_ATT + 1] = -scale * u2
    H[E_ATT + 2] = scale * u1
    return math.asin(min(max(u0, -1.0), 1.0))
