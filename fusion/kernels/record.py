"""The forward pass of the smoother: the filter's own kernel, event by event, with what the way back needs kept.

A whole flight of covariances would not fit into memory.  The first pass keeps the filter's memory at cuts only; on the
way back each stretch between two cuts is run again, recorded and smoothed.  A filter that is a pure function gives the
same bits both times.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.covariance import complete
from axialnav.fusion.kernels.paths import forget_bias
from axialnav.fusion.kernels.propagate import bias_decay
from axialnav.fusion.kernels.rival import copy_filter
from axialnav.fusion.kernels.run import run
from axialnav.fusion.kernels.smooth import IDENTITY, INERTIAL, NEW_PATHS, REANCHORING
from axialnav.models.imu import strapdown
from axialnav.models.jit import Record, Records
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import N_BIASES, N_NOMINAL

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def advance(
    start: int, wanted: int, t_ns: Ints, source: Ints, values: Array, sources: Records, core: Records,
    memory: Records, scratch: Records, settings: Records, track: Array, log: Array,
) -> int:  # fmt: skip
    """Run ``wanted`` events or more from ``start``, up to where a cut does no harm; return the end.

    Cuts lie right after an inertial sample at which no trial of the rival is under way: a trial that ends well
    replaces the estimate since its beginning, so both must be in one stretch.
    """
    m, rows = core[0], 0
    for e in range(start, t_ns.shape[0]):
        one = slice(e, e + 1)
        rows += run(
            t_ns[one], source[one], values[one], sources, core, memory, scratch, settings, track[rows:], log[one]
        )
        inertial = sources[source[e]].kind == 0
        if inertial and e + 1 - start >= wanted and (m.on_trial == 0 or m.t_trial == m.t_imu):
            return e + 1
    return int(t_ns.shape[0])


@kernel
def record(
    start: int, stop: int, t_ns: Ints, source: Ints, values: Array, sources: Records, core: Records,
    memory: Records, scratch: Records, settings: Records, track: Array, log: Array, imu: Array, paths: Ints,
    steps: Records,
) -> int:  # fmt: skip
    """Run the events ``start:stop`` and write a row of ``steps`` per step; return their number.

    ``track`` (1, 59) and ``log`` (1, 10) are overwritten by each event; ``imu`` (6,) and ``paths`` (8,) are scratch.
    """
    m, w, c = core[0], scratch[0], settings[0]
    n, rows, trial_from = 0, 0, 0
    for e in range(start, stop):
        s = steps[n]
        fault, resets, t_before, started, pair = m.imu_fault, m.resets, m.t_imu, m.started, 1 + m.on_trial
        for k in range(6):
            imu[k] = m.imu[k]
        for k in range(N_BIASES):
            paths[k] = m.path[k]
        for row in range(pair):
            _keep(m.x[row], m.P[row], s.x_before[row], s.P_before[row])
        one = slice(e, e + 1)
        run(t_ns[one], source[one], values[one], sources, core, memory, scratch, settings, track, log)
        new = new_paths(paths, m.path, s.new)
        if sources[source[e]].kind == 0:
            s.dt = (m.t_imu - t_before) * 1e-9 if started == 1 else 0.0
            s.kind = INERTIAL if s.dt > 0.0 else IDENTITY
            s.track_row = rows
            rows += 1
        elif m.resets != resets:
            s.dt, s.kind, s.track_row = 0.0, REANCHORING, -1
        elif new:
            s.dt, s.kind, s.track_row = 0.0, NEW_PATHS, -1
        else:
            continue
        for row in range(pair):
            if s.kind == NEW_PATHS:
                _before_the_update(row, s, m)
                continue
            _keep(m.x[row], m.P[row], s.x_after[row], s.P_after[row])
            if s.kind == INERTIAL:
                _transition(s, row, imu, m, w, c)
        s.chosen = 0
        n += 1
        if m.imu_fault != fault:
            for k in range(trial_from, n):
                steps[k].chosen = 1
        if m.on_trial == 1 and s.kind == INERTIAL and m.t_trial == m.t_imu:
            trial_from = n
    return n


@kernel
def _keep(x: Array, P: Array, to_x: Array, to_P: Array) -> None:
    """Copy a filter with the whole of its covariance."""
    copy_filter(x, P, to_x, to_P)
    complete(to_P)


@kernel
def new_paths(before: Ints, after: Ints, new: Ints) -> bool:
    """Mark in ``new`` (8,) the places that were given to another path; whether there are any."""
    found = False
    for k in range(N_BIASES):
        new[k] = 1 if before[k] != after[k] else 0
        found = found or new[k] == 1
    return found


@kernel
def _before_the_update(row: int, s: Record, m: Record) -> None:
    """The state after biases were started anew and before the reading that was the reason for it is fused."""
    copy_filter(s.x_before[row], s.P_before[row], s.x_after[row], s.P_after[row])
    for k in range(N_BIASES):
        if s.new[k] == 1:
            forget_bias(s.x_after[row], s.P_after[row], k, m.path_variance[k])


@kernel
def _transition(s: Record, row: int, imu: Array, m: Record, w: Record, c: Record) -> None:
    """Blocks of the transition of filter ``row`` over the step that ``s`` describes."""
    for k in range(6):
        w.mean_imu[k] = 0.5 * (imu[k] + m.imu[k])
    for k in range(N_NOMINAL):
        w.x[k] = s.x_before[row, k]
    s.decay[row] = bias_decay(w.x, s.dt, c)
    strapdown(w.x, w.mean_imu[0:3], w.mean_imu[3:6], s.dt, c.gravity_m_s2, w.R, s.F[row])
