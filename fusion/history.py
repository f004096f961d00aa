"""History ring: the last second of events with snapshots, so that a late reading is processed where it belongs.

A late reading rolls the filter back to a snapshot before its stamp, and everything since then runs again in the order
of stamps.  The same readings in any order of arrival within the ring therefore give the same bits.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.memory import Memory

Array = NDArray[np.float64]
Key = tuple[Any, ...]  # stamp [ns], source, values


@dataclass(slots=True)
class Entry:
    """One event: its place in the order, its numbers and, now and then, the filter as it was before."""

    key: Key
    values: Array
    before: Memory | None = None

    @property
    def t_ns(self) -> int:
        """Stamp [ns]."""
        return int(self.key[0])

    @property
    def source(self) -> int:
        """Index of the source."""
        return int(self.key[1])


@dataclass(slots=True)
class History:
    """Events of the last ``reach_ns`` in order; every ``stride``-th carries a snapshot."""

    reach_ns: int
    stride: int = 16
    entries: list[Entry] = field(default_factory=list)
    trimmed: bool = False  # whether anything has been forgotten yet

    def can_hold(self, t_ns: int) -> bool:
        """Whether a reading of that stamp can still be put into order."""
        return not self.entries or t_ns >= self.entries[0].t_ns

    def insert(self, t_ns: int, source: int, values: Array) -> int:
        """Put an event where it belongs; return its index.

        Ties are broken as :func:`axialnav.fusion.events.tie_break` does for whole tables.
        """
        key = (t_ns, source, *[math.inf if math.isnan(v) else v for v in values.tolist()])
        if not self.entries or key >= self.entries[-1].key:
            self.entries.append(Entry(key, values))
            return len(self.entries) - 1
        index = bisect_right(self.entries, key, key=lambda entry: entry.key)
        self.entries.insert(index, Entry(key, values))
        return index

    def rewind(self, index: int) -> tuple[int, Memory]:
        """Where to run from so that the event at ``index`` is processed in order, and the filter as it was there."""
        later = self.entries[index + 1 :]
        if later and later[0].before is not None:
            self.entries[index].before = later[0].before  # before the next was before the new one
        for entry in later:
            entry.before = None
        start = index
        while self.entries[start].before is None:
            start -= 1
        snapshot = self.entries[start].before
        assert snapshot is not None
        return start, snapshot.copy()

    def remember(self, index: int, memory: Memory) -> None:
        """Keep a snapshot before the event at ``index`` if the last one is ``stride`` events back."""
        for at in range(index, max(index - self.stride, -1), -1):
            if self.entries[at].before is not None:
                return
        self.entries[index].before = memory.copy()

    def forget(self, keep_from_ns: int) -> None:
        """Drop what is older than the ring reaches, but nothing from ``keep_from_ns`` on while that is in reach.

        The oldest event kept carries a snapshot.
        """
        limit = self.entries[-1].t_ns - self.reach_ns
        if limit <= keep_from_ns:
            return
        if self.entries[0].t_ns > limit - self.reach_ns // 4:
            return  # trimming in lumps keeps the cost per reading constant
        cut = 0
        for index, entry in enumerate(self.entries):
            if entry.t_ns > limit:
                break
            if entry.before is not None:
                cut = index
        self.trimmed = self.trimmed or cut > 0
        del self.entries[:cut]
