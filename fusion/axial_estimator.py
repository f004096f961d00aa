"""The axial estimator behind the same door as the corridor estimator, and over a whole recording."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.axial import AxialFilter, axial_settings
from axialnav.fusion.batch import BatchResult, unpack_log, unpack_track
from axialnav.fusion.config import Config
from axialnav.fusion.corridor import CorridorEstimator, NotStartedError, PastStateError
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.events import Events, Table, pack_tables
from axialnav.fusion.kernels.run import health, packed_states, write_track
from axialnav.fusion.memory import LOG_WIDTH, TRACK_FLAGS, TRACK_STATES, TRACK_WIDTH, Memory, Records
from axialnav.fusion.outcome import AxialState, Health
from axialnav.fusion.sources import Kind
from axialnav.fusion.stream import SteppedStream, Stream

Array = NDArray[np.float64]
REPORTS = 50


class AxialEstimator(CorridorEstimator):
    """Four states along the axis (see :mod:`axialnav.fusion.axial`) behind the door of the corridor estimator.

    It needs the autopilot's attitude and takes inertial samples where there are any; all other readings, gates,
    outcomes, the order of late readings and the recovery are the same.  In the state that comes out, position and
    velocity across the axis are what was held, with their sigmas; the gyro bias is zero and the accelerometer bias is
    the one state that stands for the tilt's leak, along the axis in world axes.

    Parameters
    ----------
    config
        Sensors, surfaces, first state and noise; ``[axial]`` holds what only this estimator needs.

    Raises
    ------
    ConfigError
        No attitude source, several inertial units, or a left-handed survey.
    """

    def __init__(self, config: Config | None = None) -> None:
        self._filter = AxialFilter(config or Config())
        super().__init__(config)

    def state(self, t_ns: int | None = None) -> AxialState:
        """State at ``t_ns`` (default: the newest sample that drives the filter), carried forward with that sample.

        Raises
        ------
        NotStartedError
            No attitude yet, or not enough samples.
        PastStateError
            ``t_ns`` lies before the newest sample.
        """
        if not self._aligned:
            raise NotStartedError(
                f"no state yet: the filter starts after {self.config.start.window_s:g} s of samples with an attitude"
            )
        memory = self._stream.ring.memory.copy()
        newest = int(memory.core["t_imu"][0])
        now = newest if t_ns is None else int(t_ns)
        if now < newest:
            raise PastStateError(f"the state at t_ns={now} is past; ask for {newest} or later")
        if now > newest:
            self._filter.coast(memory, (now - newest) * 1e-9)
        flags = health(now, self._sources, memory.sources, memory.core[0], self._settings[0])
        return self._axial_state(now, memory, Health(flags))

    def _build_settings(self) -> Records:
        return axial_settings(self.config)

    def _build_stream(self, reach_ns: int) -> Stream:
        return SteppedStream(len(self._sources), reach_ns, self._filter.step)

    def _align(self, held: Events) -> tuple[Memory, int] | None:
        """First state and end of the first window, once the samples that drive the filter span it."""
        span_s = self._filter.span_s(held)
        if span_s is None or span_s <= self.config.start.window_s:
            return None
        drives = self._sources["kind"][held.source] == int(self._filter.driver)
        end_ns = int(held.t_ns[drives][0]) + round(self.config.start.window_s * 1e9)
        return self._filter.start(held), end_ns


def run_axial(
    config: Config, tables: Mapping[str, Table], progress: Callable[[float], None] | None = None
) -> BatchResult:
    """Run the axial estimator over recorded tables.

    The track has a row per inertial sample, or per attitude where there are no inertial samples; its columns across
    the axis hold what was held.  ``kernel_s`` of the result is the time of the whole loop.

    Parameters
    ----------
    config, tables, progress
        As for :func:`axialnav.fusion.batch.run_batch`.

    Raises
    ------
    ConfigError, FlightError
        No attitude source, several inertial units, a left-handed survey, or a recording that cannot start a filter.
    """
    if config.handedness == "left":
        raise ConfigError(
            'handedness = "left" is not for the axial estimator; reverse the sign of every y of the survey'
        )
    filter_ = AxialFilter(config)
    enabled = {name: table for name, table in tables.items() if name not in config.disabled}
    events = pack_tables(config, enabled)
    memory = filter_.start(events)
    kinds = filter_.sources["kind"][events.source]
    drives = kinds == int(filter_.driver)
    track, log, row = np.zeros((int(drives.sum()), TRACK_WIDTH)), np.zeros((len(events.t_ns), LOG_WIDTH)), 0
    report_every = max(len(events.t_ns) // REPORTS, 1)
    began = time.perf_counter()
    for e, (t_ns, source) in enumerate(zip(events.t_ns.tolist(), events.source.tolist(), strict=True)):
        filter_.step(t_ns, source, events.values[e], memory, log[e])
        if drives[e]:
            core = memory.core[0]
            write_track(core, track[row])
            track[row, TRACK_FLAGS] = health(t_ns, filter_.sources, memory.sources, core, filter_.settings[0])
            track[row, TRACK_STATES] = packed_states(memory.sources)
            row += 1
        if progress is not None and e % report_every == report_every - 1:
            progress((e + 1) / len(events.t_ns))
    spent = time.perf_counter() - began
    not_inertial = kinds != int(Kind.IMU)
    return BatchResult(
        unpack_track(events.t_ns[drives], track, len(filter_.sources)),
        unpack_log(config, events, not_inertial, log),
        spent,
        len(events.t_ns),
    )
