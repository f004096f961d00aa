r"""The shadow: where the vehicle would be if there were no UWB.

Three velocities and their covariance are carried beside the filter, driven by its inertial steps and corrected by pixel
motion alone; the position is their integral.  What UWB says is followed relative to that path (:mod:`.tracker`), so a
reflection that slides away shows up however slowly it comes.  The filter's own velocity counts as a weak reading: it
holds the shadow in directions that pixel motion does not see, where the shadow's variance then says that it knows
little, and hardly touches the others.

The velocity that pixel motion alone has added, :math:`J`, and its integral :math:`K` are kept too.  Over a window T
before now, inertia by itself would have arrived at :math:`K(t) - K(t - T) - J(t - T)\,T` from the shadow: the third
witness, when UWB and pixel motion disagree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.covariance import correct, project
from axialnav.fusion.kernels.shaking import in_doubt
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_ACCEL_BIAS, E_ATT, E_VEL, N_ERROR, POS, VEL

Array = NDArray[np.float64]
DRAWN_M_S = 0.5  # sigma of the filter's velocity as a reading of the shadow, once a block
CONTRADICTS = 3.0  # sigmas
FAULTY_M_S2 = 1.0  # error of the acceleration while the accelerometer is doubted


@kernel
def note_velocity(m: Record, w: Record) -> None:
    """Keep the filter's velocity, before a step or a reading changes it, in ``w.v_before``."""
    for i in range(3):
        w.v_before[i] = m.x[0, VEL + i]


@kernel
def carry_shadow(t_ns: int, dt: float, m: Record, w: Record) -> None:
    """Carry the shadow over the step of ``dt`` [s] that ended at ``t_ns``; before the first one, begin it."""
    if m.t_block == 0:
        start_shadow(m)
        m.t_block = t_ns
    if dt > 0.0:
        step_shadow(dt, w.v_before, m)


@kernel
def start_shadow(m: Record) -> None:
    """Begin where the filter is."""
    m.shadow_q = FAULTY_M_S2 * FAULTY_M_S2
    for i in range(3):
        m.shadow_p[i] = m.x[0, POS + i]
        m.shadow_v[i] = m.x[0, VEL + i]
        for j in range(3):
            m.shadow_V[i, j] = m.P[0, E_VEL + i, E_VEL + j]


@kernel
def step_shadow(dt: float, v_before: Array, m: Record) -> None:
    """Carry the shadow over an inertial step in which the filter's velocity was ``v_before`` (3,) [m/s]."""
    jolt = m.jolt[0] + m.jolt[1] + m.jolt[2]
    for i in range(3):
        change = m.x[0, VEL + i] - v_before[i]
        m.shadow_p[i] += dt * (m.shadow_v[i] + 0.5 * change)
        m.shadow_v[i] += change
        m.shadow_V[i, i] += (m.shadow_q + jolt) * dt
        m.flow_k[i] += dt * m.flow_j[i]


@kernel
def draw_shadow(m: Record, w: Record, c: Record) -> None:
    """Once a block: take the filter's velocity as a weak reading, axis by axis, and learn how good inertia now is.

    The acceleration is as wrong as gravity through the tilt's error and the accelerometer's bias make it, together:
    the filter knows their sum far better than either.
    """
    V = m.shadow_V
    m.shadow_q = c.shadow_m_s2 * c.shadow_m_s2 + _acceleration_variance(m, w)
    if in_doubt(m):
        m.shadow_q += FAULTY_M_S2 * FAULTY_M_S2
    for axis in range(3):
        S = V[axis, axis] + DRAWN_M_S * DRAWN_M_S
        y = m.x[0, VEL + axis] - m.shadow_v[axis]
        for i in range(3):
            w.ray[i] = V[i, axis]
        for i in range(3):
            m.shadow_v[i] += w.ray[i] / S * y
            for j in range(3):
                V[i, j] -= w.ray[i] * w.ray[j] / S


