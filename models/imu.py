r"""Inertial strapdown: nominal propagation and the blocks of the error-state transition.

With bias-free rate :math:`\omega` and specific force :math:`a` over a step dt,

.. math::
    q \leftarrow q \otimes \exp(\omega\,dt), \quad
    v \leftarrow v + (R_m a + g)\,dt, \quad
    p \leftarrow p + v\,dt + \tfrac12 (R_m a + g)\,dt^2

where :math:`R_m` is the attitude at mid-step.  The error state follows
:math:`\delta\dot v = -R[a]_\times\theta - R\,\delta b_a`, :math:`\dot\theta = -[\omega]_\times\theta - \delta b_g`.

Source: Sola (2017), section 5.4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rotations import matrix_from_quaternion, rotate_in_body
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import ACCEL_BIAS, GYRO_BIAS, POS, QUAT, VEL

Array = NDArray[np.float64]


@kernel
def strapdown(x: Array, gyro: Array, accel: Array, dt: float, gravity: float, R: Array, F: Array) -> None:
    """Propagate the nominal state ``x`` (19,) in place over ``dt`` [s] with body-axes rate and specific force.

    ``R`` (3, 3) receives the attitude at mid-step.  ``F`` (9, 3) receives the blocks of the transition:
    rows 0:3 ``-R[a]x dt``, rows 3:6 ``R dt``, rows 6:9 ``exp(-[w]x dt)`` to second order.
    """
    w0, w1, w2 = gyro[0] - x[GYRO_BIAS], gyro[1] - x[GYRO_BIAS + 1], gyro[2] - x[GYRO_BIAS + 2]
    a0, a1, a2 = accel[0] - x[ACCEL_BIAS], accel[1] - x[ACCEL_BIAS + 1], accel[2] - x[ACCEL_BIAS + 2]
    q = x[QUAT : QUAT + 4]
    half = 0.5 * dt
    rotate_in_body(q, half * w0, half * w1, half * w2)
    matrix_from_quaternion(q[0], q[1], q[2], q[3], R)
    rotate_in_body(q, half * w0, half * w1, half * w2)
    for i in range(3):
        r0, r1, r2 = R[i, 0], R[i, 1], R[i, 2]
        accel_W = r0 * a0 + r1 * a1 + r2 * a2
        if i == 2:
            accel_W -= gravity
        x[POS + i] += dt * (x[VEL + i] + half * accel_W)
        x[VEL + i] += dt * accel_W
        F[i, 0] = -(r1 * a2 - r2 * a1) * dt
        F[i, 1] = -(r2 * a0 - r0 * a2) * dt
        F[i, 2] = -(r0 * a1 - r1 * a0) * dt
        F[3 + i, 0] = r0 * dt
        F[3 + i, 1] = r1 * dt
        F[3 + i, 2] = r2 * dt
    t0, t1, t2 = w0 * dt, w1 * dt, w2 * dt
    F[6, 0] = 1.0 - 0.5 * (t1 * t1 + t2 * t2)
    F[6, 1] = t2 + 0.5 * t0 * t1
    F[6, 2] = -t1 + 0.5 * t0 * t2
    F[7, 0] = -t2 + 0.5 * t0 * t1
    F[7, 1] = 1.0 - 0.5 * (t0 * t0 + t2 * t2)
    F[7, 2] = t0 + 0.5 * t1 * t2
    F[8, 0] = t1 + 0.5 * t0 * t2
    F[8, 1] = -t0 + 0.5 * t1 * t2
    F[8, 2] = 1.0 - 0.5 * (t0 * t0 + t1 * t1)
