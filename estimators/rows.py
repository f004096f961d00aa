"""Rows summed into bins, columns into transposed bins, and windows: the passes over all pixels.

Rows are summed before anything else, in integers, because it divides the work by the bin height and costs little: the
motion is along the rows.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
Index = NDArray[np.int64]
BUDGET = 270_000  # binned pixels per frame, at most
PLENTY, LEAST_BINS = 326_000, 64  # pixels from which bins grow faster than pictures; rows that must be left
SUMMED_COLUMNS = 8


def bin_height(height: int, width: int) -> int:
    """Rows summed into one bin.

    Small pictures need every pixel.  Large ones have pixels to spare: their bins grow faster than the pictures do, so
    that a larger picture takes less time, not more, and still gives the smaller sigma.
    """
    pixels = float(height * width)
    return max(math.ceil(pixels / BUDGET), min(round(math.pow(pixels / PLENTY, 1.5)), height // LEAST_BINS))


def row_sums(width: int, height: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Scratch (w,) for the sum of ``height`` rows of pixels of this type: as narrow as the sum allows, for speed."""
    narrow = dtype.itemsize == 1 and height <= 256
    return np.zeros(width, dtype=np.uint16 if narrow else np.uint32)


@kernel
def _add_row(line: NDArray[np.uint8], sums: NDArray[np.uint32]) -> None:
    for c in range(sums.shape[0]):
        sums[c] += line[c]


@kernel
def sum_rows(frame: NDArray[np.uint8], top: int, height: int, sums: NDArray[np.uint32], out: Plane) -> None:
    """Sum ``height`` rows of ``frame`` from row ``top`` on into ``out`` (w,), with ``sums`` (w,) as scratch.

    Rows outside the frame repeat its first or last row.
    """
    last = frame.shape[0] - 1
    sums[:] = 0
    for k in range(height):
        _add_row(frame[min(max(top + k, 0), last)], sums)
    for c in range(out.shape[0]):
        out[c] = np.float32(sums[c])


@kernel
def bin_columns(frame: NDArray[np.uint8], first_column: int, step: int, stride: int, out: Plane) -> None:
    """Sum 8 columns, every ``step`` columns, into the rows of ``out`` (c, h), less their mean: a transposed frame.

    Only every row number ``stride`` is read.  The caller sees to it that ``first_column + (c - 1) step + 8`` columns
    and ``h stride`` rows exist.
    """
    count, height = out.shape
    mean = np.zeros(count)
    for r in range(height):
        line = frame[r * stride]
        for c in range(count):
            at = line[first_column + c * step : first_column + c * step + SUMMED_COLUMNS]
            total = np.float32(
                np.uint32(at[0]) + at[1] + at[2] + at[3] + at[4] + at[5] + at[6] + at[7]  # unrolled: four times as fast
            )
            out[c, r] = total
            mean[c] += total
    for c in range(count):
        level = np.float32(mean[c] / height)
        for r in range(height):
            out[c, r] -= level


@kernel
def apply_window(rows: Plane, which: Index, start: int, window: Plane, out: Plane) -> None:
    """``out = rows[which, start : start + len(window)] * window``."""
    for r in range(which.shape[0]):
        _multiply(rows[which[r], start : start + window.shape[0]], window, out[r])


@kernel
def apply_strip_windows(rows: Plane, start: int, edges: Index, windows: Plane, out: Plane) -> None:
    """Windows of their own for every strip of rows, then zeros: ``windows`` (s, length), ``edges`` (s + 1,)."""
    length = windows.shape[1]
    for s in range(windows.shape[0]):
        for r in range(edges[s], edges[s + 1]):
            _multiply(rows[r, start : start + length], windows[s], out[r])
            out[r, length:] = np.float32(0.0)


@kernel
def _multiply(line: Plane, window: Plane, out: Plane) -> None:
    for c in range(window.shape[0]):
        out[c] = line[c] * window[c]


@lru_cache(maxsize=64)
def tukey(length: int, share: float = 0.1) -> Plane:
    """Window (length,) with cosine flanks over ``share`` of it, shared: not to be written to."""
    flank = int(share * (length - 1) / 2)
    window = np.ones(length, dtype=np.float32)
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(flank + 1) / flank))
    window[: flank + 1] = rise
    window[-flank - 1 :] = rise[::-1]
    return window


@lru_cache(maxsize=64)
def hann(length: int) -> Plane:
    """Hann window (length,), shared: not to be written to."""
    return np.hanning(length).astype(np.float32)


def fast_length(length: int) -> int:
    """Longest even length <= ``length`` with a fast Fourier transform."""
    length -= length % 2
    while cv2.getOptimalDFTSize(length) != length:
        length -= 2
    return length


def padded_length(length: int) -> int:
    """Shortest even length >= ``length`` with a fast Fourier transform."""
    length += length % 2
    while cv2.getOptimalDFTSize(length) != length:
        length += 2
    return length
