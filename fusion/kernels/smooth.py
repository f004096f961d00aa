r"""Rauch-Tung-Striebel smoothing of the error state: one step back over an inertial interval or a re-anchoring.

With the filter's state and covariance before (+) and after (-) a step and its transition,

.. math::
    C_k = P^+_k \Phi^\top (P^-_{k+1})^{-1}, \qquad
    \delta_k = C_k\,(x^s_{k+1} \ominus x^-_{k+1}), \qquad
    P^s_k = P^+_k + C_k\,(P^s_{k+1} - P^-_{k+1})\,C_k^\top .

Attitudes are subtracted and added on the group, and covariances are carried between the tangent spaces.  Re-anchoring
is the step that forgets the position, a new UWB path one that forgets a bias: everything else passes through.

Source: Rauch, Tung, Striebel (1965); Sarkka (2013), section 9.1; for the attitude Sola (2017), section 6.3.1.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.memory import TRACK_POS_CROSS, TRACK_STATE, TRACK_VARIANCE, TRACK_VEL_CROSS
from axialnav.models.jit import Record, Records
from axialnav.models.rotations import rotate_in_body
from axialnav.models.scalar_kernel import apart_kernel, kernel
from axialnav.models.state import E_ATT, E_POS, E_UWB_BIAS, E_VEL, N_BIASES, N_ERROR, N_NOMINAL, QUAT
from axialnav.models.tangent import inverse_right_jacobian, right_jacobian, rotation_between

Array = NDArray[np.float64]
N = N_ERROR
IDENTITY, INERTIAL, REANCHORING, NEW_PATHS = 0, 1, 2, 3
MIN_PIVOT = 1e-13  # of a correlation matrix: directions below are known exactly and stay as they are

STEP: Final = np.dtype(
    [
        ("kind", "i8"),
        ("chosen", "i8"),  # which of the two filters became the estimate
        ("track_row", "i8"),  # -1 where the step ends at no inertial sample
        ("dt", "f8"),
        ("decay", "f8", 2),  # of the UWB biases
        ("new", "i8", N_BIASES),  # 1 where a bias was started anew
        ("x_before", "f8", (2, N_NOMINAL)),
        ("P_before", "f8", (2, N_ERROR, N_ERROR)),
        ("x_after", "f8", (2, N_NOMINAL)),
        ("P_after", "f8", (2, N_ERROR, N_ERROR)),
        ("F", "f8", (2, 9, 3)),
    ],
    align=True,
)

WORK: Final = np.dtype(
    [
        ("x", "f8", N_NOMINAL),  # smoothed state, and below its covariance about itself
        ("P", "f8", (N_ERROR, N_ERROR)),
        ("D", "f8", (N_ERROR, N_ERROR)),
        ("U", "f8", (N_ERROR, N_ERROR)),
        ("X", "f8", (N_ERROR, N_ERROR)),
        ("T", "f8", (N_ERROR, N_ERROR)),
        ("delta", "f8", N_ERROR),
        ("back", "f8", N_ERROR),
        ("scale", "f8", N_ERROR),
        ("inverse", "f8", N_ERROR),
        ("row", "f8", N_ERROR),
        ("J", "f8", (3, 3)),
        ("r", "f8", 3),
    ],
    align=True,
)


@kernel
def smooth_back(steps: Records, n: int, work: Records, track: Array) -> None:
    """Go back over ``steps[:n]`` from the smoothed state in ``work``, which ends up before the first of them.

    Rows of ``track`` that belong to inertial samples are overwritten; flags and reset counts stay the filter's.
    """
    w = work[0]
    for j in range(n - 1, -1, -1):
        s = steps[j]
        if s.track_row >= 0:
            write_smoothed(w.x, w.P, track[s.track_row])
        if s.kind == IDENTITY:
            continue
        r = s.chosen
        if s.kind == INERTIAL:
            transition_times(s.P_before[r], s.F[r], s.dt, s.decay[r], w.X)
        else:
            _forget(s.P_before[r], s.kind == REANCHORING, s.new, w.X)
        _step_back(s.x_before[r], s.P_before[r], s.x_after[r], s.P_after[r], w)


@kernel
def _step_back(x_before: Array, P_before: Array, x_after: Array, P_after: Array, w: Record) -> None:
    """One step; ``w.X`` holds the transition times ``P_before`` on entry."""
    _subtract(w.x, x_after, w.delta)
    for k in range(3):
        w.r[k] = w.delta[E_ATT + k]
    inverse_right_jacobian(w.r, w.J)
    carry(w.P, w.J, w.D)
    for i in range(N):
        for j in range(N):
            w.D[i, j] -= P_after[i, j]
    factorise(P_after, w.scale, w.inverse, w.U, w.row)
    solve(w.U, w.scale, w.inverse, w.X, w.row)
    for i in range(N):
        w.back[i] = 0.0
    for k in range(N):
        for i in range(N):
            w.back[i] += w.X[k, i] * w.delta[k]
    _add_quadratic(P_before, w.X, w.D, w.T, w.P, w.row)
    _add(x_before, w.back, w.x)
    for k in range(3):
        w.r[k] = w.back[E_ATT + k]
    right_jacobian(w.r, w.J)
    carry(w.P, w.J, w.T)
    for i in range(N):
        for j in range(N):
            w.P[i, j] = w.T[i, j]


@apart_kernel
def transition_times(P: Array, F: Array, dt: float, decay: float, out: Array) -> None:
    """Write ``Phi P`` (25, 25) into ``out``; the blocks are those of :func:`axialnav.models.imu.strapdown`."""
    for j in range(N):
        for i in range(3):
            out[i, j] = P[i, j] + dt * P[3 + i, j]
            out[3 + i, j] = P[3 + i, j]
            out[6 + i, j] = -dt * P[9 + i, j]
        for i in range(9, E_UWB_BIAS):
            out[i, j] = P[i, j]
        for i in range(E_UWB_BIAS, N):
            out[i, j] = decay * P[i, j]
    for i in range(3):
        for k in range(3):
            f, b, a = F[i, k], F[3 + i, k], F[6 + i, k]
            for j in range(N):
                out[3 + i, j] += f * P[6 + k, j] - b * P[12 + k, j]
                out[6 + i, j] += a * P[6 + k, j]


@kernel
def _forget(P: Array, position: bool, new: Array, out: Array) -> None:
    """What a step that forgets the position, or the biases marked in ``new``, lets through."""
    for i in range(N):
        for j in range(N):
            out[i, j] = P[i, j]
    for j in range(N):
        if position:
            for i in range(3):
                out[E_POS + i, j] = 0.0
        for k in range(N_BIASES):
            if new[k] == 1:
                out[E_UWB_BIAS + k, j] = 0.0


@apart_kernel
def carry(P: Array, J: Array, out: Array) -> None:
    """Write ``P`` with its attitude rows and columns multiplied by ``J`` (3, 3) into ``out``."""
    for i in range(N):
        for j in range(N):
            out[i, j] = P[i, j]
    for i in range(3):
        for j in range(N):
            out[6 + i, j] = J[i, 0] * P[6, j] + J[i, 1] * P[7, j] + J[i, 2] * P[8, j]
    for i in range(N):
        a, b, c = out[i, 6], out[i, 7], out[i, 8]
        for k in range(3):
            out[i, 6 + k] = a * J[k, 0] + b * J[k, 1] + c * J[k, 2]
    for i in range(3):
        for j in range(i):
            out[6 + i, 6 + j] = out[6 + j, 6 + i]


@apart_kernel
def factorise(P: Array, scale: Array, inverse: Array, U: Array, row: Array) -> None:
    """Cholesky factor of the correlation matrix of ``P`` (25, 25): ``U' U``, upper triangle of ``U``.

    ``scale`` (25,) gets 1 / sigma and ``inverse`` (25,) one over the pivots.  Directions without uncertainty of their
    own get pivots of zero, so that a semi-definite ``P`` does no harm.  ``row`` (25,) is scratch.

    Here and below a row takes all that it is made of before the next, whole even where half of it would do: rows of
    one length stay in registers meanwhile.
    """
    for i in range(N):
        scale[i] = 1.0 / math.sqrt(P[i, i]) if P[i, i] > 0.0 else 0.0
    for i in range(N):
        f = scale[i]
        for j in range(N):
            row[j] = f * scale[j] * P[i, j]
        for k in range(i):
            g = U[k, i]
            for j in range(N):
                row[j] -= g * U[k, j]
        pivot = row[i]
        f = 1.0 / math.sqrt(pivot) if pivot > MIN_PIVOT else 0.0
        inverse[i] = f
        for j in range(N):
            U[i, j] = row[j] * f


@apart_kernel
def solve(U: Array, scale: Array, inverse: Array, X: Array, row: Array) -> None:
    """Solve ``P Y = X`` (25, 25) in place with what :func:`factorise` wrote; ``row`` (25,) is scratch."""
    for i in range(N):
        f = scale[i]
        for j in range(N):
            row[j] = X[i, j] * f
        for k in range(i):
            f = U[k, i]
            for j in range(N):
                row[j] -= f * X[k, j]
        f = inverse[i]
        for j in range(N):
            X[i, j] = row[j] * f
    for i in range(N - 1, -1, -1):
        for j in range(N):
            row[j] = X[i, j]
        for k in range(i + 1, N):
            f = U[i, k]
            for j in range(N):
                row[j] -= f * X[k, j]
        f = inverse[i]
        for j in range(N):
            X[i, j] = row[j] * f
    for i in range(N):
        f = scale[i]
        for j in range(N):
            X[i, j] *= f


@apart_kernel
def _add_quadratic(P: Array, X: Array, D: Array, T: Array, out: Array, row: Array) -> None:
    """Write ``P + X' D X`` into ``out``, both triangles of it the same; ``T`` and ``row`` (25,) are scratch."""
    for i in range(N):
        for j in range(N):
            row[j] = 0.0
        for k in range(N):
            f = D[i, k]
            for j in range(N):
                row[j] += f * X[k, j]
        for j in range(N):
            T[i, j] = row[j]
    for i in range(N):
        for j in range(N):
            row[j] = P[i, j]
        for k in range(N):
            f = X[k, i]
            for j in range(N):
                row[j] += f * T[k, j]
        for j in range(i, N):
            out[i, j] = row[j]
            out[j, i] = row[j]


