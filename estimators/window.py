"""The last N frames: binned rows, and the spectra and products of spectra of them, kept in rings of fixed size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.anchor import Anchor
from axialnav.estimators.coarse import CoarseSearch
from axialnav.estimators.cuts import Cut, WallCuts
from axialnav.estimators.drift import FAST_DRIFT_PX, Drift, DriftBelief, DriftMeter, hidden_drift_px
from axialnav.estimators.frames import Image, same_picture
from axialnav.estimators.layout import BANDS, binned_coefficients, remove_level, row_layout
from axialnav.estimators.occlusion import OccluderFinder
from axialnav.estimators.positions import centred_times
from axialnav.estimators.products import Products
from axialnav.estimators.rows import bin_height, row_sums
from axialnav.estimators.spectrum import LAST_FREQUENCY, Band
from axialnav.estimators.stretch import Stretch

Plane = NDArray[np.float32]
Index = NDArray[np.int64]


class FrameWindow:
    """A ring of the last ``frames`` frames; nothing grows once it is full.

    Parameters
    ----------
    height, width
        Size of the grey frames [px].
    frames
        Length of the ring.
    dtype
        Type of the pixels.
    borrow
        Whether the frames stay as they are for as long as this window is in use, and need not be copied.
    """

    def __init__(
        self, height: int, width: int, frames: int, dtype: np.dtype[np.unsignedinteger[Any]], borrow: bool = False
    ) -> None:
        self.shape, self.dtype = (height, width), dtype
        self.bin_height = bin_height(height, width)
        self.size = frames
        self.layout = row_layout(height // self.bin_height)
        rows = self.layout.used
        self._top = (height - rows * self.bin_height) // 2  # a roll about the axis must not look like displacement
        self._borrow, self._keep = borrow, hidden_drift_px(self.bin_height, frames) < FAST_DRIFT_PX
        self._images: list[Image] = [np.empty(self.shape, dtype=dtype) for _ in range(frames if self._keep else 1)]
        self._rows = np.empty((frames, rows, width), dtype=np.float32)
        self._shifted = np.zeros((0, rows, width), dtype=np.float32)
        self._sums = row_sums(width, self.bin_height, dtype)
        self._work = np.zeros((1 << self.layout.levels, width), dtype=np.float32)
        self._means = np.zeros((BANDS, width), dtype=np.float32)
        self._anchor = Anchor(width, frames)
        self._cuts = WallCuts(self.layout, width, frames)
        self._occluders = OccluderFinder(width, self.layout.coarse)
        self.coarse = CoarseSearch(self.layout, width, frames)
        self._drift = DriftMeter(height, width, frames)
        self.drift_belief = DriftBelief()
        self.stretch = Stretch()
        self._cut: Cut | None = None
        self.order: list[int] = []

    def clear(self) -> None:
        """Forget all frames."""
        for slot in self.order:
            self._anchor.release(slot)
        self.order.clear()
        self.drift_belief.forget()
        self.stretch.forget()

    @property
    def full(self) -> bool:
        """Whether the ring holds as many frames as it can."""
        return len(self.order) == self.size

    def push(self, image: Image) -> None:
        """Take in one grey frame (h, w); the oldest leaves when the ring is full."""
        slot = self._free_slot()
        self._enter(image, slot)
        self.coarse.push(self._rows[slot], slot, self.order)
        self.order.append(slot)

    def _enter(self, image: Image, slot: int) -> None:
        """Bin a frame, and keep it if it may be looked at again."""
        own = slot if self._keep else 0
        plain = image.flags.c_contiguous and image.flags.writeable  # kernels would be compiled anew for others
        if self._borrow:
            self._images[own] = image if plain else image.copy()
        elif not plain:
            np.copyto(self._images[own], image)
        picture = image if plain else self._images[own]
        kept = self._images[own] if plain and self._keep and not self._borrow else picture[:0]
        self._transform(picture, 0, kept, self._rows[slot])

    def _free_slot(self) -> int:
        """A slot without a frame: that of the oldest, which leaves, if there is no other."""
        if not self.full:
            return next(slot for slot in range(self.size) if slot not in self.order)
        slot = self.order.pop(0)
        self._anchor.release(slot)
        return slot

    @property
    def repeated(self) -> bool:
        """Whether the last two frames are equal in all their binned rows."""
        if len(self.order) < 2:
            return False
        return same_picture(*(self._rows[slot] for slot in self.order[-2:]))

    def _transform(self, image: Image, first_row: int, kept: Image, out: Plane) -> None:
        layout = self.layout
        binned_coefficients(
            image,
            self._top + first_row,
            self.bin_height,
            layout.levels,
            layout.place,
            self._sums,
            self._work,
            kept,
            out,
        )
        remove_level(out, layout.smooth, self._means)

    def following(self, displacement_px: float, drift_px: float = 0.0, reach: float = LAST_FREQUENCY) -> Products:
        """Products of windows that follow a wall moving by so much per frame along and across the rows.

        They are in the window's memory, and good until the next call.  ``reach`` is the highest frequency that is
        wanted [cycles/px].
        """
        order, anchor = self.order, self._anchor
        anchor.aim(order, displacement_px)
        times = centred_times(len(order))
        along = np.rint(displacement_px * times).astype(np.int64)
        down = np.rint(drift_px * np.ceil(times)).astype(np.int64)  # one of two keeps its place: halves round twice
        start, offset = np.array([anchor.start[slot] for slot in order]), anchor.offsets(order)
        if down.any():
            planes, slots, serial = self._moved_down(down), np.arange(len(order)), np.zeros(0, dtype=np.int64)
        else:
            planes, slots, serial = self._rows, np.array(order), np.array([anchor.serial[slot] for slot in order])
        hidden = self._occluders.hidden(planes, slots, along)
        self._cut = Cut(planes, slots, start, offset, anchor.length, hidden, serial)
        return self._cuts.products(self._cut, reach)

    def drift(self, displacement_px: float) -> Drift:
        """Motion across the rows of a wall that moves by so much per frame along them."""
        self._anchor.aim(self.order, displacement_px)
        return self._drift.measure(self._images, self.order, self._anchor)

    @property
    def cleared(self) -> NDArray[np.bool_]:
        """Strips (s,) whose windows, as they were cut last, leave an object out."""
        assert self._cut is not None
        return np.asarray(self._cut.hidden.any(axis=1))

    def halves(self, band: Band) -> tuple[Plane, Plane, Index]:
        """Pair products of both halves (2, 1, p, f) of the windows cut last, and where these start [px].

        Only the smooth rows of the first, the middle and the last frame take part.
        """
        assert self._cut is not None
        return self._cuts.halves(self._cut, band)

    def _moved_down(self, down: Index) -> Plane:
        """Binned rows (n, r, w) of frames whose rows start ``down`` pixels further down."""
        if not len(self._shifted):
            self._shifted = np.zeros_like(self._rows)
        for k, slot in enumerate(self.order):
            if down[k]:
                self._transform(self._images[slot], int(down[k]), self._images[slot][:0], self._shifted[k])
            else:
                self._shifted[k] = self._rows[slot]
        return self._shifted
