"""The last N frames: binned rows, their spectra and the products of spectra, kept in rings of fixed size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.drift import DriftMeter
from axialnav.estimators.frames import Image
from axialnav.estimators.layout import STRIPS, RowLayout, haar_rows
from axialnav.estimators.occlusion import LEAST_SHARE, OccluderFinder, wall_window
from axialnav.estimators.products import Products
from axialnav.estimators.rows import apply_strip_windows, apply_window, bin_height, bin_rows, fast_length, hann, tukey
from axialnav.estimators.spectrum import Band, all_pair_products, pair_count, pair_products, power, row_spectra

Plane = NDArray[np.float32]


class FrameWindow:
    """A ring of the last ``frames`` frames with spectra and products of all pairs; nothing grows once it is full.

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
        self.band = Band(fast_length(width))
        self._start = (width - self.band.length) // 2
        self._hann = hann(self.band.length)
        rows, count, groups = self.layout.used, self.band.count, STRIPS * self.layout.classes
        self.images = np.zeros((frames, height, width), dtype=dtype)
        self._rows = np.zeros((frames, rows, width), dtype=np.float32)
        self._binned = np.zeros((rows, width), dtype=np.float32)
        self._work = np.zeros((1 << self.layout.levels, width), dtype=np.float32)
        self._buffers = _Buffers(rows, width, frames, groups)
        self._re = np.zeros((frames, rows, count), dtype=np.float32)
        self._im = np.zeros_like(self._re)
        self._power = np.zeros((frames, groups, count), dtype=np.float32)
        self._pair_re = np.zeros((frames, frames, groups, count), dtype=np.float32)
        self._pair_im = np.zeros_like(self._pair_re)
        self._occluders = OccluderFinder(rows, width, self.layout.strip_edges)
        self.drift = DriftMeter(height, width, frames)
        self.order: list[int] = []

    def clear(self) -> None:
        """Forget all frames."""
        self.order.clear()

    @property
    def full(self) -> bool:
        """Whether the ring holds as many frames as it can."""
        return len(self.order) == self.size

    def push(self, image: Image) -> None:
        """Take in one grey frame (h, w); the oldest leaves when the ring is full."""
        slot = self.order.pop(0) if self.full else self._free_slot()
        self.images[slot] = image
        self._transform(slot, 0, self._rows[slot])
        edges = self.layout.edges
        self._buffers.spectra(self._rows[slot], self._start, self._hann, self.band, self._re[slot], self._im[slot])
        power(self._re[slot], self._im[slot], edges, self._power[slot])
        for older in self.order:
            pair_products(
                self._re[older], self._im[older], self._re[slot], self._im[slot],
                edges, self._pair_re[older, slot], self._pair_im[older, slot],
            )  # fmt: skip
        self.order.append(slot)

    def _free_slot(self) -> int:
        return next(slot for slot in range(self.size) if slot not in self.order)

    def _transform(self, slot: int, first_row: int, out: Plane) -> None:
        bin_rows(self.images[slot], first_row, self.bin_height, self._binned)
        haar_rows(self._binned, self.layout.levels, self.layout.place, self._work, out)

    def fixed(self) -> Products:
        """Products of windows that stay where they are."""
        frames, count = len(self.order), self.band.count
        shape = (STRIPS, self.layout.classes)
        re = np.empty((*shape, pair_count(frames), count), dtype=np.float32)
        im = np.empty_like(re)
        pairs = [(a, b) for k, a in enumerate(self.order) for b in self.order[k + 1 :]]
        for p, (a, b) in enumerate(pairs):
            re[:, :, p] = self._pair_re[a, b].reshape(*shape, count)
            im[:, :, p] = self._pair_im[a, b].reshape(*shape, count)
        total = self._power[self.order].sum(axis=0).reshape(*shape, count)
        return Products(
            re, im, total, np.zeros(frames), self.band, self.layout.count.astype(np.float64), self.layout.height
        )

    def following(self, displacement_px: float, drift_px: float = 0.0) -> Products:
        """Products of windows that follow a wall moving by so much per frame along and across the rows."""
        times = np.arange(len(self.order)) - 0.5 * (len(self.order) - 1)
        offset = np.rint(displacement_px * times).astype(np.int64)
        down = np.rint(drift_px * times).astype(np.int64)
        planes = []
        for slot, shift in zip(self.order, down, strict=True):
            plane = self._rows[slot]
            if shift:
                plane = self._buffers.rows[slot]
                self._transform(slot, int(shift), plane)
            planes.append(plane)
        hidden = self._occluders.hidden(planes, offset)
        return self._buffers.products(planes, offset, self.layout, hidden)


