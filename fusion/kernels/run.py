"""The event loop: a sorted batch of events through the filter, one row of output each.

Replay calls it with a whole flight, the streaming estimator with one event at a time; both therefore give the same
numbers to the last bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.examine import examine, learn
from axialnav.fusion.kernels.measure import BLUR, FLOW, HEIGHT
from axialnav.fusion.kernels.propagate import propagate
from axialnav.fusion.kernels.rival import supervise_imu
from axialnav.fusion.kernels.shadow import carry_shadow, note_velocity
from axialnav.fusion.kernels.shaking import in_doubt
from axialnav.fusion.kernels.supervise import end_block
from axialnav.fusion.kernels.update import MIN_WEIGHT, fuse, is_uwb
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_WEIGHT,
    LOG_WIDTH,
    TRACK_FLAGS,
    TRACK_POS_CROSS,
    TRACK_RESETS,
    TRACK_STATE,
    TRACK_STATES,
    TRACK_VARIANCE,
    TRACK_VEL_CROSS,
)
from axialnav.fusion.outcome import Health, Reason
from axialnav.fusion.supervisor import MAX_STATES, STATE_BITS, SourceState
from axialnav.models.jit import Record, Records
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_POS, E_VEL, N_ERROR, N_NOMINAL, POS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DEAD_RECKONING, VELOCITY_INVALID = int(Health.DEAD_RECKONING), int(Health.VELOCITY_INVALID)
ACCELEROMETER_FAULT, UWB_SUSPECT = int(Health.ACCELEROMETER_FAULT), int(Health.UWB_SUSPECT)
POSITION_RESET, SOURCE_TIMEOUT = int(Health.POSITION_RESET), int(Health.SOURCE_TIMEOUT)
MOTION_SUSPECT, DISAGREE = int(Health.MOTION_SUSPECT), int(Health.DISAGREE)
OFF, ALIGNING, OK = int(SourceState.OFF), int(SourceState.ALIGNING), int(SourceState.OK)
SUSPECT, REACQUIRE = int(SourceState.SUSPECT), int(SourceState.REACQUIRE)
NOT_ALIGNED = int(Reason.NOT_ALIGNED)
GAP_BLEND, SILENCE_S, LEAST_GAP_S = 0.02, 1.0, 1e-3
RESET_SHOWN_S = 1.0


@kernel
def run(
    t_ns: Ints,
    source: Ints,
    values: Array,
    sources: Records,
    core: Records,
    memory: Records,
    scratch: Records,
    settings: Records,
    track: Array,
    log: Array,
) -> int:
    """Process sorted events; ``track`` gets a row per inertial sample, ``log`` (n, 11) a row per event.

    Returns the number of track rows written.  A row of ``log`` holds in its first column the number of axes, or minus
    the reason why the reading could not be used (0 for inertial samples).
    """
    m, w, c = core[0], scratch[0], settings[0]
    rows = 0
    for e in range(t_ns.shape[0]):
        s, seen = sources[source[e]], memory[source[e]]
        if s.kind == 0:
            inertial_step(t_ns[e], values[e], s, sources, memory, m, w, c)
            write_track(m, track[rows])
            track[rows, TRACK_FLAGS] = health(t_ns[e], sources, memory, m, c)
            track[rows, TRACK_STATES] = packed_states(memory)
            rows += 1
        elif m.started == 0:
            log[e, LOG_CODE] = -NOT_ALIGNED
        else:
            process(t_ns[e], s, seen, values[e], m, w, c, log[e])
    return rows


@kernel
def inertial_step(
    t_ns: int, values: Array, s: Record, sources: Records, memory: Records, m: Record, w: Record, c: Record
) -> None:
    """Advance the filter, its shadow and the supervisor's clock to an inertial sample."""
    note_velocity(m, w)
    dt = propagate(t_ns, values, s.R_BS, m, w, c)
    carry_shadow(t_ns, dt, m, w)
    if dt > 0.0:
        supervise_imu(dt, m, c)
        end_block(t_ns, sources, memory, m, w, c)


@kernel
def process(t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record, log: Array) -> None:
    """One reading: bookkeeping, what the supervisor says, both filters, what the supervisor learns."""
    gap_s = receive(t_ns, s, seen, values, m, w, c)
    # the rival first, so that the record and the scratch left behind are the estimate's
    evidence, both_used = 0.0, m.on_trial == 1
    for row in range(m.on_trial, -1, -1):
        likelihood = fuse(row, t_ns, s, seen, values, m, w, c)
        evidence += likelihood if row == 1 else -likelihood
        both_used = both_used and w.row[LOG_CODE] > 0.0 and w.refused == 0
    if both_used:
        m.evidence += evidence
    for k in range(LOG_WIDTH):
        log[k] = w.row[k]
    conclude(t_ns, gap_s, s, seen, m, w)


