"""Objects fixed to the camera: found where the picture repeats without moving, and kept out of the windows.

In every cell (a strip of rows by a few columns) the frames are summed twice: as they are, and shifted so that the wall
stands still.  The wall is strong in the second sum, an object in the first.  What is hidden in any frame is left out of
the windows of all frames, so that they still show one and the same piece of wall.

An object does not end where its edge runs along the motion, or where one cell more falls short of the limit: both sums
are alike there, and what is left of it would hold the displacement back.  So cells that may belong to it are hidden,
too, if they hang together with one that surely does (hysteresis as in Canny, IEEE Trans. Pattern Anal. Mach. Intell.
8(6), 1986).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
CELL_PX = 16
FLANK_PX = 12
SURE, PERHAPS = 5.0, 2.0
OUTSTANDING = 3.0  # times the power of the usual cell: more than walls are uneven
STILL_SHARE = 0.8  # of the power of frames that are all alike there, and of the shifted sum
ENOUGH_FRAMES = 3  # for detail, and for objects to grow: two look alike too easily
LARGEST_SHARE = 0.3  # of the picture that objects may seem to hide: beyond, only those cells that surely do
LEAST_TRAVEL_PX = 1
LEAST_SHARE = 0.3


@kernel
def _cell_powers(
    planes: Plane, order: Index, shift: Index, spans: Index, wanted: Mask, sums: Plane, out: Array
) -> None:
    """Power in every cell (s, b) of the sum of the shifted frames over the root of their number: all of it, and detail.

    Noise keeps its power in it.  Detail is what is left beside the mean of every row in the cell.

    Parameters
    ----------
    planes
        Binned frames by slot, shape (n, r, w).
    order
        Slots in use.
    shift
        Shift of each frame [px], around zero.
    spans
        First row of every strip and one past its last, shape (s, 2).
    wanted
        Strips to look at, shape (s,).
    sums
        Scratch, shape (5, w).
    out
        Result, shape (2, s, b).
    """
    width = planes.shape[2]
    cells = out.shape[2]
    total, column, seen, level, looks = sums[0], sums[1], sums[2], sums[3, :cells], sums[4, :cells]
    seen[:] = np.float32(0.0)
    for k in range(order.shape[0]):
        seen[max(0, -shift[k]) : min(width, width - shift[k])] += np.float32(1.0)
    np.maximum(seen, np.float32(1.0), seen)
    for b in range(cells):
        looks[b] = _sum_cell(seen[b * CELL_PX : (b + 1) * CELL_PX])
    seen[:] = np.float32(1.0) / seen
    for s in range(spans.shape[0]):
        if not wanted[s]:
            continue
        column[:] = np.float32(0.0)
        level[:] = np.float32(0.0)
        for r in range(spans[s, 0], spans[s, 1]):
            total[:] = np.float32(0.0)
            k = 0
            while k < order.shape[0]:
                low, high = max(0, -shift[k]), min(width, width - shift[k])
                line = planes[order[k], r, low + shift[k] : high + shift[k]]
                if k + 1 < order.shape[0] and shift[k + 1] == shift[k]:
                    _add_both(line, planes[order[k + 1], r, low + shift[k] : high + shift[k]], total[low:high])
                    k += 1
                else:
                    _add(line, total[low:high])
                k += 1
            _add_square(total, column)
            _add_level(total, level)
        _multiply(seen, column)
        for b in range(cells):
            power = _sum_cell(column[b * CELL_PX : (b + 1) * CELL_PX])
            out[0, s, b] = power
            out[1, s, b] = power - level[b] / looks[b]


@kernel
def _multiply(factor: Plane, line: Plane) -> None:
    for c in range(line.shape[0]):
        line[c] *= factor[c]


@kernel
def _add(line: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] += line[c]


@kernel
def _add_both(line: Plane, other: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] += line[c] + other[c]


@kernel
def _add_square(line: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] += line[c] * line[c]


@kernel
def _add_level(line: Plane, level: Plane) -> None:
    """Add the square of the sum over every 16 columns of ``line`` (w,) to ``level`` (w // 16,)."""
    for b in range(level.shape[0]):
        total = _sum_cell(line[b * CELL_PX : (b + 1) * CELL_PX])
        level[b] += total * total


@kernel
def _sum_cell(t: Plane) -> np.float32:
    """Sum of ``t`` (16,), halves upon halves: a few vector instructions."""
    left = ((t[0] + t[8]) + (t[4] + t[12])) + ((t[2] + t[10]) + (t[6] + t[14]))
    right = ((t[1] + t[9]) + (t[5] + t[13])) + ((t[3] + t[11]) + (t[7] + t[15]))
    return np.float32(left + right)


class OccluderFinder:
    """Buffers for binned frames of one size.

    Parameters
    ----------
    width
        Width of the binned frames.
    spans
        Rows of every strip that are looked at: the first and one past the last, shape (s, 2).
    """

    def __init__(self, width: int, spans: Index) -> None:
        self._spans, self._all = spans, np.ones(len(spans), dtype=np.bool_)
        self._sums = np.zeros((5, width), dtype=np.float32)
        self._cells = np.zeros((3, 2, len(spans), width // CELL_PX))
        self._samples = np.diff(spans, axis=1) * float(CELL_PX)

    def hidden(self, planes: Plane, order: Index, offset: Index) -> Mask:
        """Cells (s, b) in which something stands still before a wall that moves by ``offset`` [px] per frame (n,).

        ``planes`` (slots, r, w) are binned frames, ``order`` (n,) the slots in use, oldest first.
        """
        one, still, moving = self._cells
        if int(offset.max() - offset.min()) < LEAST_TRAVEL_PX:
            return np.zeros(still.shape[1:], dtype=np.bool_)
        self._powers(planes, order[:1], 0 * order[:1], self._all, one)
        self._powers(planes, order, 0 * order, self._all, still)
        part = 1 if len(order) >= ENOUGH_FRAMES else 0
        usual = _middle(one[part] / self._samples) * self._samples
        noise = usual * np.sqrt(2.0 / self._samples)
        repeats: Mask = np.asarray(still[part] - usual > SURE * noise)
        doubtful: Mask = np.any(repeats, axis=1)
        if not doubtful.any():
            return repeats
        shift = offset - (offset.min() + offset.max()) // 2
        moving[:] = 0.0
        self._powers(planes, order, shift, doubtful, moving)
        surely: Mask = np.asarray(repeats & (still[part] - moving[part] > SURE * noise))
        if len(order) < ENOUGH_FRAMES or not surely.any():
            return surely
        self._powers(planes, order, shift, ~doubtful, moving)
        fine = len(order) * (one[1] - usual - PERHAPS * noise)
        perhaps = (still[1] - moving[1] > PERHAPS * noise) & (still[1] - usual > np.maximum(PERHAPS * noise, fine))
        own, alike = np.maximum(one[0] - usual, 0.0), still[0] - usual
        strong = own > (OUTSTANDING - 1.0) * usual
        strong &= alike > STILL_SHARE * np.maximum(len(order) * own, moving[0] - usual)
        grown = connected(surely | perhaps | strong, surely)
        return grown if grown.mean() < LARGEST_SHARE else surely

    def _powers(self, planes: Plane, order: Index, shift: Index, wanted: Mask, out: Array) -> None:
        _cell_powers(planes, order, shift, self._spans, wanted, self._sums, out)


def _middle(values: Array) -> float:
    """The number in the middle of the sorted ``values``, without the overhead of numpy's median."""
    return float(np.partition(values, values.size // 2, axis=None)[values.size // 2])


def connected(cells: Mask, seeds: Mask) -> Mask:
    """Those of the cells (s, b) that hang together with one of the seeds, over edges or corners; seeds are cells."""
    many, label = cv2.connectedComponents(cells.astype(np.uint8), connectivity=8)
    kept = np.zeros(many, dtype=np.bool_)
    kept[label[seeds]] = True
    return np.asarray(kept[label])


def wall_window(hidden: Mask, starts: Index, window: Plane) -> tuple[Plane, Array]:
    """Windows of all strips without what is hidden in any frame, and the share of power they keep.

    Parameters
    ----------
    hidden
        Cells (s, b).
    starts
        First column of the window in every frame, shape (n,).
    window
        Window without gaps, shape (length,).

    Returns
    -------
    windows
        Shape (s, length).
    share
        Shape (s,).
    """
    if not hidden.any():
        return np.repeat(window[None], len(hidden), axis=0), np.ones(len(hidden))
    columns = np.repeat(hidden, CELL_PX, axis=1)
    length, strips = len(window), len(hidden)
    blocked = np.zeros((strips, length), dtype=np.bool_)
    for start in starts.tolist():
        seen = columns[:, start : start + length]
        blocked[:, : seen.shape[1]] |= seen
    free = cv2.erode((~blocked).astype(np.float32), np.ones((1, 2 * FLANK_PX + 1), dtype=np.uint8))
    soft = cv2.blur(free, (2 * FLANK_PX + 1, 1))
    windows = np.asarray(soft * window[None], dtype=np.float32)
    share = np.sum(windows.astype(np.float64) ** 2, axis=1) / float(np.sum(window.astype(np.float64) ** 2))
    return windows, share
