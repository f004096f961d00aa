"""A whole recording through the compiled kernel."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.config import Config
from axialnav.fusion.events import Events, Table, pack_tables, reading_stamps
from axialnav.fusion.handedness import explains_better, is_undecided, mirror_config, mirror_tables, mirror_track
from axialnav.fusion.kernels.run import run
from axialnav.fusion.kernels.update import MIN_WEIGHT
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_GATE,
    LOG_INNOVATION,
    LOG_NIS,
    LOG_REASON,
    LOG_VARIANCE,
    LOG_WEIGHT,
    LOG_WIDTH,
    TRACK_FLAGS,
    TRACK_POS_CROSS,
    TRACK_RESETS,
    TRACK_STATES,
    TRACK_VARIANCE,
    TRACK_VEL_CROSS,
    TRACK_WIDTH,
    Memory,
    build_settings,
    new_memory,
    new_scratch,
)
from axialnav.fusion.outcome import InnovationLog, Reason, Track, Verdict, verdict_of
from axialnav.fusion.sources import Kind, Records, build_sources, fused_sensors
from axialnav.fusion.supervisor import unpack_states
from axialnav.models.state import E_POS, E_VEL, N_ERROR, NOMINAL_SLICES

Array = NDArray[np.float64]
CHUNKS = 50
LEFT_HANDED_EVIDENCE = 50.0  # nats by which the mirrored frame must explain the readings better


@dataclass(frozen=True, slots=True)
class BatchResult:
    """What came out of a recording: the track, a record per reading, and the time spent in the kernel [s].

    ``handedness`` is that of the frame in which the flight was surveyed, as given or as found.
    """

    track: Track
    log: InnovationLog
    kernel_s: float
    events: int
    handedness: str = "right"


def run_batch(
    config: Config, tables: Mapping[str, Table], progress: Callable[[float], None] | None = None
) -> BatchResult:
    """Run the filter over recorded tables.

    Parameters
    ----------
    config
        Resolved configuration: sensors, surfaces, first state, noise.
    tables
        Readings by sensor name; sensors that are switched off or not described are left out.
    progress
        Called with the finished share (0..1) about fifty times.

    Raises
    ------
    ConfigError, FlightError
        The configuration does not describe a usable rig, or the recording cannot start a filter.
    """
    if config.handedness == "left":
        return _run_mirrored(config, tables, progress)
    result = _run(config, tables, progress)
    if is_undecided(config):
        mirrored = _run_mirrored(config, tables, None)
        if explains_better(mirrored.log, result.log) > LEFT_HANDED_EVIDENCE:
            return mirrored
    return result


def _run_mirrored(config: Config, tables: Mapping[str, Table], progress: Callable[[float], None] | None) -> BatchResult:
    result = _run(mirror_config(config), mirror_tables(tables), progress)
    return replace(result, track=mirror_track(result.track), handedness="left")


def _run(config: Config, tables: Mapping[str, Table], progress: Callable[[float], None] | None) -> BatchResult:
    src, settings = build_sources(config), build_settings(config)
    enabled = {name: table for name, table in tables.items() if name not in config.disabled}
    events = pack_tables(config, enabled)
    memory = new_memory(len(src))
    align(config, src, events, memory)
    is_imu = src["kind"][events.source] == int(Kind.IMU)
    track = np.zeros((int(is_imu.sum()), TRACK_WIDTH))
    log = np.zeros((len(events.t_ns), LOG_WIDTH))
    scratch, done, spent = new_scratch(), 0, 0.0
    _step(
        events.part(slice(0, 0)), src, memory, scratch, settings, track, log
    )  # loads or compiles the kernel: not the filter's time
    for part in np.array_split(np.arange(len(events.t_ns)), CHUNKS):
        cut = slice(part[0], part[-1] + 1) if len(part) else slice(0, 0)
        began = time.perf_counter()
        done += _step(events.part(cut), src, memory, scratch, settings, track[done:], log[cut])
        spent += time.perf_counter() - began
        if progress is not None and len(part):
            progress((part[-1] + 1) / len(events.t_ns))
    return BatchResult(
        unpack_track(events.t_ns[is_imu], track, len(src)),
        unpack_log(config, events, ~is_imu, log),
        spent,
        len(events.t_ns),
    )


def _step(
    events: Events, src: Records, memory: Memory, scratch: Records, settings: Records, track: Array, log: Array
) -> int:
    return run(*events, src, memory.core, memory.sources, scratch, settings, track, log)


def unpack_track(t_ns: NDArray[np.int64], rows: Array, sources: int) -> Track:
    """Name the columns of track rows; ``sources`` is the number of fused sensors."""
    state = {name: rows[:, cut] for name, cut in NOMINAL_SLICES.items()}
    scalars = {name: state.pop(name)[:, 0] for name in ("blur_scale", "wall_offset_m")}
    variance = rows[:, TRACK_VARIANCE : TRACK_VARIANCE + N_ERROR]
    return Track(
        t_ns=t_ns,
        **state,
        **scalars,
        position_covariance=_covariance(variance[:, E_POS : E_POS + 3], rows[:, TRACK_POS_CROSS : TRACK_POS_CROSS + 3]),
        velocity_covariance=_covariance(variance[:, E_VEL : E_VEL + 3], rows[:, TRACK_VEL_CROSS : TRACK_VEL_CROSS + 3]),
        sigma_error=np.sqrt(np.maximum(variance, 0.0)),
        flags=rows[:, TRACK_FLAGS].astype(np.int64),
        resets=rows[:, TRACK_RESETS].astype(np.int64),
        source_states=unpack_states(rows[:, TRACK_STATES].astype(np.int64), sources),
    )


def _covariance(variance: Array, cross: Array) -> Array:
    out = np.empty((len(variance), 3, 3))
    for i in range(3):
        out[:, i, i] = variance[:, i]
    for column, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        out[:, i, j] = out[:, j, i] = cross[:, column]
    return out


def unpack_log(config: Config, events: Events, keep: NDArray[np.bool_], rows: Array) -> InnovationLog:
    """Name the columns of log rows and translate codes to verdicts and reasons."""
    rows, code = rows[keep], rows[keep][:, LOG_CODE].astype(np.int64)
    dof = np.maximum(code, 0)
    fused = rows[:, LOG_WEIGHT] > MIN_WEIGHT
    refused = rows[:, LOG_REASON].astype(np.int64)
    gated = np.where(refused > 0, refused, int(Reason.INNOVATION))
    reason = np.where(code < 0, -code, np.where(fused, int(Reason.NONE), gated))
    table = np.array([int(verdict_of(r)) for r in Reason])
    verdict = np.where(fused, int(Verdict.FUSED), table[reason])
    beyond = np.arange(3) >= dof[:, None]
    nothing = dof == 0
    return InnovationLog(
        sensors=fused_sensors(config),
        t_ns=reading_stamps(config, events)[keep],
        source=events.source[keep],
        verdict=verdict,
        reason=reason,
        dof=dof,
        innovation=np.where(beyond, np.nan, rows[:, LOG_INNOVATION : LOG_INNOVATION + 3]),
        variance=np.where(beyond, np.nan, rows[:, LOG_VARIANCE : LOG_VARIANCE + 3]),
        nis=np.where(nothing, np.nan, rows[:, LOG_NIS]),
        gate=np.where(nothing, np.nan, rows[:, LOG_GATE]),
        weight=rows[:, LOG_WEIGHT],
    )
