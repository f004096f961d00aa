"""Ring of windows that follow the wall: their spectra, and the products of every pair, made once for every frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.layout import STRIPS, RowLayout
from axialnav.estimators.occlusion import LEAST_SHARE, wall_window
from axialnav.estimators.products import Products, Sums
from axialnav.estimators.rows import apply_strip_windows, padded_length, tukey
from axialnav.estimators.spectrum import (
    Band,
    add_power,
    all_pair_products,
    fresh_products,
    in_order,
    pair_count,
    pair_frames,
    row_spectra,
    total_power,
)
from axialnav.estimators.stretch import apply_half_windows, half_windows, outer_frames

Plane = NDArray[np.float32]
Index = NDArray[np.int64]
HALVES_FRAMES = 3


@dataclass(frozen=True)
class Cut:
    """What windows are cut from.

    Parameters
    ----------
    planes
        Binned frames by slot, shape (slots, r, w).
    slots
        Those in use, oldest first, shape (n,).
    start
        First column of the window in each of them [px], shape (n,).
    offset
        The same, around zero, shape (n,).
    length
        Of the windows [px].
    hidden
        Cells that are left out of all windows, see :class:`~axialnav.estimators.occlusion.OccluderFinder`.
    serial
        Numbers that say which windows are still the same, shape (n,); empty: none.
    """

    planes: Plane
    slots: Index
    start: Index
    offset: Index
    length: int
    hidden: NDArray[np.bool_]
    serial: Index


class WallCuts:
    """Buffers of one size: transforms are as long as a frame is wide, windows are padded with zeros.

    One length for all displacements loses nothing of the overlap, and is fast.

    Parameters
    ----------
    layout
        Where the coefficients of a frame are.
    width
        Width of the frames [px].
    frames
        Length of the ring.
    """

    def __init__(self, layout: RowLayout, width: int, frames: int) -> None:
        self._layout, self._whole = layout, Band(padded_length(width))
        groups, count, pairs, used = len(layout.edges) - 1, self._whole.count, pair_count(frames), layout.used
        halves = 2 * int(np.sum(layout.smooth[:, 1] - layout.smooth[:, 0]))
        self._windowed, self._packed = np.zeros((2, max(used, halves), self._whole.length), dtype=np.float32)
        self._spectra = np.zeros(2 * frames * used * count, dtype=np.float32)
        self._halves = np.zeros(2 * HALVES_FRAMES * halves * count, dtype=np.float32)
        self._pairs = np.zeros(2 * groups * pairs * count, dtype=np.float32)
        self._totals = np.zeros(2 * layout.classes * pairs * count, dtype=np.float32)
        self._powers = np.zeros(frames * groups * count, dtype=np.float32)
        self._power = np.zeros((groups + layout.classes) * count, dtype=np.float32)
        self._sums = np.zeros_like(self._totals)
        self._number = np.zeros((frames, frames), dtype=np.int64)
        for p, (i, j) in enumerate(pair_frames(frames).tolist()):
            self._number[i, j] = self._number[j, i] = p
        self._serial = np.zeros(frames, dtype=np.int64)
        self._band, self._windows, self._share = self._whole, np.zeros((STRIPS, 0), dtype=np.float32), np.ones(STRIPS)

    def products(self, cut: Cut, reach: float) -> Products:
        """Products of windows; those of frames whose windows are the same as before are not made again."""
        slots = cut.slots
        lasting = len(cut.serial) > 0 and not cut.hidden.any()
        fresh = self._serial[slots] != cut.serial if lasting else np.ones(len(slots), dtype=np.bool_)
        if fresh.all() or reach > self._band.reach:
            fresh[:] = True
            self._band = replace(self._whole, reach=reach)
            self._windows, self._share = wall_window(cut.hidden, cut.start, tukey(cut.length))
        self._transform(cut, fresh)
        self._serial[slots] = cut.serial if lasting else 0
        return self._collected(cut)

    def halves(self, cut: Cut, band: Band) -> tuple[Plane, Plane, Index]:
        """Pair products of both halves (2, 1, p, f) of windows, and where these start [px].

        Only the smooth rows of the first, the middle and the last frame take part.
        """
        spans, some = self._layout.smooth, outer_frames(len(cut.slots))
        windows, sides = wall_window(cut.hidden, cut.start, tukey(cut.length))[0], half_windows(cut.length)
        many, pairs = 2 * int(np.sum(spans[:, 1] - spans[:, 0])), pair_count(len(some))
        windowed, packed = self._windowed[:many], self._packed[:many]
        re, im = _part(self._halves, (2, len(some), many, band.count))
        for k, frame in enumerate(some.tolist()):
            apply_half_windows(cut.planes[cut.slots[frame]], spans, int(cut.start[frame]), windows, sides, windowed)
            row_spectra(windowed, band, packed, re[k], im[k])
        out = np.empty((2, 2, pairs, band.count), dtype=np.float32)
        all_pair_products(re, im, np.array([0, many // 2, many]), out[0], out[1])
        return out[0][:, None], out[1][:, None], cut.offset[some]

    def _transform(self, cut: Cut, fresh: NDArray[np.bool_]) -> None:
        """Spectra and powers of the fresh frames, and the products of all pairs that they are in."""
        layout, band, slots = self._layout, self._band, cut.slots
        re, im, powers, pairs, totals = self._views()
        windowed, packed = self._windowed[: layout.used], self._packed[: layout.used]
        for k in np.flatnonzero(fresh).tolist():
            slot = int(slots[k])
            apply_strip_windows(cut.planes[slot], int(cut.start[k]), layout.strip_edges, self._windows, windowed)
            row_spectra(windowed, band, packed, re[slot], im[slot])
            powers[slot] = 0.0
            add_power(re[slot], im[slot], layout.edges, powers[slot])
        fresh_products(re, im, layout.edges, slots, fresh, self._number, pairs[0], pairs[1], totals[0], totals[1])

    def _views(self) -> tuple[Plane, Plane, Plane, Plane, Plane]:
        """Spectra (n, r, f) twice, powers (n, g, f), products (2, g, p, f) and their totals (2, c, p, f)."""
        frames, layout, count = len(self._serial), self._layout, self._band.count
        groups, many = len(layout.edges) - 1, pair_count(frames)
        re, im = _part(self._spectra, (2, frames, layout.used, count))
        powers = _part(self._powers, (frames, groups, count))
        pairs, totals = _part(self._pairs, (2, groups, many, count)), (2, layout.classes, many, count)
        return re, im, powers, pairs, _part(self._totals, totals)

    def _collected(self, cut: Cut) -> Products:
        layout, slots, count = self._layout, cut.slots, self._band.count
        classes, many, shape = layout.classes, pair_count(len(slots)), (STRIPS, layout.classes)
        _, _, powers, pairs, totals = self._views()
        i, j = pair_frames(len(slots)).T
        place = self._number[slots[i], slots[j]]
        power = _part(self._power, (len(layout.edges) - 1 + classes, count))
        total_power(powers, slots, power[:-classes], power[-classes:])
        sums = _part(self._sums, (2, classes, many, count))
        in_order(totals.reshape(2 * classes, -1, count), place, sums.reshape(2 * classes, -1, count))
        rows = np.asarray(layout.count * np.maximum(self._share, LEAST_SHARE)[:, None], dtype=np.float64)
        return Products(
            pairs[0].reshape(*shape, -1, count),
            pairs[1].reshape(*shape, -1, count),
            power[:-classes].reshape(*shape, count),
            cut.offset.astype(np.float64),
            self._band,
            cut.length,
            rows,
            layout.height,
            place,
            Sums(sums[0], sums[1], power[-classes:], rows.sum(axis=0)),
        )


def _part(scratch: Plane, shape: tuple[int, ...]) -> Plane:
    """The beginning of a flat buffer as an array of this shape."""
    return scratch[: math.prod(shape)].reshape(shape)
