"""A recording through the kernels with the filter's memory at hand, for tests that look at the whole covariance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from axialnav.fusion.alignment import align
from axialnav.fusion.config import Config
from axialnav.fusion.events import Table, pack_tables
from axialnav.fusion.kernels.run import run
from axialnav.fusion.memory import LOG_WIDTH, TRACK_WIDTH, Memory, build_settings, new_memory, new_scratch
from axialnav.fusion.sources import build_sources


def memories(config: Config, tables: Mapping[str, Table], parts: int = 1) -> Iterator[tuple[int, Memory]]:
    """Stamp and memory of the filter after each of ``parts`` equal shares of the events."""
    sources, events = build_sources(config), pack_tables(config, tables)
    memory = new_memory(len(sources))
    align(config, sources, events, memory)
    scratch, settings = new_scratch(), build_settings(config)
    for share in np.array_split(np.arange(len(events.t_ns)), parts):
        cut = slice(share[0], share[-1] + 1)
        track, log = np.zeros((len(share), TRACK_WIDTH)), np.zeros((len(share), LOG_WIDTH))
        run(
            events.t_ns[cut], events.source[cut], events.values[cut], sources, memory.core, memory.sources, scratch,
            settings, track, log,
        )  # fmt: skip
        yield int(events.t_ns[share[-1]]), memory
