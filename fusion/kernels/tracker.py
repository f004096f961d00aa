r"""What UWB says relative to the shadow's path: one slowly moving offset per anchor, or per axis of a fix.

A range to anchor a is followed as :math:`o_a = z - |q - a|` with the antenna q on the shadow's path, a difference as
:math:`o_b - o_a`, a fix per axis.  The offsets move with the honest readings; a reading far from its offset is a jump:
it is refused, and the offset follows only when several come in a row.  Then the path has a new level, which the anchor
of a range has to explain before it is used again.  The same place in the code knows whether a value has been repeating
itself while the vehicle moved.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.measure import UWB_POSITION, UWB_TDOA
from axialnav.fusion.memory import BLOCKS
from axialnav.fusion.outcome import Reason
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
JUMP, STUCK, SUPERVISOR = int(Reason.JUMP), int(Reason.STUCK), int(Reason.SUPERVISOR)
COPY = int(Reason.COPY)
FOLLOW_S = 0.2  # time constant of the offsets
LEAST_BLEND, MOST_BLEND = 0.02, 0.5
FORGET_S = 1.0  # of silence, after which an offset starts from the next reading
IN_A_ROW = 3  # so many jumps are a new level
STEPPED = 2  # mark of an anchor whose path has taken a new level
SCATTER_BLEND = 0.02
SCATTER_LEAST_M = 0.03
MAD_TO_SIGMA = 1.2533  # of a normal distribution: sigma over mean absolute deviation


@kernel
def path_length(q: Array, anchor: Array) -> float:
    """Distance from ``q`` (3,) to ``anchor`` (3,) [m]."""
    d0, d1, d2 = q[0] - anchor[0], q[1] - anchor[1], q[2] - anchor[2]
    return math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)


@kernel
def antenna_of_shadow(t_ns: int, s: Record, seen: Record, m: Record, w: Record) -> None:
    """Write the antenna on the path that the source is compared with into ``w.q`` (3,); attitude in ``w.R``.

    That path is the shadow's, moved by ``seen.reference``: near to where the source says, so that offsets stay small.
    """
    since = (t_ns - m.t_imu) * 1e-9
    for i in range(3):
        w.q[i] = m.shadow_p[i] + seen.reference[i] + since * m.shadow_v[i]
        for k in range(3):
            w.q[i] += w.R[i, k] * s.lever_B[k]


@kernel
def follow(t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record) -> int:
    """Take one UWB reading into its offsets; return 0, or the :class:`Reason` why it should not be fused."""
    antenna_of_shadow(t_ns, s, seen, m, w)
    if s.kind == UWB_POSITION:
        return _follow_fix(t_ns, seen, values, w, c)
    far = int(values[1]) if s.kind == UWB_TDOA else int(values[0])
    near = int(values[0]) if s.kind == UWB_TDOA else -1
    z = values[2] if s.kind == UWB_TDOA else values[1]
    if not (0 <= far < s.n_anchors and near < s.n_anchors and np.isfinite(z)):
        return 0
    expected = path_length(w.q, s.anchors[far])
    told = seen.offset[far]
    if near >= 0:
        expected -= path_length(w.q, s.anchors[near])
        told -= seen.offset[near]
    stuck = _repeats(far, z, expected, seen, c)
    if near < 0 and _is_copy(far, values[3] + values[4], seen):
        return STUCK if stuck else COPY
    gap_s = (t_ns - seen.t_heard[far]) * 1e-9
    seen.t_heard[far] = t_ns
    new = gap_s > FORGET_S
    if near >= 0:
        if not new and (t_ns - seen.t_heard[near]) * 1e-9 > FORGET_S:
            seen.offset[near] = seen.offset[far] - (z - expected)
            told = z - expected
        seen.t_heard[near] = t_ns
    if new:
        seen.offset[far] += z - expected - told
        told = z - expected
    step = _take(far, z - expected - told, gap_s, seen, c)
    if near < 0 and seen.outside[far] == IN_A_ROW + 1:
        # of one path alone: a reflection that comes or goes, not the vehicle
        seen.anchor_bad[far], seen.bad_block[far] = STEPPED, m.block
    share = 0.5 if near >= 0 else 1.0
    seen.offset[far] += share * step
    if near >= 0:
        seen.offset[near] -= share * step
    if stuck:
        return STUCK
    if seen.anchor_bad[far] > 0 or (near >= 0 and seen.anchor_bad[near] > 0):
        return SUPERVISOR
    return JUMP if seen.outside[far] > 0 else 0


@kernel
def _follow_fix(t_ns: int, seen: Record, values: Array, w: Record, c: Record) -> int:
    gap_s = (t_ns - seen.t_heard[0]) * 1e-9
    stuck, jumped = True, False
    for i in range(3):
        if not np.isfinite(values[i]):
            return 0
    for i in range(3):
        seen.t_heard[i] = t_ns
        if gap_s > 1.0:
            seen.offset[i] = values[i] - w.q[i]
        stuck = _same(i, values[i], seen) and stuck
        seen.offset[i] += _take(i, values[i] - w.q[i] - seen.offset[i], gap_s, seen, c)
        jumped = jumped or seen.outside[i] > 0
    moved = 0.0
    for i in range(3):
        if not stuck:
            seen.expected[i] = w.q[i]
            seen.repeats[i] = 0
        moved += (w.q[i] - seen.expected[i]) ** 2
    if stuck and seen.repeats[0] >= c.stuck_count and moved > c.stuck_m * c.stuck_m:
        return STUCK
    return JUMP if jumped else 0


@kernel
def _same(channel: Integer, value: float, seen: Record) -> bool:
    """Whether the value repeats the last one to the bit; counts."""
    same = value == seen.value[channel]
    seen.repeats[channel] = seen.repeats[channel] + 1 if same else 0
    seen.value[channel] = value
    return bool(same)


@kernel
def _repeats(channel: Integer, value: float, expected: float, seen: Record, c: Record) -> bool:
    """Whether the value stands still although the vehicle does not."""
    if not _same(channel, value, seen):
        seen.expected[channel] = expected
    stands = seen.repeats[channel] >= c.stuck_count
    return bool(stands and abs(expected - seen.expected[channel]) > c.stuck_m)


@kernel
def _is_copy(channel: Integer, power_dbm: float, seen: Record) -> bool:
    """Whether range and both powers are those of the reading before: it says what has been and is late.

    Some receivers repeat what they know whenever they are asked.  Without powers nobody can tell.
    """
    same = power_dbm == seen.power[channel] and seen.repeats[channel] > 0
    seen.power[channel] = power_dbm
    return bool(same)


@kernel
def _take(channel: Integer, residual: float, gap_s: float, seen: Record, c: Record) -> float:
    """Step of the offset for one residual; counts jumps in a row and learns the scatter of honest readings."""
    blend = min(max(1.0 - math.exp(-max(gap_s, 0.0) / FOLLOW_S), LEAST_BLEND), MOST_BLEND)
    limit = max(c.jump_sigmas * MAD_TO_SIGMA * seen.scatter, c.jump_m)
    if abs(residual) > limit:
        seen.outside[channel] += 1
        return blend * residual if seen.outside[channel] > IN_A_ROW else 0.0
    seen.outside[channel] = 0
    seen.scatter += SCATTER_BLEND * (abs(residual) - seen.scatter)
    seen.scatter = max(seen.scatter, SCATTER_LEAST_M)
    return blend * residual


@kernel
def refer(shift: Array, s: Record, seen: Record, w: Record) -> None:
    """Compare a source from now on with a path that lies ``shift`` (3,) farther; ``w.q`` is the antenna before that."""
    for i in range(3):
        w.y[i] = w.q[i] + shift[i]
        seen.reference[i] += shift[i]
    for a in range(s.n_anchors):
        change = path_length(w.q, s.anchors[a]) - path_length(w.y, s.anchors[a])
        seen.offset[a] += change
        for k in range(BLOCKS):
            seen.ring[a, k] += change
