"""The last N frames: binned rows, their spectra and the products of spectra, kept in rings of fixed size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.rows import apply_window, bin_height, bin_rows, fast_length, hann, tukey
from axialnav.estimators.spectrum import Band, pair_count, pair_products, power, row_spectra, strip_edges

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
STRIPS = 10


@dataclass(frozen=True)
class Products:
    """Everything the frames say about positions along the rows, for one choice of windows.

    Parameters
    ----------
    re, im
        Sums of ``Y_i conj(Y_j)`` over the rows of every strip, shape (s, pairs, f).
    power
        Sums of ``|Y|^2`` over rows and frames, shape (s, f).
    offset_px
        Where each frame's window starts, relative to the others [px], shape (n,).
    band
        Frequencies in use.
    rows
        Rows of every strip, shape (s,).
    """

    re: Plane
    im: Plane
    power: Array
    offset_px: Array
    band: Band
    rows: Array

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.offset_px)

    def grouped(self, groups: int) -> Products:
        """The same with neighbouring strips summed into ``groups``."""
        strips = self.re.shape[0]
        fold = (groups, strips // groups)
        return Products(
            self.re.reshape(*fold, *self.re.shape[1:]).sum(axis=1),
            self.im.reshape(*fold, *self.im.shape[1:]).sum(axis=1),
            self.power.reshape(*fold, -1).sum(axis=1),
            self.offset_px,
            self.band,
            self.rows.reshape(fold).sum(axis=1),
        )

    def selected(self, strips: NDArray[np.bool_]) -> Products:
        """The same with some strips only."""
        return Products(
            self.re[strips], self.im[strips], self.power[strips], self.offset_px, self.band, self.rows[strips]
        )


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
        self.bin_height = bin_height(height)
        self.size = frames
        self.band = Band(fast_length(width))
        self._start = (width - self.band.length) // 2
        self._hann = hann(self.band.length)
        rows, count = height // self.bin_height, self.band.count
        self.edges = strip_edges(rows, STRIPS)
        self.images = np.zeros((frames, height, width), dtype=dtype)
        self.rows = np.zeros((frames, rows, width), dtype=np.float32)
        self._windowed = np.zeros((rows, self.band.length), dtype=np.float32)
        self._packed = np.zeros_like(self._windowed)
        self._re = np.zeros((frames, rows, count), dtype=np.float32)
        self._im = np.zeros_like(self._re)
        self._power = np.zeros((frames, STRIPS, count), dtype=np.float32)
        self._pair_re = np.zeros((frames, frames, STRIPS, count), dtype=np.float32)
        self._pair_im = np.zeros_like(self._pair_re)
        self._scratch = _Scratch(rows, width, frames)
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
        slot = self.order.pop(0) if self.full else len(self.order)
        self.images[slot] = image
        bin_rows(self.images[slot], 0, self.bin_height, self.rows[slot])
        apply_window(self.rows[slot], self._start, self._hann, self._windowed)
        row_spectra(self._windowed, self.band, self._packed, self._re[slot], self._im[slot])
        power(self._re[slot], self._im[slot], self.edges, self._power[slot])
        for older in self.order:
            pair_products(
                self._re[older], self._im[older], self._re[slot], self._im[slot],
                self.edges, self._pair_re[older, slot], self._pair_im[older, slot],
            )  # fmt: skip
        self.order.append(slot)

    def fixed(self) -> Products:
        """Products of windows that stay where they are."""
        frames, count = len(self.order), self.band.count
        re = np.empty((STRIPS, pair_count(frames), count), dtype=np.float32)
        im = np.empty_like(re)
        pairs = [(a, b) for k, a in enumerate(self.order) for b in self.order[k + 1 :]]
        for p, (a, b) in enumerate(pairs):
            re[:, p], im[:, p] = self._pair_re[a, b], self._pair_im[a, b]
        total = self._power[self.order].sum(axis=0, dtype=np.float64)
        return Products(re, im, total, np.zeros(frames), self.band, np.diff(self.edges).astype(np.float64))

    def following(self, displacement_px: float, drift_px: float = 0.0) -> Products:
        """Products of windows that follow a wall moving by so much per frame along and across the rows."""
        frames = len(self.order)
        times = np.arange(frames) - 0.5 * (frames - 1)
        offset = np.rint(displacement_px * times).astype(np.int64)
        down = np.rint(drift_px * times).astype(np.int64)
        planes = [self._rows_from(slot, int(shift)) for slot, shift in zip(self.order, down, strict=True)]
        return self._scratch.products(planes, offset, self.edges)

    def _rows_from(self, slot: int, first_row: int) -> Plane:
        if first_row == 0:
            return np.asarray(self.rows[slot])
        plane = self._scratch.shifted(slot)
        bin_rows(self.images[slot], first_row, self.bin_height, plane)
        return plane


class _Scratch:
    """Buffers of the windows that follow the wall, as wide as a frame; narrower windows use a part of them."""

    def __init__(self, rows: int, width: int, frames: int) -> None:
        self._windowed = np.zeros(rows * width, dtype=np.float32)
        self._packed = np.zeros(rows * width, dtype=np.float32)
        self._spectra = np.zeros((2, frames, rows * width // 2), dtype=np.float32)
        self._rows = np.zeros((frames, rows, width), dtype=np.float32)
        self._shape = (rows, width)
        self._tukey: dict[int, Plane] = {}

    def shifted(self, slot: int) -> Plane:
        """Buffer (r, w) for the rows of a frame binned from another first row."""
        return np.asarray(self._rows[slot])

    def products(self, planes: list[Plane], offset: NDArray[np.int64], edges: NDArray[np.int64]) -> Products:
        """Products of windows of ``planes`` that start at ``offset``."""
        rows, width = self._shape
        frames, span = len(planes), int(offset.max() - offset.min())
        band = Band(fast_length(width - span))
        spare = (width - span - band.length) // 2
        windowed = self._windowed[: rows * band.length].reshape(rows, band.length)
        packed = self._packed[: rows * band.length].reshape(rows, band.length)
        re, im = self._spectra[:, :, : rows * band.count].reshape(2, -1, rows, band.count)
        total = np.zeros((len(edges) - 1, band.count))
        squares = np.empty((len(edges) - 1, band.count), dtype=np.float32)
        for k, plane in enumerate(planes):
            apply_window(plane, int(offset[k] - offset.min()) + spare, self._window(band.length), windowed)
            row_spectra(windowed, band, packed, re[k], im[k])
            power(re[k], im[k], edges, squares)
            total += squares
        out = np.empty((2, len(edges) - 1, pair_count(frames), band.count), dtype=np.float32)
        p, part = 0, np.empty((2, len(edges) - 1, band.count), dtype=np.float32)
        for i in range(frames):
            for j in range(i + 1, frames):
                pair_products(re[i], im[i], re[j], im[j], edges, part[0], part[1])
                out[:, :, p] = part
                p += 1
        return Products(out[0], out[1], total, offset.astype(np.float64), band, np.diff(edges).astype(np.float64))

    def _window(self, length: int) -> Plane:
        if length not in self._tukey:
            self._tukey[length] = tukey(length)
        return self._tukey[length]
