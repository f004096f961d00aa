"""From frames to the power of their composite beside their own: the only pass over all pixels.

Rows are summed into bins, the level of every column is taken off, and every frame is transformed by itself; transforms
being linear, their sum is that of the composite.  A composite rounded to grey values would lose the faint texture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.rows import bin_height, fast_length, row_sums
from axialnav.estimators.spectral.blocks import EVERY, block_notches, blocky
from axialnav.estimators.spectral.picture import FIRST_BIN, LAST_FREQUENCY, STRIPS, level_and_window, row_window
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Mask = NDArray[np.bool_]
GROUP = 8  # frequencies: what one strip says about fewer is noise
ODD, MAX_LOST = 6.0, 0.34  # times the usual disagreement; share of the strips
EDGE, FLAT = 0.01, 0.01  # windows do not see quite the same wall; nor is a comb's dark line quite dark


@dataclass(frozen=True)
class Copies:
    """Power of the rows of a composite beside that of its frames, 1 for white noise of unit variance.

    Parameters
    ----------
    together
        Of the sum of the frames over N: per strip and frequency, mean over the strip's rows, shape (s, f).
    apart
        Mean over the frames of their own power, shape (s, f).
    rows
        Rows per strip, shape (s,).
    frequency
        [cycles/px], shape (f,).
    packed
        Transforms of the rows of all frames as OpenCV packs them, shape (N, r, l).
    variance_gain
        Pixels in one sample.
    """

    together: Array
    apart: Array
    rows: Array
    frequency: Array
    packed: Plane
    variance_gain: float

    @property
    def frames(self) -> int:
        """N."""
        return len(self.packed)

    @property
    def length(self) -> int:
        """Length of the window [px]."""
        return int(self.packed.shape[2])

    @cached_property
    def means(self) -> tuple[Array, Array]:
        """``together`` and ``apart`` as means over all rows, (f,) each."""
        total = float(self.rows.sum())
        return np.asarray(self.rows @ self.together / total), np.asarray(self.rows @ self.apart / total)


@kernel
def sum_into_bins(frame: Image, bins: int, sums: NDArray[np.uint32]) -> None:
    """Sum ``bins`` rows of ``frame`` (h, w) into every row of ``sums`` (r, l), as many columns as there are."""
    rows, columns = sums.shape
    for r in range(rows):
        out = sums[r]
        for c in range(columns):
            out[c] = 0
        for k in range(bins):
            line = frame[r * bins + k]
            for c in range(columns):
                out[c] += line[c]


@kernel
def copy_powers(
    packed: Plane, edges: NDArray[np.int64], first: int, scale: float, together: Array, apart: Array
) -> None:
    """Mean power over every strip's rows of the sum of the frames and of the frames, (s, f) each."""
    frames, count = packed.shape[0], 2 * together.shape[1]
    total = np.empty(count, dtype=np.float32)
    of_sum, of_each = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    for s in range(edges.shape[0] - 1):
        of_sum[:] = np.float32(0.0)
        of_each[:] = np.float32(0.0)
        for r in range(edges[s], edges[s + 1]):
            total[:] = np.float32(0.0)
            for k in range(frames):
                line = packed[k, r, 2 * first - 1 : 2 * first - 1 + count]
                for c in range(count):
                    total[c] += line[c]
                    of_each[c] += line[c] * line[c]
            for c in range(count):
                of_sum[c] += total[c] * total[c]
        share = scale / (edges[s + 1] - edges[s]) / frames
        for f in range(together.shape[1]):
            together[s, f] = share * (of_sum[2 * f] + of_sum[2 * f + 1])
            apart[s, f] = share * (of_each[2 * f] + of_each[2 * f + 1])