@kernel
def receive(t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record) -> float:
    """Before a reading is fused: bookkeeping, and what the supervisor says into ``w.refused``.

    Returns the time since the source's last reading [s].
    """
    gap_s = (t_ns - seen.t_seen) * 1e-9
    note_arrival(t_ns, gap_s, s.kind, values, seen, m)
    w.refused = examine(t_ns, s, seen, values, m, w, c) if c.supervised > 0.0 else 0
    note_velocity(m, w)
    return float(gap_s)


@kernel
def conclude(t_ns: int, gap_s: float, s: Record, seen: Record, m: Record, w: Record) -> None:
    """After a reading was fused or refused, as ``w.row`` tells: what aids the filter, what the supervisor learns."""
    if w.row[LOG_CODE] > 0.0 and w.row[LOG_WEIGHT] > MIN_WEIGHT:
        seen.t_fused = t_ns
        if FLOW <= s.kind <= BLUR:
            m.t_flow = t_ns
            m.t_aid = t_ns
        if is_uwb(s.kind):
            m.t_aid = t_ns
    learn(t_ns, gap_s, s, seen, m, w)


@kernel
def note_arrival(t_ns: int, gap_s: float, kind: int, values: Array, seen: Record, m: Record) -> None:
    """Learn how often the source speaks and, for heights, where its zero is."""
    if seen.state == OFF:
        seen.state, seen.t_first, seen.t_fit = ALIGNING, t_ns, t_ns
    seen.gap_s = mean_gap(seen.gap_s, gap_s)
    seen.t_seen = t_ns
    if kind == HEIGHT and not np.isfinite(seen.datum_m):
        seen.datum_m = values[0] - m.x[0, POS + 2]


@kernel
def mean_gap(known_s: float, gap_s: float) -> float:
    """Fading mean of the time between readings [s], NaN before the second; silence is no gap."""
    if not gap_s < SILENCE_S:
        return known_s
    return known_s + GAP_BLEND * (gap_s - known_s) if np.isfinite(known_s) else max(gap_s, LEAST_GAP_S)


@kernel
def health(t_ns: int, sources: Records, memory: Records, m: Record, c: Record) -> int:
    """Flags of :class:`~axialnav.fusion.outcome.Health` at ``t_ns``."""
    flags = 0
    silent_s = (t_ns - m.t_aid) * 1e-9
    if silent_s > c.dead_reckoning_s:
        flags |= DEAD_RECKONING
    if silent_s > c.invalid_s:
        flags |= VELOCITY_INVALID
    if in_doubt(m):
        flags |= ACCELEROMETER_FAULT
    if m.resets > 0 and (t_ns - m.t_reset) * 1e-9 < RESET_SHOWN_S:
        flags |= POSITION_RESET
    for i in range(sources.shape[0]):
        kind, seen = sources[i].kind, memory[i]
        if kind == 0 or seen.state == OFF:
            continue
        if (t_ns - max(seen.t_fused, seen.t_first)) * 1e-9 > c.timeout_s:
            flags |= SOURCE_TIMEOUT
        if seen.state == SUSPECT or seen.state == REACQUIRE:
            flags |= UWB_SUSPECT if is_uwb(kind) else MOTION_SUSPECT
    if flags & UWB_SUSPECT and (flags & MOTION_SUSPECT or (t_ns - m.t_neither) * 1e-9 < c.agree_s):
        flags |= DISAGREE
    return flags


@kernel
def packed_states(memory: Records) -> int:
    """States of the first seventeen sources in one number."""
    packed = 0
    for i in range(min(memory.shape[0], MAX_STATES)):
        packed |= memory[i].state << (STATE_BITS * i)
    return packed


@kernel
def write_track(m: Record, row: Array) -> None:
    """Write the estimate as one track row (layout in :mod:`axialnav.fusion.memory`)."""
    x, P = m.x[0], m.P[0]
    for i in range(N_NOMINAL):
        row[TRACK_STATE + i] = x[i]
    for i in range(N_ERROR):
        row[TRACK_VARIANCE + i] = P[i, i]
    row[TRACK_POS_CROSS] = P[E_POS, E_POS + 1]
    row[TRACK_POS_CROSS + 1] = P[E_POS, E_POS + 2]
    row[TRACK_POS_CROSS + 2] = P[E_POS + 1, E_POS + 2]
    row[TRACK_VEL_CROSS] = P[E_VEL, E_VEL + 1]
    row[TRACK_VEL_CROSS + 1] = P[E_VEL, E_VEL + 2]
    row[TRACK_VEL_CROSS + 2] = P[E_VEL + 1, E_VEL + 2]
    row[TRACK_RESETS] = m.resets
