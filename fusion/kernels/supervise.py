"""The supervisor: which sources are believed, decided four times a second from what the blocks of readings say.

Every quarter of a second the place that each UWB source claims, relative to the shadow's path, is put into a ring.  The
median over three blocks, against that of one and of three seconds before, is the source's way beside the shadow's: more
than their uncertainties allow makes it SUSPECT.  It is believed again once both agree and the place fits the filter; if
they agree but the place does not fit for long, the filter's position is moved there (REACQUIRE).  Silence is LOST.
SUSPECT are also a source that is hardly believed reading by reading while pixel motion aids, and one that pulls the
filter's velocity away from the shadow's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.anchors import CALM, judge_anchors
from axialnav.fusion.kernels.kinematics import directions, is_torn, kinematics
from axialnav.fusion.kernels.locate import ENOUGH_AGREE, locate
from axialnav.fusion.kernels.measure import BLUR, FLOW, UWB_POSITION
from axialnav.fusion.kernels.reanchor import FLOW_FRESH_S, move_position
from axialnav.fusion.kernels.shadow import draw_shadow, recover_velocity
from axialnav.fusion.kernels.shaking import in_doubt
from axialnav.fusion.kernels.update import is_uwb
from axialnav.fusion.memory import BLOCK_S, BLOCKS
from axialnav.fusion.supervisor import SourceState
from axialnav.models.jit import Record, Records
from axialnav.models.rotations import matrix_from_quaternion
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_POS, POS, QUAT

Array = NDArray[np.float64]
OFF, ALIGNING, OK = int(SourceState.OFF), int(SourceState.ALIGNING), int(SourceState.OK)
SUSPECT, REACQUIRE, LOST = int(SourceState.SUSPECT), int(SourceState.REACQUIRE), int(SourceState.LOST)
BLOCK_NS = round(BLOCK_S * 1e9)
ALIGN_S = 1.0
TORN_BLOCKS = 2
REFUSED_TRUST, GOOD_TRUST = 0.15, 0.5
LOW_TRUST, FAIR_TRUST = 0.25, 0.4
SIGMAS = 2.0
FUSED_S = 1.0
NOT_TRUSTED_S = 0.3
UNFIT_S = 3.0  # a place that does not fit for so long is doubted even if single readings pass


@kernel
def end_block(t_ns: int, sources: Records, memory: Records, m: Record, w: Record, c: Record) -> None:
    """Close the block if it is over and somebody supervises."""
    if t_ns - m.t_block >= BLOCK_NS and c.supervised > 0.0:
        close_block(t_ns, sources, memory, m, w, c)


@kernel
def close_block(t_ns: int, sources: Records, memory: Records, m: Record, w: Record, c: Record) -> None:
    """End a block: move the rings on and judge every source."""
    m.block += 1
    m.t_block = t_ns
    at = m.block % BLOCKS
    x = m.x[0]
    matrix_from_quaternion(x[QUAT], x[QUAT + 1], x[QUAT + 2], x[QUAT + 3], w.R)
    for i in range(3):
        m.ring_j[at, i] = m.flow_j[i]
        m.ring_k[at, i] = m.flow_k[i]
    draw_shadow(m, w, c)
    aided = (t_ns - m.t_shadow) * 1e-9 < FLOW_FRESH_S and not in_doubt(m)
    m.torn = m.torn + 1 if aided and is_torn(t_ns, m, w, c) else 0
    uwb_ok, doubted = False, False
    for i in range(sources.shape[0]):
        s, seen = sources[i], memory[i]
        if s.kind == 0 or seen.state == OFF:
            continue
        if (t_ns - seen.t_seen) * 1e-9 > c.timeout_s:
            seen.state = LOST
            for k in range(3):
                seen.place[at, k] = np.nan
            continue
        if seen.state == LOST:
            seen.state, seen.t_fit, seen.t_since = REACQUIRE, t_ns, t_ns
        if seen.state == ALIGNING and (t_ns - seen.t_first) * 1e-9 > ALIGN_S:
            seen.state = OK
        if is_uwb(s.kind):
            alone = not _another_aids(i, t_ns, sources, memory)
            _judge_uwb(t_ns, aided, alone, s, seen, m, w, c)
            uwb_ok = uwb_ok or (seen.state == OK and (t_ns - seen.t_fused) * 1e-9 < FUSED_S)
            doubted = doubted or seen.state == SUSPECT or seen.state == REACQUIRE
    for i in range(sources.shape[0]):
        seen = memory[i]
        if FLOW <= sources[i].kind <= BLUR and seen.state >= OK and seen.state != LOST:
            _judge_motion(t_ns, uwb_ok, seen, m, c)
            if doubted and not uwb_ok and seen.trust < REFUSED_TRUST:
                m.t_neither = t_ns  # inertia, which carries the filter, contradicts both
        elif not is_uwb(sources[i].kind) and seen.state == REACQUIRE:
            seen.state = OK


@kernel
def _another_aids(which: int, t_ns: int, sources: Records, memory: Records) -> bool:
    """Whether another UWB source is believed and fused."""
    for i in range(sources.shape[0]):
        if i != which and is_uwb(sources[i].kind):
            seen = memory[i]
            if seen.state == OK and (t_ns - seen.t_fused) * 1e-9 < FUSED_S and seen.trust > GOOD_TRUST:
                return True
    return False


@kernel
def misfit(seen: Record, m: Record, w: Record, c: Record) -> bool:
    """Whether the place ``w.fix`` of a source does not fit the filter's position; the gap is left in ``w.move``."""
    size2 = 0.0
    for i in range(3):
        w.move[i] = m.shadow_p[i] + w.fix[i] - m.x[0, POS + i]
        size2 += w.move[i] * w.move[i]
    variance = 0.5 * seen.scatter * seen.scatter * size2
    for i in range(3):
        for j in range(3):
            variance += w.move[i] * m.P[0, E_POS + i, E_POS + j] * w.move[j]
    size = math.sqrt(size2)
    return bool(size * size > c.fit_m * size + SIGMAS * math.sqrt(max(variance, 0.0)))


