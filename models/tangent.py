r"""Differences of attitudes and how they carry over covariances: the tangent space of rotations, body axes.

With :math:`q' = q \otimes \exp(r)` the difference is r.  An error :math:`\theta'` about q' is
:math:`\theta = r + J_r(r)^{-1} \theta'` about q, so a covariance moves with the right Jacobian

.. math:: J_r(r) = I - \frac{1 - \cos\phi}{\phi^2} [r]_\times + \frac{\phi - \sin\phi}{\phi^3} [r]_\times^2 .

Source: Sola, Deray, Atchuthan (2018), A micro Lie theory, eq. 143-144.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
SMALL_ANGLE = 1e-4  # below, the series is exact to float64


@kernel
def rotation_between(q: Array, to: Array, r: Array) -> None:
    """Write into ``r`` (3,) the rotation vector [rad], at most half a turn, that takes ``q`` (4,) to ``to`` (4,)."""
    w = q[0] * to[0] + q[1] * to[1] + q[2] * to[2] + q[3] * to[3]
    x = q[0] * to[1] - q[1] * to[0] - q[2] * to[3] + q[3] * to[2]
    y = q[0] * to[2] + q[1] * to[3] - q[2] * to[0] - q[3] * to[1]
    z = q[0] * to[3] - q[1] * to[2] + q[2] * to[1] - q[3] * to[0]
    sine = math.sqrt(x * x + y * y + z * z)
    sign = 1.0 if w >= 0.0 else -1.0
    scale = 2.0 * sign
    if sine > SMALL_ANGLE:
        scale = 2.0 * math.atan2(sine, abs(w)) / sine * sign
    r[0], r[1], r[2] = scale * x, scale * y, scale * z


@kernel
def right_jacobian(r: Array, J: Array) -> None:
    """Write the right Jacobian of the rotation vector ``r`` (3,) into ``J`` (3, 3)."""
    angle2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    angle = math.sqrt(angle2)
    first, second = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    if angle > SMALL_ANGLE:
        first, second = (1.0 - math.cos(angle)) / angle2, (angle - math.sin(angle)) / (angle2 * angle)
    _combine(r, -first, second, angle2, J)


@kernel
def inverse_right_jacobian(r: Array, J: Array) -> None:
    """Write the inverse of the right Jacobian of ``r`` (3,), shorter than half a turn, into ``J`` (3, 3)."""
    angle2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    angle = math.sqrt(angle2)
    second = 1.0 / 12.0 + angle2 / 720.0
    if angle > SMALL_ANGLE:
        second = 1.0 / angle2 - 0.5 / (angle * math.tan(0.5 * angle))
    _combine(r, 0.5, second, angle2, J)


@kernel
def _combine(r: Array, first: float, second: float, angle2: float, J: Array) -> None:
    """``I + first [r]x + second [r]x^2``, with ``[r]x^2 = r r' - |r|^2 I``."""
    for i in range(3):
        for j in range(3):
            J[i, j] = second * r[i] * r[j]
        J[i, i] += 1.0 - second * angle2
    J[0, 1] -= first * r[2]
    J[0, 2] += first * r[1]
    J[1, 0] += first * r[2]
    J[1, 2] -= first * r[0]
    J[2, 0] -= first * r[1]
    J[2, 1] += first * r[0]
