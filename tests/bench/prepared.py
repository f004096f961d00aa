"""A flight as the compiled kernel gets it, so that the kernel alone can be timed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.config import Config
from axialnav.fusion.events import Events, pack_tables
from axialnav.fusion.kernels.run import run
from axialnav.fusion.kernels.update import MIN_WEIGHT
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_WEIGHT,
    LOG_WIDTH,
    TRACK_WIDTH,
    Memory,
    Records,
    build_settings,
    new_memory,
    new_scratch,
)
from axialnav.fusion.sources import Kind, build_sources
from axialnav.replay.flight import Flight
from axialnav.replay.run import resolve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prepared:
    """Sorted events with the filter aligned and not yet run."""

    config: Config
    events: Events
    sources: Records
    settings: Records
    start: Memory

    def buffers(self) -> tuple[Memory, Array, Array]:
        """Fresh memory, track and log; every page of them already touched."""
        imu = int((self.sources["kind"][self.events.source] == int(Kind.IMU)).sum())
        return self.start.copy(), np.full((imu, TRACK_WIDTH), 0.0), np.full((len(self.events.t_ns), LOG_WIDTH), 0.0)

    def run(self, buffers: tuple[Memory, Array, Array]) -> None:
        """All events through the kernel in one call."""
        memory, track, log = buffers
        run(
            *self.events, self.sources, memory.core, memory.sources, new_scratch(), self.settings, track, log
        )  # fmt: skip

    def fused(self) -> int:
        """Readings, inertial ones left out, that changed the state in one run."""
        memory, track, log = self.buffers()
        self.run((memory, track, log))
        return int((log[:, LOG_WEIGHT] > MIN_WEIGHT).sum())

    def steps(self) -> int:
        """Inertial samples plus scalar updates tried in one run."""
        memory, track, log = self.buffers()
        self.run((memory, track, log))
        return len(track) + int(np.maximum(log[:, LOG_CODE], 0.0).sum())

    def with_events(self, events: Events) -> Prepared:
        """The same filter before other events."""
        return Prepared(self.config, events, self.sources, self.settings, self.start)


def prepare(flight: Flight) -> Prepared:
    """Everything before the kernel: packing, sorting, alignment."""
    config = resolve(None, flight)
    sources, events = build_sources(config), pack_tables(config, flight.tables_for(config))
    memory = new_memory(len(sources))
    align(config, sources, events, memory)
    return Prepared(config, events, sources, build_settings(config), memory)


def halfway(prepared: Prepared) -> Prepared:
    """The filter in the middle of the flight, before the other half of the events."""
    cut = len(prepared.events.t_ns) // 2
    first = prepared.with_events(Events(*(column[:cut] for column in prepared.events)))
    memory, track, log = first.buffers()
    first.run((memory, track, log))
    rest = Events(*(column[cut:] for column in prepared.events))
    return Prepared(prepared.config, rest, prepared.sources, prepared.settings, memory)


def one_kind(prepared: Prepared, kind: Kind, count: int) -> Events:
    """The next reading of ``kind`` again and again, aids at the stamp of the last inertial sample."""
    of = prepared.sources["kind"][prepared.events.source]
    row = np.flatnonzero(of == int(kind))[0]
    step_ns = 4_000_000 if kind == Kind.IMU else 0
    stamps = int(prepared.start.core["t_imu"][0]) + step_ns * np.arange(1, count + 1)
    rows = np.full(count, row)
    return Events(stamps, prepared.events.source[rows], prepared.events.values[rows])
