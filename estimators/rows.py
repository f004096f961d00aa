"""Rows summed into bins, columns into transposed bins, and windows: the passes over all pixels.

Rows are summed before anything else, in integers, because it divides the work by the bin height and costs little: the
motion is along the rows.  Its level is taken off every column: it is where columns of the sensor, vignettes and upright
objects fixed to the camera live, and a wall that moves leaves almost nothing of itself there.  The level is the median
of the means of five bands: a plain mean would smear an object in one band over all rows.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
LEVEL_BANDS = 5
BUDGET = 270_000  # binned pixels per frame: what a millisecond or two of one core can chew


def bin_height(height: int, width: int) -> int:
    """Rows summed into one bin, so that a binned frame stays within the budget."""
    return max(1, math.ceil(height * width / BUDGET))


@kernel
def _median_level(sums: Plane, rows: int) -> Plane:
    """Median over the bands of the mean of every column; ``sums`` (5, w) over ``rows`` rows in all."""
    columns = sums.shape[1]
    level = np.empty(columns, dtype=np.float32)
    for b in range(LEVEL_BANDS):
        first = (b * rows + LEVEL_BANDS - 1) // LEVEL_BANDS
        end = ((b + 1) * rows + LEVEL_BANDS - 1) // LEVEL_BANDS
        for c in range(columns):
            sums[b, c] /= np.float32(end - first)
    for c in range(columns):
        a, b1, m, d, e = sums[0, c], sums[1, c], sums[2, c], sums[3, c], sums[4, c]
        low, high = max(min(a, b1), min(d, e)), min(max(a, b1), max(d, e))
        level[c] = max(min(low, high), min(m, max(low, high)))
    return level


@kernel
def bin_rows(frame: NDArray[np.uint8], first_row: int, height: int, out: Plane) -> None:
    """Sum ``height`` rows into each row of ``out`` (r, w), starting at ``first_row``; take off the columns' levels.

    Rows outside the frame repeat its first or last row.
    """
    rows, columns = out.shape
    last = frame.shape[0] - 1
    sums = np.empty(columns, dtype=np.uint32)
    means = np.zeros((LEVEL_BANDS, columns), dtype=np.float32)
    for r in range(rows):
        sums[:] = 0
        for k in range(height):
            row = min(max(first_row + r * height + k, 0), last)
            line = frame[row]
            for c in range(columns):
                sums[c] += np.uint32(line[c])
        mean = means[r * LEVEL_BANDS // rows]
        for c in range(columns):
            out[r, c] = np.float32(sums[c])
            mean[c] += out[r, c]
    level = _median_level(means, rows)
    for r in range(rows):
        for c in range(columns):
            out[r, c] -= level[c]


@kernel
def bin_columns(frame: NDArray[np.uint8], first_column: int, width: int, step: int, out: Plane) -> None:
    """Sum ``width`` columns, every ``step`` columns, into the rows of ``out`` (c, h): a transposed, binned frame.

    The caller sees to it that ``first_column + (c - 1) step + width`` columns exist.
    """
    count, height = out.shape
    sums = np.empty((height, count), dtype=np.uint32)
    mean = np.zeros(count)
    for r in range(height):
        line = frame[r]
        for c in range(count):
            total = np.uint32(0)
            start = first_column + c * step
            for k in range(start, start + width):
                total += np.uint32(line[k])
            sums[r, c] = total
            mean[c] += total
    for c in range(count):
        level = np.float32(mean[c] / height)
        for r in range(height):
            out[c, r] = np.float32(sums[r, c]) - level


@kernel
def apply_window(rows: Plane, start: int, window: Plane, out: Plane) -> None:
    """``out = rows[:, start : start + len(window)] * window``."""
    for r in range(rows.shape[0]):
        for c in range(window.shape[0]):
            out[r, c] = rows[r, start + c] * window[c]


@kernel
def apply_strip_windows(rows: Plane, start: int, edges: NDArray[np.int64], windows: Plane, out: Plane) -> None:
    """:func:`apply_window` with a window of its own for every strip: ``windows`` (s, length), ``edges`` (s + 1,)."""
    for s in range(windows.shape[0]):
        window = windows[s]
        for r in range(edges[s], edges[s + 1]):
            line, target = rows[r, start : start + window.shape[0]], out[r]
            for c in range(window.shape[0]):
                target[c] = line[c] * window[c]


def tukey(length: int, share: float = 0.12) -> Plane:
    """Window (length,) with cosine flanks over ``share`` of it."""
    flank = int(share * (length - 1) / 2)
    window = np.ones(length, dtype=np.float32)
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(flank + 1) / flank))
    window[: flank + 1] = rise
    window[-flank - 1 :] = rise[::-1]
    return window


def hann(length: int) -> Plane:
    """Hann window (length,)."""
    return np.hanning(length).astype(np.float32)


def fast_length(length: int) -> int:
    """Longest even length <= ``length`` with a fast Fourier transform."""
    length -= length % 2
    while cv2.getOptimalDFTSize(length) != length:
        length -= 2
    return length
