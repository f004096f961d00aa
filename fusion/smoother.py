"""Offline smoothing: what the filter would have said had it known the readings still to come.

The filter runs forward and keeps its memory every few seconds; then each stretch, from the last to the first, is run
again, recorded and smoothed (:mod:`axialnav.fusion.kernels.smooth`).  Time grows with the length of the flight, memory
does not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.batch import BatchResult, run_batch, unpack_track
from axialnav.fusion.config import Config
from axialnav.fusion.events import Events, Table, pack_tables
from axialnav.fusion.handedness import mirror_config, mirror_tables, mirror_track
from axialnav.fusion.kernels.record import advance, record
from axialnav.fusion.kernels.smooth import STEP, WORK, smooth_back
from axialnav.fusion.memory import (
    LOG_WIDTH,
    TRACK_WIDTH,
    Memory,
    build_settings,
    new_memory,
    new_scratch,
    whole_covariance,
)
from axialnav.fusion.outcome import Track
from axialnav.fusion.sources import Kind, Records, build_sources
from axialnav.models.state import N_BIASES

Array = NDArray[np.float64]
STRETCH = 2000  # events between two cuts: 20 MB of records


def run_smoothed(
    config: Config, tables: Mapping[str, Table], progress: Callable[[float], None] | None = None
) -> BatchResult:
    """Filter, then smooth; the track of the result is the smoothed one, the log is the filter's.

    Flags and reset counts in the track are the filter's too: they tell what aided it, which smoothing cannot change.

    Parameters
    ----------
    config, tables, progress
        As for :func:`axialnav.fusion.batch.run_batch`.

    Raises
    ------
    ConfigError, FlightError
        As for :func:`axialnav.fusion.batch.run_batch`.
    """
    result = run_batch(config, tables, progress and (lambda share: progress(0.3 * share)))
    left = result.handedness == "left"
    if left:
        config, tables = mirror_config(config), mirror_tables(tables)
    pass_ = Pass.begin(config, tables)
    spent = pass_.forward()
    spent += pass_.backward(progress and (lambda share: progress(0.3 + 0.7 * share)))
    track = pass_.track()
    return replace(result, track=mirror_track(track) if left else track, kernel_s=result.kernel_s + spent)


@dataclass(slots=True)
class Pass:
    """Both ways over one recording.

    ``cuts`` holds event index, track row and filter memory at the beginning of each stretch, and at the end.
    """

    events: Events
    sources: Records
    settings: Records
    cuts: list[tuple[int, int, Memory]]
    rows: Array
    log: Array
    steps: int = 0

    @classmethod
    def begin(cls, config: Config, tables: Mapping[str, Table]) -> Pass:
        """Pack the readings and find the first state."""
        sources = build_sources(config)
        events = pack_tables(config, {name: table for name, table in tables.items() if name not in config.disabled})
        memory = new_memory(len(sources))
        align(config, sources, events, memory)
        samples = int((sources["kind"][events.source] == int(Kind.IMU)).sum())
        rows, log = np.zeros((samples, TRACK_WIDTH)), np.zeros((len(events.t_ns), LOG_WIDTH))
        return cls(events, sources, build_settings(config), [(0, 0, memory)], rows, log)

    def forward(self, stretch: int = STRETCH) -> float:
        """Filter and cut; return the time spent in the kernel [s]."""
        scratch, memory, at, row = new_scratch(), self.cuts[0][2].copy(), 0, 0
        is_imu = self.sources["kind"][self.events.source] == int(Kind.IMU)
        spent = 0.0
        while at < len(self.events.t_ns):
            began = time.perf_counter()
            end = advance(
                at, stretch, *self.events, self.sources, memory.core, memory.sources, scratch, self.settings,
                self.rows[row:], self.log,
            )  # fmt: skip
            spent += time.perf_counter() - began
            row += int(is_imu[at:end].sum())
            at = end
            self.cuts.append((at, row, memory.copy()))
        return spent

    def backward(self, progress: Callable[[float], None] | None = None, *, smooth: bool = True) -> float:
        """Smooth from the last stretch to the first; return the time spent in the kernels [s].

        Without ``smooth`` the stretches are only recorded again, so that the two can be timed apart.
        """
        longest = max((b[0] - a[0] for a, b in pairwise(self.cuts)), default=0)
        # a row more than there can be steps: the record of an event that turns out to be no step
        steps, work, scratch = np.zeros(longest + 1, STEP), np.zeros(1, WORK), new_scratch()
        one_row, one_log, imu = np.zeros((1, TRACK_WIDTH)), np.zeros((1, LOG_WIDTH)), np.zeros(6)
        paths = np.zeros(N_BIASES, np.int64)
        last = self.cuts[-1][2].core
        work["x"][0], work["P"][0] = last["x"][0, 0], whole_covariance(last["P"][0, 0])
        spent, self.steps = 0.0, 0
        for (start, row, memory), (stop, _, _) in zip(self.cuts[-2::-1], self.cuts[:0:-1], strict=True):
            began = time.perf_counter()
            again = memory.copy()
            n = record(
                start, stop, *self.events, self.sources, again.core, again.sources, scratch, self.settings,
                one_row, one_log, imu, paths, steps,
            )  # fmt: skip
            if smooth:
                smooth_back(steps, n, work, self.rows[row:])
            spent += time.perf_counter() - began
            self.steps += n
            if progress is not None:
                progress(1.0 - start / max(len(self.events.t_ns), 1))
        return spent

    def track(self) -> Track:
        """Rows so far, named: filtered before :meth:`backward`, smoothed after."""
        is_imu = self.sources["kind"][self.events.source] == int(Kind.IMU)
        return unpack_track(self.events.t_ns[is_imu], self.rows, len(self.sources))