@kernel
def _acceleration_variance(m: Record, w: Record) -> float:
    """Variance of the acceleration that inertia tells, in its worst direction [m^2/s^4]; ``w.R`` is the attitude."""
    P, worst = m.P[0], 0.0
    for i in range(3):
        for k in range(3):
            after, last = (k + 1) % 3, (k + 2) % 3
            w.ray[k] = w.R[i, last] * m.imu[3 + after] - w.R[i, after] * m.imu[3 + last]  # of the attitude error
            w.ray[3 + k] = -w.R[i, k]  # of the accelerometer's bias
        variance = 0.0
        for j in range(6):
            for k in range(6):
                row = E_ATT + j if j < 3 else E_ACCEL_BIAS + j - 3
                column = E_ATT + k if k < 3 else E_ACCEL_BIAS + k - 3
                variance += w.ray[j] * P[min(row, column), max(row, column)] * w.ray[k]
        worst = max(worst, variance)
    return float(worst)


@kernel
def aid_shadow(t_ns: int, axes: int, gate: float, soft_nis: float, v_before: Array, m: Record, w: Record) -> None:
    """Correct the shadow by pixel motion; ``w`` holds what the filter, then at ``v_before``, made of the reading.

    The shadow has a gate of its own: one axis at a time, NIS at most ``gate``, weight as in the filter.
    """
    V = m.shadow_V
    for axis in range(axes):
        h, y = w.H[axis], w.z[axis] - w.h[axis]
        S = w.variance[axis]
        for i in range(3):
            y -= h[E_VEL + i] * (m.shadow_v[i] - v_before[i])
            w.ray[i] = V[i, 0] * h[E_VEL] + V[i, 1] * h[E_VEL + 1] + V[i, 2] * h[E_VEL + 2]
            S += h[E_VEL + i] * w.ray[i]
        nis = y * y / S
        if not nis <= gate:
            continue
        soft = 1.0 + nis / soft_nis
        S += w.variance[axis] * (soft * soft - 1.0)
        for i in range(3):
            step = w.ray[i] * y / S
            m.shadow_v[i] += step
            m.flow_j[i] += step
            for j in range(3):
                V[i, j] -= w.ray[i] * w.ray[j] / S
        m.t_shadow = t_ns


@kernel
def recover_velocity(m: Record, w: Record, U: Array) -> None:
    """Take the filter's velocity back from UWB that turned out wrong: where the shadow contradicts it, it counts.

    Along each of the directions in the rows of ``U`` (3, 3), a velocity more than three sigma from the shadow's has its
    variance opened by that difference and is corrected by the shadow's.
    """
    for row in range(2):
        x, P = m.x[row], m.P[row]
        for axis in range(3):
            u = U[axis]
            apart, own, shadow = 0.0, 0.0, 0.0
            for k in range(N_ERROR):
                w.H[0, k] = 0.0
            for i in range(3):
                w.H[0, E_VEL + i] = u[i]
                apart += u[i] * (m.shadow_v[i] - x[VEL + i])
                for j in range(3):
                    own += u[i] * P[E_VEL + i, E_VEL + j] * u[j]
                    shadow += u[i] * m.shadow_V[i, j] * u[j]
            if apart * apart < CONTRADICTS * CONTRADICTS * (own + shadow):
                continue
            for i in range(3):
                for j in range(3):
                    P[E_VEL + i, E_VEL + j] += u[i] * u[j] * apart * apart
            S = project(P, w.H[0], w.PHt) + shadow
            correct(x, P, w.PHt, S, apart, w.gain)


@kernel
def displacement_variance(window_s: float, u: Array, m: Record, c: Record) -> float:
    """Variance of the shadow's way along the unit vector ``u`` (3,) over the last ``window_s`` [m^2].

    Velocity errors that are alike over a time V / q add up like independent ones over longer windows; what drives the
    shadow may be wrong for longer than that, ``c.shadow_alike_s``.
    """
    variance = 0.0
    for i in range(3):
        for j in range(3):
            variance += u[i] * m.shadow_V[i, j] * u[j]
    alike_s = max(variance / m.shadow_q, c.shadow_alike_s)
    return float(variance * window_s * min(window_s, 2.0 * alike_s))


@kernel
def third_witness(window: Integer, block_s: float, u: Array, m: Record) -> float:
    """How far pixel motion has carried the shadow away from inertia alone along ``u`` within ``window`` blocks [m]."""
    now, then = m.block % 16, (m.block - window) % 16
    carried = 0.0
    for i in range(3):
        carried += u[i] * (m.ring_k[now, i] - m.ring_k[then, i] - m.ring_j[then, i] * window * block_s)
    return carried
