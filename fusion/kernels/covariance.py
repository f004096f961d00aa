r"""Covariance of the error state: prediction by blocks and the scalar update.

The transition has a 9x9 core (position, velocity, attitude) that is fed by two bias blocks; everything else is a
walk or fades.  Row and column passes over that structure need 1.1 k multiply-adds instead of the 31 k of the dense
product.
The dense textbook forms live in the tests as oracle.

Of the covariance the core's 9 rows are kept and the 16x16 block of everything else.  The block below the core,
``P[9:, :9]``, is the transpose of ``P[:9, 9:]``; copying it column by column would take a third of a prediction, so
nothing here writes or reads it, and :func:`complete` fills it in for those who want a whole matrix.

Source: Sola (2017), eq. 268-270; Bar-Shalom (2001), eq. 5.2.3-18 (Joseph form).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rotations import rotate_in_body
from axialnav.models.scalar_kernel import apart_kernel, kernel
from axialnav.models.state import E_UWB_BIAS, N_CORE, N_ERROR, QUAT

Array = NDArray[np.float64]
N = N_ERROR


@apart_kernel
def predict_covariance(P: Array, F: Array, dt: float, uwb_decay: float, Q: Array) -> None:
    """Replace ``P`` (25, 25) by ``Phi P Phi' + diag(Q)`` in place, but for the block below the core.

    ``F`` (9, 3) holds the blocks written by :func:`axialnav.models.imu.strapdown`, ``uwb_decay`` the Gauss-Markov
    factor of the UWB biases over the step, ``Q`` (25,) the discrete noise.
    """
    _predict_rows_of_core(P, F, dt)
    _predict_rows_beside(P, F, dt)
    for i in range(N_CORE):
        _predict_columns(i, P[i], F, dt)
    for i in range(N_CORE):
        for j in range(i + 1, N_CORE):
            P[j, i] = P[i, j]
    _fade(P, uwb_decay, uwb_decay * uwb_decay)
    for i in range(N):
        P[i, i] += Q[i]


@apart_kernel
def _fade(P: Array, decay: float, decay2: float) -> None:
    """Let the UWB biases fade; with columns outside the compiler takes eight of them at a time, not eight rows."""
    for j in range(E_UWB_BIAS, N):
        for i in range(E_UWB_BIAS):
            P[i, j] *= decay
    for j in range(N_CORE, E_UWB_BIAS):
        for i in range(E_UWB_BIAS, N):
            P[i, j] *= decay
    for j in range(E_UWB_BIAS, N):
        for i in range(E_UWB_BIAS, N):
            P[i, j] *= decay2


@apart_kernel
def _predict_rows_of_core(P: Array, F: Array, dt: float) -> None:
    """Apply ``Phi`` from the left to the 9x9 core, as far as the upper triangle needs it."""
    for i in range(3):
        for j in range(N_CORE):
            P[i, j] += dt * P[3 + i, j]
    for i in range(3):
        f0, f1, f2 = F[i, 0], F[i, 1], F[i, 2]
        b0, b1, b2 = F[3 + i, 0], F[3 + i, 1], F[3 + i, 2]
        for j in range(3, N_CORE):
            P[3 + i, j] += f0 * P[6, j] + f1 * P[7, j] + f2 * P[8, j] - b0 * P[j, 12] - b1 * P[j, 13] - b2 * P[j, 14]
    for j in range(6, N_CORE):
        t0, t1, t2 = P[6, j], P[7, j], P[8, j]
        for i in range(3):
            P[6 + i, j] = F[6 + i, 0] * t0 + F[6 + i, 1] * t1 + F[6 + i, 2] * t2 - dt * P[j, 9 + i]


@apart_kernel
def _predict_rows_beside(P: Array, F: Array, dt: float) -> None:
    """Apply ``Phi`` from the left to the 16 columns beside the core: two vectors of eight."""
    for i in range(3):
        f0, f1, f2 = F[i, 0], F[i, 1], F[i, 2]
        b0, b1, b2 = F[3 + i, 0], F[3 + i, 1], F[3 + i, 2]
        for j in range(N_CORE, N):
            v = P[3 + i, j]
            P[i, j] += dt * v
            P[3 + i, j] = v + (
                f0 * P[6, j] + f1 * P[7, j] + f2 * P[8, j] - b0 * P[12, j] - b1 * P[13, j] - b2 * P[14, j]
            )
    # held in variables: the compiler cannot know that a store to P leaves F alone
    r0, r1, r2 = F[6, 0], F[6, 1], F[6, 2]
    s0, s1, s2 = F[7, 0], F[7, 1], F[7, 2]
    u0, u1, u2 = F[8, 0], F[8, 1], F[8, 2]
    for j in range(N_CORE, N):
        t0, t1, t2 = P[6, j], P[7, j], P[8, j]
        P[6, j] = r0 * t0 + r1 * t1 + r2 * t2 - dt * P[9, j]
        P[7, j] = s0 * t0 + s1 * t1 + s2 * t2 - dt * P[10, j]
        P[8, j] = u0 * t0 + u1 * t1 + u2 * t2 - dt * P[11, j]


@apart_kernel
def _predict_columns(i: int, row: Array, F: Array, dt: float) -> None:
    """Apply ``Phi'`` from the right to row ``i`` of the core, as far as it lies in the upper triangle (by blocks)."""
    t0, t1, t2 = row[6], row[7], row[8]
    a0, a1, a2 = row[12], row[13], row[14]
    if i < 3:
        for k in range(3):
            row[k] += dt * row[3 + k]
    if i < 6:
        for k in range(3):
            row[3 + k] += (
                F[k, 0] * t0 + F[k, 1] * t1 + F[k, 2] * t2 - F[3 + k, 0] * a0 - F[3 + k, 1] * a1 - F[3 + k, 2] * a2
            )
    for k in range(3):
        row[6 + k] = F[6 + k, 0] * t0 + F[6 + k, 1] * t1 + F[6 + k, 2] * t2 - dt * row[9 + k]


