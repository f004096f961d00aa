"""One reading against one filter: innovation, gate, weight and correction."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.covariance import correct, project
from axialnav.fusion.kernels.measure import UWB_POSITION, UWB_RANGE, measure, repetition
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_GATE,
    LOG_INNOVATION,
    LOG_NIS,
    LOG_REASON,
    LOG_VARIANCE,
    LOG_WEIGHT,
    LOG_WIDTH,
)
from axialnav.fusion.outcome import Reason
from axialnav.models.jit import Record
from axialnav.models.rotations import matrix_from_quaternion
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_VEL, N_ERROR, POS, QUAT, VEL

Array = NDArray[np.float64]
MIN_WEIGHT = 1e-3
REFUSED_COUNTS = 2.0  # a refused reading asks for a correction as if it lay this many times its gate away
NOT_FINITE = int(Reason.NOT_FINITE)


@kernel
def is_uwb(kind: int) -> bool:
    """Whether an event kind is UWB of any form."""
    return UWB_RANGE <= kind <= UWB_POSITION


@kernel
def redescend(nis_per_axis: float, soft_nis: float) -> float:
    """Weight of a reading inside its gate: Geman-McClure, 1 at the centre, 1/4 at ``soft_nis``.

    Source: Geman and McClure (1987); used on UWB by the Crazyflie's estimator.
    """
    ratio = 1.0 / (1.0 + nis_per_axis / soft_nis)
    return ratio * ratio


@kernel
def fuse(row: int, t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record) -> float:
    """Try one reading on filter ``row``; leave its record in ``w.row`` (11,) and return its log-likelihood, in a trial.

    The log-likelihood is bounded (the NIS counts at most as much as the gate) and divided by the number of readings
    that repeat each other, for UWB also where bias states take that up: what they leave of it must not decide over the
    accelerometer.  A reading is gated by its own variance, and fused with that of all that say the same.
    Axes of one reading are gated together and fused one after the other.
    """
    x, P = m.x[row], m.P[row]
    since_imu = (t_ns - m.t_imu) * 1e-9
    for i in range(3):
        w.p[i] = x[POS + i] + since_imu * x[VEL + i]
    matrix_from_quaternion(x[QUAT], x[QUAT + 1], x[QUAT + 2], x[QUAT + 3], w.R)
    axes = measure(t_ns, s, seen, values, x, P, m, w, c)
    for k in range(LOG_WIDTH):
        w.row[k] = 0.0
    w.row[LOG_CODE] = axes
    w.would = 0.0
    if axes < 0:
        return 0.0
    nis, det = _innovate(axes, P, w)
    if not np.isfinite(nis):
        w.row[LOG_CODE] = -NOT_FINITE
        return 0.0
    gate = s.gate[axes - 1]
    w.would = redescend(nis / axes, s.soft_nis) if nis <= gate else 0.0
    weight = w.would if w.refused == 0 else 0.0
    w.row[LOG_NIS], w.row[LOG_GATE], w.row[LOG_WEIGHT] = nis, gate, weight
    if weight > MIN_WEIGHT:
        _apply(axes, w.repeated / weight, x, P, w)
        if row == 0:
            for k in range(3):
                m.correction[k] += w.step[E_VEL + k]
                m.correction_variance[k] += w.spread[k]
    elif row == 0 and w.refused == 0:
        _note_refused(axes, REFUSED_COUNTS * math.sqrt(gate / nis), P, m, w)
    if w.refused > 0:
        w.row[LOG_REASON] = w.refused
        return 0.0
    if m.on_trial == 0:
        return 0.0  # nobody asks
    return float(-0.5 * (min(nis, gate) + math.log(det)) / repetition(seen.gap_s, s.correlation_s))


@kernel
def _note_refused(axes: int, cap: float, P: Array, m: Record, w: Record) -> None:
    """Add the correction of velocity that a refused reading asks for, as if it lay a little outside its gate."""
    for i in range(axes):
        S = project(P, w.H[i], w.PHt) + w.variance[i] * w.repeated
        for k in range(3):
            m.correction[k] += w.PHt[E_VEL + k] / S * cap * (w.z[i] - w.h[i])
            m.correction_variance[k] += w.PHt[E_VEL + k] * w.PHt[E_VEL + k] / S


@kernel
def _innovate(axes: int, P: Array, w: Record) -> tuple[float, float]:
    """Normalised innovation squared of all axes jointly, and det S, by one elimination pass."""
    S, y = w.S, w.y
    for i in range(axes - 1, -1, -1):  # the first axis last: the update begins with its P H'
        y[i] = w.z[i] - w.h[i]
        S[i, i] = project(P, w.H[i], w.PHt) + w.variance[i]
        w.row[LOG_INNOVATION + i] = y[i]
        w.row[LOG_VARIANCE + i] = S[i, i]
        for j in range(i):
            cross = 0.0
            for k in range(N_ERROR):
                cross += w.H[j, k] * w.PHt[k]
            S[j, i] = cross
            S[i, j] = cross
    nis, det = 0.0, 1.0
    for i in range(axes):
        pivot = S[i, i]
        nis += y[i] * y[i] / pivot
        det *= pivot
        for j in range(i + 1, axes):
            factor = S[j, i] / pivot
            y[j] -= factor * y[i]
            for k in range(i + 1, axes):
                S[j, k] -= factor * S[i, k]
    return nis, det


@kernel
def _apply(axes: int, inflation: float, x: Array, P: Array, w: Record) -> None:
    """Fuse the axes one by one; each innovation is taken after the corrections before it (to first order).

    ``w.S`` and ``w.PHt`` are as :func:`_innovate` leaves them.
    """
    for k in range(N_ERROR):
        w.step[k] = 0.0
    for k in range(3):
        w.spread[k] = 0.0
    for i in range(axes):
        if i == 0:
            S = w.S[0, 0] + w.variance[0] * (inflation - 1.0)
        else:
            S = project(P, w.H[i], w.PHt) + w.variance[i] * inflation
        innovation = w.z[i] - w.h[i]
        if i > 0:
            for k in range(N_ERROR):
                innovation -= w.H[i, k] * w.step[k]
        correct(x, P, w.PHt, S, innovation, w.gain)
        for k in range(N_ERROR):
            w.step[k] += w.gain[k] * innovation
        for k in range(3):
            w.spread[k] += w.gain[E_VEL + k] * w.gain[E_VEL + k] * S
