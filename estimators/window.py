"""The last N frames: binned rows, and the spectra and products of spectra of them, kept in rings of fixed size."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.coarse import CoarseSearch
from axialnav.estimators.drift import DriftBelief, DriftMeter
from axialnav.estimators.frames import Image
from axialnav.estimators.layout import BANDS, STRIPS, RowLayout, binned_coefficients, remove_level
from axialnav.estimators.occlusion import LEAST_SHARE, OccluderFinder, wall_window
from axialnav.estimators.products import Products
from axialnav.estimators.rows import apply_strip_windows, bin_height, padded_length, row_sums, tukey
from axialnav.estimators.spectrum import LAST_FREQUENCY, Band, add_power, all_pair_products, pair_count, row_spectra
from axialnav.estimators.stretch import Stretch, apply_half_windows, half_windows, outer_frames

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
    """

    def __init__(self, height: int, width: int, frames: int, dtype: np.dtype[np.unsignedinteger[Any]]) -> None:
        self.bin_height = bin_height(height, width)
        self.size = frames
        self.layout = RowLayout(height // self.bin_height)
        rows = self.layout.used
        self.images = np.zeros((frames, height, width), dtype=dtype)
        self._rows = np.zeros((frames, rows, width), dtype=np.float32)
        self._shifted = np.zeros((0, rows, width), dtype=np.float32)
        self._sums = row_sums(width, self.bin_height, dtype)
        self._work = np.zeros((1 << self.layout.levels, width), dtype=np.float32)
        self._means = np.zeros((BANDS, width), dtype=np.float32)
        self._buffers = _Buffers(self.layout, width, frames)
        self._occluders = OccluderFinder(width, self.layout.coarse)
        self.coarse = CoarseSearch(self.layout, width, frames)
        self.drift = DriftMeter(height, width, frames)
        self.drift_belief = DriftBelief()
        self.stretch = Stretch()
        self._cut: _Cut | None = None
        self.order: list[int] = []

    def clear(self) -> None:
        """Forget all frames."""
        self.order.clear()
        self.drift_belief.forget()
        self.stretch.forget()

    @property
    def full(self) -> bool:
        """Whether the ring holds as many frames as it can."""
        return len(self.order) == self.size

    def push(self, image: Image) -> None:
        """Take in one grey frame (h, w); the oldest leaves when the ring is full."""
        slot = self.order.pop(0) if self.full else self._free_slot()
        self.images[slot] = image
        self._transform(slot, 0, self._rows[slot])
        self.coarse.push(self._rows[slot], slot, self.order)
        self.order.append(slot)

    def _free_slot(self) -> int:
        return next(slot for slot in range(self.size) if slot not in self.order)

    def _transform(self, slot: int, first_row: int, out: Plane) -> None:
        layout = self.layout
        binned_coefficients(
            self.images[slot], first_row, self.bin_height, layout.levels, layout.place, self._sums, self._work, out
        )
        remove_level(out, layout.smooth, self._means)

    def following(self, displacement_px: float, drift_px: float = 0.0, reach: float = LAST_FREQUENCY) -> Products:
        """Products of windows that follow a wall moving by so much per frame along and across the rows.

        ``reach`` is the highest frequency that is wanted [cycles/px].
        """
        times = np.arange(len(self.order)) - 0.5 * (len(self.order) - 1)
        offset = np.rint(displacement_px * times).astype(np.int64)
        down = np.rint(drift_px * times).astype(np.int64)
        planes, order = self._rows, np.array(self.order, dtype=np.int64)
        if down.any():
            planes, order = self._moved_down(down), np.arange(len(order))
        hidden = self._occluders.hidden(planes, order, offset)
        self._cut = _Cut(planes, order, offset, hidden)
        return self._buffers.products(self._cut, reach)

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
        return self._buffers.halves(self._cut, band)

    def _moved_down(self, down: Index) -> Plane:
        """Binned rows (n, r, w) of frames whose rows start ``down`` pixels further down."""
        if not len(self._shifted):
            self._shifted = np.zeros_like(self._rows)
        for k, slot in enumerate(self.order):
            if down[k]:
                self._transform(slot, int(down[k]), self._shifted[k])
            else:
                self._shifted[k] = self._rows[slot]
        return self._shifted


@dataclass(frozen=True)
class _Cut:
    """What windows were cut from: binned frames (slots, r, w), slots in use, offsets (n,) [px] and hidden cells."""

    planes: Plane
    order: Index
    offset: Index
    hidden: NDArray[np.bool_]


class _Buffers:
    """Scratch for the transforms, as long as a frame is wide: windows are padded with zeros.

    One length for all displacements loses nothing of the overlap, and is fast.
    """

    def __init__(self, layout: RowLayout, width: int, frames: int) -> None:
        self._layout, self._width, self._band = layout, width, Band(padded_length(width))
        groups, count = len(layout.edges) - 1, self._band.count
        self._pairs = np.zeros(2 * groups * pair_count(frames) * count, dtype=np.float32)
        self._total = np.zeros(groups * count, dtype=np.float32)
        self._windowed, self._packed = np.zeros((2, layout.used, self._band.length), dtype=np.float32)
        self._spectra = np.zeros(2 * frames * layout.used * count, dtype=np.float32)

    def products(self, cut: _Cut, reach: float) -> Products:
        """Products of windows that start at the offsets and leave out what is hidden."""
        planes, order, offset, hidden = cut.planes, cut.order, cut.offset, cut.hidden
        layout, band, frames = self._layout, replace(self._band, reach=reach), len(order)
        starts = offset - offset.min()
        length = self._width - int(starts.max())
        windows, share = wall_window(hidden, starts, tukey(length))
        groups, pairs, count = len(layout.edges) - 1, pair_count(frames), band.count
        re, im = _part(self._spectra, (2, frames, layout.used, count))
        total, out = _part(self._total, (groups, count)), _part(self._pairs, (2, groups, pairs, count))
        total[:] = 0.0
        for k, slot in enumerate(order.tolist()):
            apply_strip_windows(planes[slot], int(starts[k]), layout.strip_edges, windows, self._windowed)
            row_spectra(self._windowed, band, self._packed, re[k], im[k])
            add_power(re[k], im[k], layout.edges, total)
        all_pair_products(re, im, layout.edges, out[0], out[1])
        shape = (STRIPS, layout.classes)
        return Products(
            out[0].reshape(*shape, pairs, -1),
            out[1].reshape(*shape, pairs, -1),
            total.reshape(*shape, -1),
            offset.astype(np.float64),
            band,
            length,
            np.asarray(layout.count * np.maximum(share, LEAST_SHARE)[:, None], dtype=np.float64),
            layout.height,
        )

    def halves(self, cut: _Cut, band: Band) -> tuple[Plane, Plane, Index]:
        """See :meth:`FrameWindow.halves`."""
        spans = self._layout.smooth
        starts = cut.offset - cut.offset.min()
        length = self._width - int(starts.max())
        windows, some = wall_window(cut.hidden, starts, tukey(length))[0], outer_frames(len(cut.order))
        many, pairs = 2 * int(np.sum(spans[:, 1] - spans[:, 0])), pair_count(len(some))
        windowed, packed, sides = self._windowed[:many], self._packed[:many], half_windows(length)
        re, im = _part(self._spectra, (2, len(some), many, band.count))
        for k, frame in enumerate(some.tolist()):
            apply_half_windows(cut.planes[cut.order[frame]], spans, int(starts[frame]), windows, sides, windowed)
            row_spectra(windowed, band, packed, re[k], im[k])
        out = np.empty((2, 2, pairs, band.count), dtype=np.float32)
        all_pair_products(re, im, np.array([0, many // 2, many]), out[0], out[1])
        return out[0][:, None], out[1][:, None], cut.offset[some]


def _part(scratch: Plane, shape: tuple[int, ...]) -> Plane:
    """The beginning of a flat buffer as an array of this shape."""
    return scratch[: math.prod(shape)].reshape(shape)