def transformed(stack: list[Image], kept: Mask | None = None) -> tuple[Plane, Plane]:
    """Transforms of the rows of all frames (N, r, l), and the sum of the frames in every fourth row (r / 4, l).

    Rows are bins of the frames' rows; with ``kept`` (r,) only those take part, also in the levels of the columns.  One
    frame is finished before the next is touched, while it is in the processor's memory.
    """
    height, width = stack[0].shape
    bins, length = bin_height(height, width), fast_length(width)
    window, rows = row_window(length)[0], height // bins
    sums = np.empty((rows, length), dtype=row_sums(1, bins, stack[0].dtype).dtype)
    packed = np.empty((len(stack), rows if kept is None else int(kept.sum()), length), dtype=np.float32)
    thin = np.zeros((len(sums[::EVERY]), length), dtype=np.float32)
    for frame, rows_of in zip(stack, packed, strict=True):
        sum_into_bins(frame, bins, sums)
        thin += sums[::EVERY]
        level_and_window(sums if kept is None else sums[kept], window, rows_of)
        cv2.dft(rows_of, dst=rows_of, flags=cv2.DFT_ROWS)
    return packed, thin


def copies_of(packed: Plane, variance_gain: float) -> Copies:
    """Spectra of a composite from the transforms of its frames; one sample's noise has ``variance_gain``."""
    _, rows, length = packed.shape
    edges = np.linspace(0, rows, min(STRIPS, rows) + 1).astype(np.int64)
    shape = (len(edges) - 1, int(length * LAST_FREQUENCY) - FIRST_BIN)
    together, apart = np.empty(shape), np.empty(shape)
    scale = 1.0 / (variance_gain * float(np.sum(row_window(length)[0].astype(np.float64) ** 2)))
    copy_powers(packed, edges, FIRST_BIN, scale, together, apart)
    frequency = np.arange(FIRST_BIN, FIRST_BIN + shape[1]) / length
    return Copies(together, apart, np.diff(edges).astype(np.float64), frequency, packed, variance_gain)


@kernel
def median_of(values: Array) -> float:
    """Median of a few numbers (s,), which are sorted in place."""
    for i in range(1, values.shape[0]):
        value, at = values[i], i
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value
    return 0.5 * float(values[(len(values) - 1) // 2] + values[len(values) // 2])


@kernel
def strangeness(together: Array, apart: Array, frames: int, out: Array) -> None:
    """Mean squared deviation per row of every strip's comb from the median comb, in units of noise, ``out`` (s,)."""
    strips, groups = together.shape[0], together.shape[1] // GROUP
    share, level = np.empty((groups, strips)), np.empty(strips)
    usual, loud = np.empty(groups), np.empty(groups)
    for g in range(groups):
        for s in range(strips):
            level[s] = np.sum(apart[s, g * GROUP : (g + 1) * GROUP])
            share[g, s] = np.sum(together[s, g * GROUP : (g + 1) * GROUP]) / (frames * level[s])
        loud[g] = median_of(level)
        usual[g] = median_of(share[g].copy())
    faint = np.min(loud)
    out[:] = 0.0
    for g in range(groups):
        noise = (1.0 - (1.0 - faint / loud[g]) ** 2) / frames + EDGE
        spread = noise * max(usual[g] * (1.0 - usual[g]), FLAT)
        for s in range(strips):
            out[s] += (share[g, s] - usual[g]) ** 2 / spread / groups


def odd_strips(copies: Copies) -> Mask:
    """Strips that show another comb than most, shape (s,): something fixed to the camera stands before the wall.

    The texture is not asked: it may differ from strip to strip.
    """
    strange = np.empty(len(copies.rows))
    strangeness(copies.together, copies.apart, copies.frames, strange)
    strange *= copies.rows
    return np.asarray(strange > ODD * np.median(strange))


def wall_copies(stack: list[Image]) -> tuple[Copies | None, Mask]:
    """Spectra of the strips of frames of one size that show the wall, and which frequencies (f,) are usable.

    None if there are too few strips.  Odd strips take part neither in the spectra nor in the level of the columns.
    """
    gain = float(bin_height(*stack[0].shape))
    packed, thin = transformed(stack)
    copies = copies_of(packed, gain)
    usable = np.ones(len(copies.frequency), dtype=np.bool_)
    if blocky(thin):
        usable = block_notches(copies.frequency, copies.length)
    odd = odd_strips(copies)
    if odd.any():
        if float(np.mean(odd)) > MAX_LOST:
            return None, usable
        copies = copies_of(transformed(stack, np.repeat(~odd, copies.rows.astype(np.int64)))[0], gain)
    return copies, usable
