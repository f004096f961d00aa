"""Readings as rows of numbers, in any order, into the ring and through a filter."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.events import WIDTH
from axialnav.fusion.kernels.stream import DONE, FULL, HELD, TOO_OLD, forget, place, remember, rewind, take_at
from axialnav.fusion.memory import LOG_WIDTH, TRACK_WIDTH, Memory, Records, new_scratch
from axialnav.fusion.ring import Ring, new_ring
from axialnav.models.jit import native

__all__ = ["DONE", "HELD", "TOO_OLD", "CompiledStream", "SteppedStream", "Stream"]

Array = NDArray[np.float64]
Step = Callable[[int, int, Array, Memory, Array], None]
INBOX_LAYOUT = struct.Struct(f"qq{WIDTH}d")


class Stream(ABC):
    """Order and history of a streaming filter; how an event is processed is the business of the two subclasses.

    Parameters
    ----------
    n_sources
        Number of sources.
    reach_ns
        How far behind the newest event a reading may come [ns].
    """

    STRIDE: ClassVar[int]  # events between snapshots

    def __init__(self, n_sources: int, reach_ns: int) -> None:
        self._out = np.zeros((2, LOG_WIDTH))
        self.row = self._out[0].data  # of Python floats: quicker to read than an array
        self.ring = new_ring(n_sources, reach_ns, self.STRIDE)
        self._use(self.ring)

    def push(self, t_ns: int, source: int, values: tuple[float, ...]) -> int:
        """Take one event of ``WIDTH`` values: DONE, TOO_OLD, or HELD until :meth:`restart`.

        Once done, :attr:`row` is the row of the log that belongs to it.
        """
        INBOX_LAYOUT.pack_into(self._inbox, 0, t_ns, source, *values)
        code = self._take()
        while code == FULL:
            self.ring = self.ring.grown()
            self._use(self.ring)
            code = self._take()
        return code

    def restart(self, memory: Memory, keep_from_ns: int) -> None:
        """Run all events held from the state ``memory``; those up to ``keep_from_ns`` are what it was found from."""
        self.ring.load(memory)
        head = self.ring.head
        head["keep_from_ns"], head["aligned"], head["restart"] = keep_from_ns, 1, 1
        self._take()

    def hold(self) -> None:
        """Hold what comes from now on, until :meth:`restart`."""
        self.ring.head["aligned"] = 0

    def _use(self, ring: Ring) -> None:
        self._inbox = ring.inbox.view(np.uint8).data

    @abstractmethod
    def _take(self) -> int:
        """Process the event in the inbox, or everything held if a restart is asked for."""


class CompiledStream(Stream):
    """Stream through the compiled kernel: one call a reading."""

    STRIDE = 64  # a snapshot takes as long as a dozen events

    def __init__(self, sources: Records, settings: Records, reach_ns: int) -> None:
        self._sources, self._settings = sources, settings
        self._scratch, self._track = new_scratch(), np.zeros((1, TRACK_WIDTH))
        self._call = native(take_at)
        super().__init__(len(sources), reach_ns)

    def _use(self, ring: Ring) -> None:
        super()._use(ring)
        self._sizes = np.array([len(ring.t_ns), len(ring.free), len(ring.live), len(self._sources)])
        arrays = (
            *ring, self._sources, self._scratch, self._settings, self._out, self._track, self._sizes,
        )  # fmt: skip
        self._block = np.array([array.ctypes.data for array in arrays], dtype=np.uintp)
        self._address = self._block.ctypes.data

    def _take(self) -> int:
        return self._call(self._address)


class SteppedStream(Stream):
    """Stream through a filter in Python, one step an event."""

    STRIDE = 8  # an event takes as long as a dozen snapshots

    def __init__(self, n_sources: int, reach_ns: int, step: Step) -> None:
        super().__init__(n_sources, reach_ns)
        self._step = step

    def _take(self) -> int:
        ring, start = self.ring, 0
        h = ring.head[0]
        if not h["restart"]:
            code = place(h, *ring[1:5], ring.inbox[0])
            if code != DONE:
                return code
            late = h["wanted"] < h["count"] - 1
            start = rewind(h, ring.slot, ring.free, ring.kept, ring.live) if late else int(h["wanted"])
        h["restart"] = 0
        for e in range(start, int(h["count"])):
            remember(e, h, ring.slot, ring.free, ring.kept, ring.live)
            row = self._out[0 if e == h["wanted"] else 1]
            row[:] = 0.0
            self._step(int(ring.t_ns[e]), int(ring.source[e]), ring.values[e], ring.memory, row)
        forget(h, *ring[1:6])
        return DONE
