"""Memory of the streaming estimator: the last second of events in order, with snapshots of the filter between them.

One block of plain arrays, so that one compiled call takes a reading, puts it where it belongs and runs the filter from
there (:mod:`axialnav.fusion.kernels.stream`).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.events import WIDTH, Events
from axialnav.fusion.memory import MEMORY, SOURCE_MEMORY, Memory, Records, new_memory

Ints = NDArray[np.int64]
Array = NDArray[np.float64]

CAPACITY: Final = 1024

HEAD: Final = np.dtype(
    [
        ("count", "i8"),  # events held
        ("free", "i8"),  # snapshots not in use
        ("reach_ns", "i8"),
        ("stride", "i8"),  # events between snapshots: a late reading runs these again at most, and those behind it
        ("keep_from_ns", "i8"),  # events of the first window are kept while they are in reach
        ("trimmed", "i8"),  # whether anything has been forgotten yet
        ("aligned", "i8"),  # whether there is a state
        ("wanted", "i8"),  # index of the event whose outcome is asked for
        ("restart", "i8"),  # whether to run all events from the first on instead of taking one in
    ]
)
INBOX: Final = np.dtype([("t_ns", "i8"), ("source", "i8"), ("values", "f8", WIDTH)])


class Ring(NamedTuple):
    """Events ``[0:count]`` in order of processing; ``slot`` says where the filter before an event is kept, or -1.

    Shapes: head (1,), t_ns, source and slot (C,), values (C, 8), free (K,), kept (K, words of the memory),
    live (words of the memory,), inbox (1,).  ``core`` and ``sources`` name the words of ``live``, the filter as it is.
    """

    head: Records
    t_ns: Ints
    source: Ints
    values: Array
    slot: Ints
    free: Ints
    kept: Ints
    live: Ints
    core: Records
    sources: Records
    inbox: Records

    @property
    def memory(self) -> Memory:
        """The filter as it is now; a view, not a copy."""
        return Memory(self.core, self.sources)

    @property
    def events(self) -> Events:
        """Events held, as views."""
        n = int(self.head["count"][0])
        return Events(self.t_ns[:n], self.source[:n], self.values[:n])

    def load(self, memory: Memory) -> None:
        """Put the filter into the state of ``memory`` and give up all snapshots."""
        self.core[:], self.sources[:] = memory.core, memory.sources
        self.slot[:] = -1
        self.free[:] = np.arange(len(self.free))
        self.head["free"] = len(self.free)

    def drop_before(self, t_ns: int) -> Ints:
        """Drop the events before ``t_ns`` of a filter without a state; return their sources."""
        n = int(self.head["count"][0])
        cut = int(np.searchsorted(self.t_ns[:n], t_ns))
        dropped = self.source[:cut].copy()
        for column in (self.t_ns, self.source, self.values, self.slot):
            column[: n - cut] = column[cut:n].copy()
        self.head["count"] = n - cut
        return dropped

    def grown(self) -> Ring:
        """Copy with twice the room."""
        larger = _allocate(2 * len(self.t_ns), self.memory, int(self.head["stride"][0]))
        n = int(self.head["count"][0])
        for new, old in zip(larger[:5], self[:5], strict=True):
            new[: min(n, len(old))] = old[: min(n, len(old))]
        larger.head[:] = self.head
        added = len(larger.free) - len(self.free)
        left = int(self.head["free"][0])
        larger.free[:left] = self.free[:left]
        larger.free[left : left + added] = np.arange(len(self.free), len(larger.free))
        larger.head["free"] += added
        larger.kept[: len(self.kept)] = self.kept
        larger.inbox[:] = self.inbox
        return larger


def new_ring(n_sources: int, reach_ns: int, stride: int) -> Ring:
    """Ring without events, of a filter that has not started."""
    ring = _allocate(CAPACITY, new_memory(n_sources), stride)
    ring.head["reach_ns"] = reach_ns
    ring.head["keep_from_ns"] = -(2**62)
    return ring


def _allocate(capacity: int, memory: Memory, stride: int) -> Ring:
    snapshots = capacity // stride + 2
    core_words = MEMORY.itemsize // 8
    words = core_words + len(memory.sources) * SOURCE_MEMORY.itemsize // 8
    live = np.zeros(words, np.int64)
    ring = Ring(
        head=np.zeros(1, HEAD),
        t_ns=np.zeros(capacity, np.int64),
        source=np.zeros(capacity, np.int64),
        values=np.zeros((capacity, WIDTH)),
        slot=np.zeros(capacity, np.int64),
        free=np.zeros(snapshots, np.int64),
        kept=np.zeros((snapshots, words), np.int64),
        live=live,
        core=live[:core_words].view(MEMORY),
        sources=live[core_words:].view(SOURCE_MEMORY),
        inbox=np.zeros(1, INBOX),
    )
    ring.head["stride"] = stride
    ring.load(memory)
    return ring
