"""Where windows are cut from the frames of a stream, so that the next estimate needs those of the new frame alone.

Windows have to follow the wall.  Cut around the middle of every estimate anew, all of them have other starts each time,
and all their transforms are to be done again.  Here a section of the wall is chosen that lies a little ahead of the
motion and is a little shorter than what all frames share; every frame is cut once, where the section is in it, until
the section leaves the picture or the motion has become another one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]
SPARE_SHARE = 0.03  # of what all frames share: given away ahead of the motion
SPARE_FRAMES = 64  # a section need not last longer
WIDE_PX = 640  # smaller pictures have no columns to spare, and take no time
EDGE_PX = 2  # on both sides: whole pixels, and motion that is not quite even
TINY_PX = 1e-9
OFF_PX = 1.5  # from where the motion has the section: more is not the motion that frames were cut for


class Anchor:
    """First column of the section in every frame of a ring, decided once a frame.

    Parameters
    ----------
    width
        Of the frames [px].
    frames
        Length of the ring.

    Attributes
    ----------
    length
        Of the section [px].
    start
        First column of the section in the frame of every slot.
    serial
        Number of that decision, each greater than those before; 0 where none has been taken.
    """

    def __init__(self, width: int, frames: int) -> None:
        self._width, self._count, self._middle = width, 0, 0
        self._aimed_px = math.nan
        self.length = width
        self.start, self.serial = [0] * frames, [0] * frames

    def release(self, slot: int) -> None:
        """Another frame has come into the slot."""
        self.serial[slot] = 0

    def aim(self, order: list[int], displacement_px: float) -> None:
        """Decide for all frames that have no start yet; for all anew where those of the others do not suit the motion.

        Parameters
        ----------
        order
            Slots, oldest first.
        displacement_px
            Of the wall, per frame.

        Notes
        -----
        Frames of which none has a start may be all there is, and share as much of the wall as they can.
        """
        if displacement_px == self._aimed_px and all(self.serial[slot] for slot in order):
            return
        self._aimed_px = displacement_px
        way = [displacement_px * (k - 0.5 * (len(order) - 1)) for k in range(len(order))]
        known = [self.start[slot] - x for slot, x in zip(order, way, strict=True) if self.serial[slot]]
        if known:
            middle = sum(known) / len(known)
            fresh = {slot: round(middle + x) for slot, x in zip(order, way, strict=True) if not self.serial[slot]}
            inside = all(0 <= start <= self._width - self.length for start in fresh.values())
            if inside and max(known) - middle <= OFF_PX and middle - min(known) <= OFF_PX:
                self._decide(fresh, round(middle))
                return
        self._begin(order, way, displacement_px, bool(known))

    def offsets(self, order: list[int]) -> Index:
        """Starts in these slots [px], around zero for those of the last aim."""
        return np.array([self.start[slot] - self._middle for slot in order], dtype=np.int64)

    def _begin(self, order: list[int], way: list[float], displacement_px: float, streaming: bool) -> None:
        places = [round(x) for x in way]
        lowest = min(places)
        common = self._width - (max(places) - lowest)
        ahead = edge = 0
        if streaming and self._width >= WIDE_PX:
            many = min(int(SPARE_SHARE * common / max(abs(displacement_px), TINY_PX)), SPARE_FRAMES)
            ahead, edge = math.ceil(many * abs(displacement_px)), EDGE_PX if many else 0
        self.length = common - ahead - 2 * edge
        first = edge - lowest + (ahead if displacement_px < 0.0 else 0)
        self._decide({slot: first + place for slot, place in zip(order, places, strict=True)}, first)

    def _decide(self, starts: dict[int, int], middle: int) -> None:
        self._middle = middle
        for slot, start in starts.items():
            self._count += 1
            self.start[slot], self.serial[slot] = start, self._count