@kernel
def _subtract(x: Array, base: Array, delta: Array) -> None:
    """Write the error state (25,) that takes ``base`` (26,) to ``x`` (26,) into ``delta``."""
    for i in range(6):
        delta[i] = x[i] - base[i]
    rotation_between(base[QUAT : QUAT + 4], x[QUAT : QUAT + 4], delta[E_ATT : E_ATT + 3])
    for i in range(9, N):
        delta[i] = x[i + 1] - base[i + 1]


@kernel
def _add(base: Array, delta: Array, x: Array) -> None:
    """Write ``base`` (26,) moved by the error state ``delta`` (25,) into ``x``."""
    for i in range(N_NOMINAL):
        x[i] = base[i]
    for i in range(6):
        x[i] += delta[i]
    rotate_in_body(x[QUAT : QUAT + 4], delta[E_ATT], delta[E_ATT + 1], delta[E_ATT + 2])
    for i in range(9, N):
        x[i + 1] += delta[i]


@kernel
def write_smoothed(x: Array, P: Array, row: Array) -> None:
    """Overwrite state and covariance of a track row (layout in :mod:`axialnav.fusion.memory`)."""
    for i in range(N_NOMINAL):
        row[TRACK_STATE + i] = x[i]
    for i in range(N):
        row[TRACK_VARIANCE + i] = max(P[i, i], 0.0)
    at = 0
    for i in range(3):
        for j in range(i + 1, 3):
            row[TRACK_POS_CROSS + at] = P[E_POS + i, E_POS + j]
            row[TRACK_VEL_CROSS + at] = P[E_VEL + i, E_VEL + j]
            at += 1
