"""Bytes in, frames out: finds frames in a stream that may be damaged, joined in the middle or not theirs at all."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

import msgspec

from axialnav.fusion.live.nooploop.frames import Frame
from axialnav.fusion.live.nooploop.layouts import MORE, REFUSED, Implausible, Layout, all_layouts


class DecoderStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What a decoder has seen so far.

    Attributes
    ----------
    frames
        Name of the frame -> how many were decoded.
    damaged
        Name of the frame -> how many looked like one and had the wrong sum.
    skipped_bytes
        Bytes that belonged to no frame.
    total_bytes
        All bytes taken in.
    waiting_bytes
        Beginning of a frame that is not complete yet.
    """

    frames: dict[str, int]
    damaged: dict[str, int]
    skipped_bytes: int
    total_bytes: int
    waiting_bytes: int


class NLinkDecoder:
    """Streaming decoder for one serial line.

    Parameters
    ----------
    only
        Names of the frames to look for (as the classes in :mod:`~axialnav.fusion.live.nooploop.frames`); None: all.

    Notes
    -----
    A frame is taken if its length, its counts and its sum agree.  After a damaged one the search goes on at the byte
    behind its head, because the header byte 0x55 also stands inside payloads.  At most one frame (4096 bytes) waits.
    """

    def __init__(self, only: Iterable[str] | None = None) -> None:
        wanted = None if only is None else set(only)
        self._layouts: dict[bytes, list[Layout]] = {}
        for layout in all_layouts():
            if wanted is None or layout.name in wanted:
                self._layouts.setdefault(layout.head, []).append(layout)
        unknown = (wanted or set()) - {layout.name for group in self._layouts.values() for layout in group}
        if unknown:
            known = ", ".join(layout.name for layout in all_layouts())
            raise ValueError(f"no frame named {', '.join(sorted(unknown))}; there are {known}")
        self._heads = re.compile(b"|".join(re.escape(head) for head in self._layouts), re.DOTALL)
        self._first = {head[0] for head in self._layouts}
        self._buffer = bytearray()
        self._frames: Counter[str] = Counter()
        self._damaged: Counter[str] = Counter()
        self._skipped = self._total = 0

    @property
    def status(self) -> DecoderStatus:
        """Counters so far."""
        return DecoderStatus(
            frames=dict(self._frames),
            damaged=dict(self._damaged),
            skipped_bytes=self._skipped,
            total_bytes=self._total,
            waiting_bytes=len(self._buffer),
        )

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes in, give the frames that they complete, in the order of the stream; never raises on content."""
        self._total += len(data)
        self._buffer += data
        block = bytes(self._buffer)
        found: list[Frame] = []
        at = 0
        with memoryview(block) as view:
            while at < len(block):
                head = self._heads.search(block, at)
                if head is None:
                    end = len(block) - (block[-1] in self._first)
                    self._skipped += max(end - at, 0)
                    at = max(end, at)
                    break
                self._skipped += head.start() - at
                at = head.start()
                taken = self._take(view, block, at, found)
                if taken == MORE:
                    break
                self._skipped += taken == REFUSED
                at += taken or 1
        del self._buffer[:at]
        return found

    def _take(self, view: memoryview, block: bytes, at: int, found: list[Frame]) -> int:
        """Length of the frame at a place, which goes to ``found``; MORE if it may still come, REFUSED if it cannot."""
        answer = REFUSED
        damaged = None
        for layout in self._layouts[block[at : at + 2]]:
            size = layout.size(view[at:])
            if size == REFUSED:
                continue
            if size == MORE or at + size > len(block):
                answer = MORE
                continue
            if layout.intact(view[at : at + size]):
                try:
                    found.append(layout.unpack(block[at : at + size]))
                except Implausible:
                    continue
                self._frames[layout.name] += 1
                return size
            damaged = damaged or layout.name
        if answer == REFUSED and damaged is not None:
            self._damaged[damaged] += 1
        return answer
