"""From frames to mean power spectra of rows: the only pass over all pixels.

The composite is the sum of the frames, in integers, with rows summed into bins in the same pass; a mean rounded to
grey values would lose the faint texture.  Row spectra are averaged over strips of the picture, whose spread gives the
uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.rows import bin_height, fast_length, tukey
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
STRIPS = 12
FLANKS = 0.5  # wide enough for the steep spectra of walls, narrow enough to use most of the picture
WINDOW_LOOKS = 1.35  # numbers per independent number among the frequencies of such a window
FIRST_BIN = 4  # below: lamps and vignettes
LAST_FREQUENCY = 0.45  # cycles per pixel; above: aliasing


@dataclass(frozen=True)
class Spectra:
    """Mean power of windowed rows.

    Parameters
    ----------
    power
        Per strip and frequency, mean over the strip's rows, 1 for white noise of unit variance, shape (s, f).
    rows
        Rows per strip, shape (s,).
    frequency
        [cycles/px], shape (f,).
    length
        Window length [px].
    """

    power: Array
    rows: Array
    frequency: Array
    length: int

    @cached_property
    def mean(self) -> Array:
        """Mean over all rows, shape (f,)."""
        return np.asarray(self.rows @ self.power / self.rows.sum())


@kernel
def add_rows(frame: NDArray[np.uint8], height: int, sums: NDArray[np.uint32]) -> None:
    """Add ``height`` rows of ``frame`` to each row of ``sums`` (r, w), as many columns as there are."""
    rows, columns = sums.shape
    for r in range(rows):
        out = sums[r]
        for k in range(height):
            line = frame[r * height + k, :columns]
            for c in range(columns):
                out[c] += line[c]


@kernel
def level_and_window(sums: NDArray[np.uint32], window: Plane, out: Plane) -> None:
    """Take the mean of every column off and multiply by the window, ``out`` (r, l).

    A mean, not a median: what is not linear would fill the dark lines of the comb.
    """
    rows, columns = sums.shape
    level = np.zeros(columns, dtype=np.float32)
    for r in range(rows):
        line = sums[r]
        for c in range(columns):
            level[c] += np.float32(line[c])
    for c in range(columns):
        level[c] /= np.float32(rows)
    for r in range(rows):
        line, target = sums[r], out[r]
        for c in range(columns):
            target[c] = (np.float32(line[c]) - level[c]) * window[c]


@kernel
def strip_power(packed: Plane, edges: NDArray[np.int64], first: int, scale: float, out: Array) -> None:
    """Mean power of the packed row spectra (r, w) in every strip, ``out`` (s, f), times ``scale``."""
    for s in range(edges.shape[0] - 1):
        acc = out[s]
        acc[:] = 0.0
        for r in range(edges[s], edges[s + 1]):
            line = packed[r]
            for f in range(acc.shape[0]):
                re, im = line[2 * (first + f) - 1], line[2 * (first + f)]
                acc[f] += re * re + im * im
        acc *= scale / (edges[s + 1] - edges[s])


@lru_cache(maxsize=8)
def row_window(length: int) -> tuple[Plane, Array]:
    """Tukey window (length,) and its autocorrelation at lags 0, 1 ... (length,), 1 at lag 0."""
    window = tukey(length, FLANKS).astype(np.float64)
    spectrum = np.fft.rfft(window, 2 * length)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:length]
    return window.astype(np.float32), correlation / correlation[0]


def composite_rows(stack: list[Image]) -> NDArray[np.uint32]:
    """Sum of the frames (h, w) of one size with rows summed into bins, shape (r, l); l has a fast transform."""
    height, width = stack[0].shape
    bins = bin_height(height, width)
    sums = np.zeros((height // bins, fast_length(width)), dtype=np.uint32)
    for frame in stack:
        add_rows(frame, bins, sums)
    return sums


def spectra_of(sums: NDArray[np.uint32], variance_gain: float) -> Spectra:
    """Spectra of the rows of ``sums`` (r, w) less the columns' levels, divided by ``variance_gain``."""
    rows, length = sums.shape
    window = row_window(length)[0]
    windowed = np.empty(sums.shape, dtype=np.float32)
    level_and_window(sums, window, windowed)
    packed: Plane = cv2.dft(windowed, flags=cv2.DFT_ROWS)
    power = np.empty((min(STRIPS, rows), int(length * LAST_FREQUENCY) - FIRST_BIN))
    edges = np.linspace(0, rows, len(power) + 1).astype(np.int64)
    scale = 1.0 / (variance_gain * float(np.sum(window.astype(np.float64) ** 2)))
    strip_power(packed, edges, FIRST_BIN, scale, power)
    frequency = np.arange(FIRST_BIN, FIRST_BIN + power.shape[1]) / length
    return Spectra(power, np.diff(edges).astype(np.float64), frequency, length)