@apart_kernel
def project(P: Array, H: Array, PHt: Array) -> float:
    """Write ``P H'`` into ``PHt`` (25,) and return ``H P H'``; zeros of the row ``H`` (25,) cost nothing."""
    for j in range(N):
        PHt[j] = 0.0
    for k in range(N_CORE):
        h = H[k]
        if h != 0.0:
            for j in range(N):
                PHt[j] += h * P[k, j]
    for k in range(N_CORE, N):
        h = H[k]
        if h != 0.0:
            for j in range(N_CORE):
                PHt[j] += h * P[j, k]
            for j in range(N_CORE, N):
                PHt[j] += h * P[k, j]
    variance = 0.0
    for k in range(N):
        if H[k] != 0.0:
            variance += H[k] * PHt[k]
    return variance


@apart_kernel
def correct(x: Array, P: Array, PHt: Array, S: float, innovation: float, gain: Array) -> None:
    """Scalar update of nominal state ``x`` (26,) and covariance ``P`` in place; ``gain`` (25,) receives the gain.

    With the gain ``P H' / S`` the Joseph form is ``P - r r'``, r = ``P H' / sqrt(S)``: one product an entry, and the
    same bits on both sides of the diagonal.
    """
    root = 1.0 / math.sqrt(S)
    for i in range(N):
        gain[i] = PHt[i] * root
    for i in range(N_CORE):
        r = gain[i]
        for j in range(N):
            P[i, j] -= r * gain[j]
    for i in range(N_CORE, N):
        r = gain[i]
        for j in range(N_CORE, N):
            P[i, j] -= r * gain[j]
    for i in range(N):
        gain[i] *= root
    inject(x, gain, innovation)


@apart_kernel
def inject(x: Array, gain: Array, innovation: float) -> None:
    """Add the error state ``gain * innovation`` to the nominal state (attitude multiplicatively, body axes)."""
    for i in range(6):
        x[i] += gain[i] * innovation
    rotate_in_body(x[QUAT : QUAT + 4], gain[6] * innovation, gain[7] * innovation, gain[8] * innovation)
    for i in range(9, N):
        x[i + 1] += gain[i] * innovation


@kernel
def complete(P: Array) -> None:
    """Fill in the block of ``P`` (25, 25) below the core."""
    for i in range(N_CORE):
        for j in range(N_CORE, N):
            P[j, i] = P[i, j]
