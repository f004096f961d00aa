"""The window of pixel motion: the state in its middle, and the mean rate over it.

A reading is processed when its window ends.  What the vehicle did since then and before is remembered as two running
integrals, of the rate and of the acceleration: differences of them carry the present estimate back to the middle of
the window, whatever corrections came in between.

Source: the average of a state over a window as in Li and Mourikis (2013), section 4 (interpolation), to first order in
the window's length.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.memory import REMEMBERED
from axialnav.models.jit import Integer, Record
from axialnav.models.rotations import matrix_from_quaternion, rotate_in_body
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import GYRO_BIAS, N_NOMINAL, POS, QUAT, VEL

Array = NDArray[np.float64]
APART_NS = 3_000_000  # instants nearer than that are not kept apart: the memory reaches back 0.19 s or more


@kernel
def note_motion(t_ns: int, rate: Array, dt: float, gained: Array, m: Record) -> None:
    """Add a step of ``dt`` [s] that ends at ``t_ns``: rate (3,) [rad/s], velocity ``gained`` (3,) over it [m/s]."""
    if m.kept == 0 or t_ns - dt * 1e9 - m.kept_t[(m.kept - 1) % REMEMBERED] > APART_NS:
        at = m.kept % REMEMBERED
        m.kept_t[at] = t_ns - np.int64(round(dt * 1e9))
        for k in range(6):
            m.kept_motion[at, k] = m.motion[k]
        m.kept += 1
    for k in range(3):
        m.motion[k] += rate[k] * dt
        m.motion[3 + k] += gained[k]


@kernel
def motion_at(t_ns: Integer, m: Record, out: Array) -> bool:
    """Write both integrals (6,) at ``t_ns`` into ``out``; False where the memory does not reach back so far."""
    if t_ns >= m.t_imu:
        for k in range(3):
            out[k] = m.motion[k] + (t_ns - m.t_imu) * 1e-9 * m.imu[k]
            out[3 + k] = m.motion[3 + k]
        return True
    later = -1
    for back in range(1, min(m.kept, REMEMBERED) + 1):
        at = (m.kept - back) % REMEMBERED
        if m.kept_t[at] <= t_ns:
            end = m.t_imu if later < 0 else m.kept_t[later]
            share = (t_ns - m.kept_t[at]) / (end - m.kept_t[at])
            for k in range(6):
                there = m.motion[k] if later < 0 else m.kept_motion[later, k]
                out[k] = m.kept_motion[at, k] + share * (there - m.kept_motion[at, k])
            return True
        later = at
    return False


@kernel
def state_in_window(t_ns: int, window_s: float, x: Array, m: Record, w: Record) -> None:
    """State in the middle of the window that ends at ``t_ns``, into ``w.x``, ``w.p``, ``w.R``; rate into ``w.rate``.

    Where the memory does not reach back over the window, the state is that at its end and the rate the newest sample.
    """
    for k in range(N_NOMINAL):
        w.x[k] = x[k]
    for k in range(3):
        w.rate[k] = m.imu[k]
    length = np.int64(round(window_s * 1e9))
    middle = t_ns - length // 2
    if not (length > 0 and motion_at(t_ns - length, m, w.first) and motion_at(middle, m, w.mid)):
        return
    motion_at(t_ns, m, w.last)
    _move(middle, m, w)
    for k in range(3):
        w.rate[k] = (w.last[k] - w.first[k]) / window_s


@kernel
def _move(middle: Integer, m: Record, w: Record) -> None:
    """Carry the state in ``w.x`` from the last inertial sample to ``middle``."""
    dt = (middle - m.t_imu) * 1e-9
    for k in range(3):
        velocity = w.x[VEL + k]
        w.x[VEL + k] = velocity + w.mid[3 + k] - m.motion[3 + k]
        w.p[k] = w.x[POS + k] + 0.5 * dt * (velocity + w.x[VEL + k])
        w.mid[k] -= m.motion[k] + dt * w.x[GYRO_BIAS + k]
    q = w.x[QUAT : QUAT + 4]
    rotate_in_body(q, w.mid[0], w.mid[1], w.mid[2])
    matrix_from_quaternion(q[0], q[1], q[2], q[3], w.R)
