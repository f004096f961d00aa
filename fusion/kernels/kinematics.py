"""Ways beside the shadow's: how far a source, one of its anchors or the filter itself has strayed from it.

A ring holds, block by block, where something is relative to the shadow's path.  The median over three blocks, against
that of one and of three seconds before, is its way beside the shadow's; the shadow's own uncertainty says how long that
may be.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.reanchor import FLOW_FRESH_S
from axialnav.fusion.kernels.shadow import CONTRADICTS, displacement_variance, third_witness
from axialnav.fusion.memory import BLOCK_S, BLOCKS
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_VEL, VEL

Array = NDArray[np.float64]
WINDOWS = (4, 12)  # blocks: 1 s and 3 s
LEAST_LEVEL = 0.1  # a steeper axis than this has no horizontal of its own


@kernel
def median3(a: float, b: float, c: float) -> float:
    """Median of three; NaN where one is."""
    if not (np.isfinite(a) and np.isfinite(b) and np.isfinite(c)):
        return np.nan
    return max(min(a, b), min(max(a, b), c))


@kernel
def way(column: Array, now: Integer, window: Integer) -> float:
    """Change of a ring's median over three blocks against that ``window`` blocks before; NaN without data."""
    a = median3(column[now % BLOCKS], column[(now - 1) % BLOCKS], column[(now - 2) % BLOCKS])
    then = now - window
    return a - median3(column[then % BLOCKS], column[(then - 1) % BLOCKS], column[(then - 2) % BLOCKS])


@kernel
def directions(c: Record, U: Array) -> None:
    """Write the corridor's axis, a horizontal across it and the third direction into the rows of ``U`` (3, 3)."""
    level = math.hypot(c.axial_x, c.axial_y)
    U[0, 0], U[0, 1], U[0, 2] = c.axial_x, c.axial_y, c.axial_z
    U[1, 0], U[1, 1], U[1, 2] = 1.0, 0.0, 0.0
    if level > LEAST_LEVEL:
        U[1, 0], U[1, 1] = -c.axial_y / level, c.axial_x / level
    U[2, 0] = U[0, 1] * U[1, 2] - U[0, 2] * U[1, 1]
    U[2, 1] = U[0, 2] * U[1, 0] - U[0, 0] * U[1, 2]
    U[2, 2] = U[0, 0] * U[1, 1] - U[0, 1] * U[1, 0]


@kernel
def allowed_m(variance: float, c: Record) -> float:
    """How long a way beside the shadow's may be, of which inertia leaves open ``variance`` [m^2]."""
    return float(c.kinematic_m + c.kinematic_sigmas * math.sqrt(variance))


@kernel
def kinematics(t_ns: int, seen: Record, m: Record, w: Record, c: Record) -> float:
    """How far the source's way differs from the shadow's, in units of what is allowed: the largest of both windows.

    Directions are judged one by one: the shadow may know one well and another not at all.
    """
    largest = 0.0
    directions(c, w.S)
    for window in WINDOWS:
        if m.block <= window + 3:
            continue
        for i in range(3):
            w.q[i] = way(seen.place[:, i], m.block, window)
        for axis in range(3):
            u = w.S[axis]
            apart = u[0] * w.q[0] + u[1] * w.q[1] + u[2] * w.q[2]
            if not np.isfinite(apart):
                continue
            variance = displacement_variance(window * BLOCK_S, u, m, c) + 0.5 * seen.scatter * seen.scatter
            excess = abs(apart) / allowed_m(variance, c)
            largest = max(largest, excess)
            if excess > 1.0 and (t_ns - m.t_shadow) * 1e-9 < FLOW_FRESH_S:
                _ask_inertia(t_ns, window, apart, u, m, c)
    return float(largest)


@kernel
def _ask_inertia(t_ns: int, window: Integer, apart: float, u: Array, m: Record, c: Record) -> None:
    """UWB and pixel motion disagree along ``u``: note when inertia alone agrees with UWB, or with neither."""
    span = window * BLOCK_S
    carried = third_witness(window, BLOCK_S, u, m)
    drift2 = 0.25 * m.shadow_q * span * span * span * span
    variance = displacement_variance(span, u, m, c) + drift2
    limit = allowed_m(variance, c)
    if abs(carried) < limit:
        return
    m.t_neither = t_ns
    if abs(apart + carried) < limit:
        m.t_motion_blamed = t_ns


@kernel
def is_torn(t_ns: int, m: Record, w: Record, c: Record) -> bool:
    """Whether the filter's velocity contradicts the shadow's; both know inertia and pixel motion, one knows UWB too."""
    directions(c, w.S)
    torn = False
    for axis in range(3):
        u = w.S[axis]
        apart, variance = 0.0, 0.0
        for i in range(3):
            apart += u[i] * (m.x[0, VEL + i] - m.shadow_v[i])
            for j in range(3):
                variance += u[i] * (m.P[0, E_VEL + i, E_VEL + j] + m.shadow_V[i, j]) * u[j]
        if apart * apart > CONTRADICTS * CONTRADICTS * variance:
            torn = True
            _ask_inertia(t_ns, np.int64(WINDOWS[0]), apart * WINDOWS[0] * BLOCK_S, u, m, c)
    return torn
