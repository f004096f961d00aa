r"""Ultra-wideband: range to an anchor, range difference (TDoA) and the receiver's own position.

With the antenna at :math:`p_A = p + R\,l` and a bias state :math:`b` per path (per anchor, or per axis of a fix),

.. math:: r = |p_A - a| + b_a, \qquad d = |p_A - a_b| + b_b - |p_A - a_a| - b_a, \qquad z_i = p_{A,i} + b_i

Reflections only lengthen paths, come in episodes and are the gate's and the supervisor's business, not the model's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Integer
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_ATT, E_POS, E_UWB_BIAS, UWB_BIAS

Array = NDArray[np.float64]
MIN_RANGE_M = 0.05  # nearer, the direction to the anchor is undefined


@kernel
def _add_direction(R_WB: Array, lever_B: Array, u0: float, u1: float, u2: float, H: Array) -> None:
    """Add the derivative of ``u . p_A`` (u fixed, world axes) to the Jacobian row."""
    H[E_POS] += u0
    H[E_POS + 1] += u1
    H[E_POS + 2] += u2
    b0 = R_WB[0, 0] * u0 + R_WB[1, 0] * u1 + R_WB[2, 0] * u2
    b1 = R_WB[0, 1] * u0 + R_WB[1, 1] * u1 + R_WB[2, 1] * u2
    b2 = R_WB[0, 2] * u0 + R_WB[1, 2] * u1 + R_WB[2, 2] * u2
    H[E_ATT] += lever_B[1] * b2 - lever_B[2] * b1
    H[E_ATT + 1] += lever_B[2] * b0 - lever_B[0] * b2
    H[E_ATT + 2] += lever_B[0] * b1 - lever_B[1] * b0


@kernel
def _range_to(p_W: Array, R_WB: Array, lever_B: Array, anchor: Array, sign: float, H: Array) -> float:
    d0 = p_W[0] + R_WB[0, 0] * lever_B[0] + R_WB[0, 1] * lever_B[1] + R_WB[0, 2] * lever_B[2] - anchor[0]
    d1 = p_W[1] + R_WB[1, 0] * lever_B[0] + R_WB[1, 1] * lever_B[1] + R_WB[1, 2] * lever_B[2] - anchor[1]
    d2 = p_W[2] + R_WB[2, 0] * lever_B[0] + R_WB[2, 1] * lever_B[1] + R_WB[2, 2] * lever_B[2] - anchor[2]
    distance = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    if distance < MIN_RANGE_M:
        return np.nan
    scale = sign / distance
    _add_direction(R_WB, lever_B, scale * d0, scale * d1, scale * d2, H)
    return distance


@kernel
def _add_bias(x: Array, path: Integer, sign: float, H: Array) -> float:
    """Bias of a path (0..7; -1: it has no state) [m], and its entry in the Jacobian row."""
    if path < 0:
        return 0.0
    H[E_UWB_BIAS + path] = sign
    return float(sign * x[UWB_BIAS + path])


@kernel
def uwb_range(x: Array, p_W: Array, R_WB: Array, lever_B: Array, anchor: Array, path: Integer, H: Array) -> float:
    """Predict the range to ``anchor`` (3,) [m] and add its Jacobian to the zeroed row ``H`` (25,).

    ``path`` is the number of its bias among the states, or -1.
    """
    return float(_range_to(p_W, R_WB, lever_B, anchor, 1.0, H) + _add_bias(x, path, 1.0, H))


@kernel
def uwb_tdoa(
    x: Array,
    p_W: Array,
    R_WB: Array,
    lever_B: Array,
    anchor_a: Array,
    anchor_b: Array,
    path_a: Integer,
    path_b: Integer,
    H: Array,
) -> float:
    """Predict ``d(b) - d(a)`` [m] and add its Jacobian to the zeroed row ``H`` (25,); paths as in a range."""
    far = _range_to(p_W, R_WB, lever_B, anchor_b, 1.0, H) + _add_bias(x, path_b, 1.0, H)
    near = _range_to(p_W, R_WB, lever_B, anchor_a, -1.0, H) - _add_bias(x, path_a, -1.0, H)
    return float(far - near)


@kernel
def uwb_position(x: Array, p_W: Array, R_WB: Array, lever_B: Array, axis: int, path: Integer, H: Array) -> float:
    """Predict coordinate ``axis`` of the antenna [m]; ``path`` is the number of its bias, or -1."""
    u0, u1, u2 = 0.0, 0.0, 0.0
    if axis == 0:
        u0 = 1.0
    elif axis == 1:
        u1 = 1.0
    else:
        u2 = 1.0
    _add_direction(R_WB, lever_B, u0, u1, u2, H)
    antenna = p_W[axis]
    for k in range(3):
        antenna += R_WB[axis, k] * lever_B[k]
    return float(antenna + _add_bias(x, path, 1.0, H))