@kernel
def _judge_uwb(t_ns: int, aided: bool, alone: bool, s: Record, seen: Record, m: Record, w: Record, c: Record) -> None:
    """One UWB source: where it is, how it moves, which of its anchors do, where it pulls; then its state."""
    at = m.block % BLOCKS
    agree = locate(t_ns, s, seen, m, w)
    for i in range(3):
        seen.place[at, i] = w.fix[i] if agree >= ENOUGH_AGREE else np.nan
    unfit = agree >= ENOUGH_AGREE and misfit(seen, m, w, c)
    if not unfit:
        seen.t_fit = t_ns
    for i in range(3):
        seen.gap[i] = w.move[i]
    excess = kinematics(t_ns, seen, m, w, c) if aided else 0.0
    if s.kind != UWB_POSITION and judge_anchors(t_ns, aided, unfit, s, seen, m, w, c):
        excess = max(excess, 1.01)
    if m.torn >= TORN_BLOCKS and seen.state == OK and (t_ns - seen.t_fused) * 1e-9 < FUSED_S:
        excess = max(excess, 1.01)
    if excess > CALM:
        seen.t_disagree = t_ns
    blamed = (t_ns - m.t_motion_blamed) * 1e-9 < c.agree_s
    if excess > 1.0 and not blamed:
        if seen.state != SUSPECT:
            seen.t_since = t_ns
        seen.state, seen.t_moved = SUSPECT, t_ns
        directions(c, w.S)
        recover_velocity(m, w, w.S)
    elif seen.state == OK:
        refused = (t_ns - seen.t_trusted) * 1e-9 > NOT_TRUSTED_S and seen.trust < REFUSED_TRUST
        if unfit and (refused or (t_ns - seen.t_fit) * 1e-9 > UNFIT_S):
            seen.state, seen.t_since = SUSPECT, seen.t_fit
        elif aided and not blamed and seen.trust < LOW_TRUST:
            seen.state, seen.t_since = SUSPECT, t_ns
    elif seen.state >= SUSPECT:
        _take_back(t_ns, aided, alone, agree >= ENOUGH_AGREE, unfit, seen, m, c)
    doubted = seen.state == SUSPECT or seen.state == REACQUIRE
    seen.held = 1 if doubted and (aided or not alone) else 0


@kernel
def _take_back(
    t_ns: int, aided: bool, alone: bool, located: bool, unfit: bool, seen: Record, m: Record, c: Record
) -> None:
    """Believe a doubted source again where it fits or, after long patience, by moving the position to it."""
    if (t_ns - seen.t_disagree) * 1e-9 < c.agree_s and aided:
        return
    if located and not unfit and (seen.trust > FAIR_TRUST or not aided):
        seen.state = OK
        _trust_again(t_ns, seen)
        return
    seen.state = REACQUIRE
    patience_s = c.reanchor_aided_s if aided else c.reanchor_alone_s
    waited_s = (t_ns - max(seen.t_since, seen.t_moved)) * 1e-9
    if located and alone and waited_s > patience_s:
        move_position(t_ns, seen.gap, m)
        seen.state = OK
        _trust_again(t_ns, seen)


@kernel
def _trust_again(t_ns: int, seen: Record) -> None:
    seen.trust = 1.0
    seen.t_trusted = t_ns
    for a in range(seen.anchor_bad.shape[0]):
        seen.anchor_bad[a] = 0
    for k in range(BLOCKS):
        for i in range(3):
            seen.place[k, i] = np.nan


@kernel
def _judge_motion(t_ns: int, uwb_ok: bool, seen: Record, m: Record, c: Record) -> None:
    """Pixel motion against IMU and UWB: refused for long, or outvoted, it is suspect while UWB is believed."""
    blamed = (t_ns - m.t_motion_blamed) * 1e-9 < c.agree_s
    if seen.state == OK:
        if uwb_ok and (blamed or seen.trust < REFUSED_TRUST):
            seen.state, seen.t_since, seen.t_disagree, seen.held = SUSPECT, t_ns, t_ns, 1
        return
    if seen.trust < GOOD_TRUST or blamed:
        seen.t_disagree = t_ns
    if not uwb_ok or (t_ns - seen.t_disagree) * 1e-9 > c.agree_s:
        seen.state, seen.held = OK, 0
