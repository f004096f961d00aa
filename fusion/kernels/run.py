"""The event loop: a sorted batch of events through the filter, one row of output each.

Replay calls it with a whole flight, the streaming estimator with one event at a time; both therefore give the same
numbers to the last bit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.measure import BLUR, FLOW, HEIGHT
from axialnav.fusion.kernels.propagate import propagate
from axialnav.fusion.kernels.reanchor import observe_source, reanchor
from axialnav.fusion.kernels.rival import supervise_imu
from axialnav.fusion.kernels.update import MIN_WEIGHT, fuse, is_uwb
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_WEIGHT,
    LOG_WIDTH,
    TRACK_FLAGS,
    TRACK_POS_CROSS,
    TRACK_RESETS,
    TRACK_STATE,
    TRACK_VARIANCE,
    TRACK_VEL_CROSS,
)
from axialnav.fusion.outcome import Health, Reason
from axialnav.models.jit import Record, Records, kernel
from axialnav.models.state import E_POS, E_VEL, N_ERROR, N_NOMINAL, POS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DEAD_RECKONING, VELOCITY_INVALID = int(Health.DEAD_RECKONING), int(Health.VELOCITY_INVALID)
ACCELEROMETER_FAULT, UWB_SUSPECT = int(Health.ACCELEROMETER_FAULT), int(Health.UWB_SUSPECT)
POSITION_RESET = int(Health.POSITION_RESET)
NOT_ALIGNED = int(Reason.NOT_ALIGNED)
GAP_BLEND = 0.02
RESET_SHOWN_S = 1.0
SUSPECT_TRUST = 0.1


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
    """Process sorted events; ``track`` gets a row per inertial sample, ``log`` (n, 10) a row per event.

    Returns the number of track rows written.  A row of ``log`` holds in its first column the number of axes, or minus
    the reason why the reading could not be used (0 for inertial samples).
    """
    m, w, c = core[0], scratch[0], settings[0]
    rows = 0
    for e in range(t_ns.shape[0]):
        s, seen = sources[source[e]], memory[source[e]]
        if s.kind == 0:
            dt = propagate(t_ns[e], values[e], s.R_BS, m, w, c)
            if dt > 0.0:
                supervise_imu(dt, m, c)
            write_track(m, track[rows])
            track[rows, TRACK_FLAGS] = health(t_ns[e], sources, memory, m, c)
            rows += 1
        elif m.started == 0:
            log[e, LOG_CODE] = -NOT_ALIGNED
        else:
            process(t_ns[e], s, seen, values[e], m, w, c, log[e])
    return rows


@kernel
def process(t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record, log: Array) -> None:
    """One reading: bookkeeping, both filters, recovery."""
    kind = s.kind
    gap_s = (t_ns - seen.t_seen) * 1e-9
    note_arrival(t_ns, gap_s, kind, values, seen, m)
    # the rival first, so that the record and the scratch left behind are the estimate's
    evidence, both_used = 0.0, m.on_trial == 1
    for row in range(m.on_trial, -1, -1):
        likelihood = fuse(row, t_ns, s, seen, values, m, w, c)
        evidence += likelihood if row == 1 else -likelihood
        both_used = both_used and w.row[LOG_CODE] > 0.0
    if both_used:
        m.evidence += evidence
    for k in range(LOG_WIDTH):
        log[k] = w.row[k]
    used = log[LOG_CODE] > 0.0 and log[LOG_WEIGHT] > MIN_WEIGHT
    if used:
        seen.t_fused = t_ns
        if FLOW <= kind <= BLUR:
            m.t_flow = t_ns
            m.t_aid = t_ns
    if is_uwb(kind):
        if used:
            m.t_aid = t_ns
        if log[LOG_CODE] > 0.0:
            observe_source(t_ns, gap_s, int(log[LOG_CODE]), log[LOG_WEIGHT], seen, w)
        if not used:
            reanchor(t_ns, seen, m, w, c)


@kernel
def note_arrival(t_ns: int, gap_s: float, kind: int, values: Array, seen: Record, m: Record) -> None:
    """Learn how often the source speaks and, for heights, where its zero is."""
    if gap_s < 1.0:
        known = np.isfinite(seen.gap_s)
        seen.gap_s = seen.gap_s + GAP_BLEND * (gap_s - seen.gap_s) if known else max(gap_s, 1e-3)
    seen.t_seen = t_ns
    if kind == HEIGHT and not np.isfinite(seen.datum_m):
        seen.datum_m = values[0] - m.x[0, POS + 2]


@kernel
def health(t_ns: int, sources: Records, memory: Records, m: Record, c: Record) -> int:
    """Flags of :class:`~axialnav.fusion.outcome.Health` at ``t_ns``."""
    flags = 0
    silent_s = (t_ns - m.t_aid) * 1e-9
    if silent_s > c.dead_reckoning_s:
        flags |= DEAD_RECKONING
    if silent_s > c.invalid_s:
        flags |= VELOCITY_INVALID
    if m.imu_fault == 1:
        flags |= ACCELEROMETER_FAULT
    if m.resets > 0 and (t_ns - m.t_reset) * 1e-9 < RESET_SHOWN_S:
        flags |= POSITION_RESET
    for i in range(sources.shape[0]):
        if is_uwb(sources[i].kind) and memory[i].trust < SUSPECT_TRUST:
            flags |= UWB_SUSPECT
    return flags


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