class _Buffers:
    """Scratch as wide as a frame; narrower windows use a part of it."""

    def __init__(self, rows: int, width: int, frames: int, groups: int) -> None:
        self._pairs = np.zeros(groups * pair_count(frames) * width, dtype=np.float32)
        self.rows = np.zeros((frames, rows, width), dtype=np.float32)
        self._windowed = np.zeros(rows * width, dtype=np.float32)
        self._packed = np.zeros(rows * width, dtype=np.float32)
        self._spectra = np.zeros((2, frames * rows * width // 2), dtype=np.float32)
        self._shape = (rows, width)
        self._tukey: dict[int, Plane] = {}

    def spectra(self, plane: Plane, start: int, window: Plane, band: Band, re: Plane, im: Plane) -> None:
        """Windowed row spectra of ``plane`` into ``re`` and ``im`` (r, f)."""
        windowed, packed = self._planes(band.length)
        apply_window(plane, start, window, windowed)
        row_spectra(windowed, band, packed, re, im)

    def _planes(self, length: int) -> tuple[Plane, Plane]:
        shape = (self._shape[0], length)
        size = shape[0] * length
        return self._windowed[:size].reshape(shape), self._packed[:size].reshape(shape)

    def products(
        self, planes: list[Plane], offset: NDArray[np.int64], layout: RowLayout, hidden: NDArray[np.bool_]
    ) -> Products:
        """Products of windows of ``planes`` that start at ``offset`` and leave out ``hidden`` cells (s, b)."""
        rows, width = self._shape
        frames = len(planes)
        band = Band(fast_length(width - int(np.ptp(offset))))
        starts = offset - offset.min() + (width - int(np.ptp(offset)) - band.length) // 2
        windows, share = wall_window(hidden, starts, self._window(band.length))
        re, im = (flat[: frames * rows * band.count].reshape(frames, rows, -1) for flat in self._spectra)
        groups, pairs = len(layout.edges) - 1, pair_count(frames)
        total = np.zeros((groups, band.count), dtype=np.float32)
        part = np.empty((groups, band.count), dtype=np.float32)
        windowed, packed = self._planes(band.length)
        for k, plane in enumerate(planes):
            apply_strip_windows(plane, int(starts[k]), layout.strip_edges, windows, windowed)
            row_spectra(windowed, band, packed, re[k], im[k])
            power(re[k], im[k], layout.edges, part)
            total += part
        out = self._pairs[: 2 * groups * pairs * band.count].reshape(2, groups, pairs, band.count)
        all_pair_products(re, im, layout.edges, out[0], out[1])
        shape = (STRIPS, layout.classes)
        return Products(
            out[0].reshape(*shape, pairs, -1),
            out[1].reshape(*shape, pairs, -1),
            total.reshape(*shape, -1),
            offset.astype(np.float64),
            band,
            np.asarray(layout.count * np.maximum(share, LEAST_SHARE)[:, None], dtype=np.float64),
            layout.height,
        )

    def _window(self, length: int) -> Plane:
        if length not in self._tukey:
            self._tukey[length] = tukey(length)
        return self._tukey[length]
