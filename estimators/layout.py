"""Binned rows rearranged: strips of the picture, and in each strip classes of vertical detail.

Texture is strongest where it is smooth in both directions.  Rows taken one by one waste that in weak light, and sums
of many rows waste the fine texture in good light.  An orthonormal Haar transform down the columns keeps both apart:
smooth rows and ever finer differences of rows become classes with weights of their own, and the noise stays white.

Source: Haar, Math. Annalen 69 (1910); the gain is that of a two-dimensional matched filter, to within a few percent.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.rows import sum_rows
from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
Index = NDArray[np.int64]
STRIPS, BANDS = 10, 5  # two neighbouring strips make a band
COARSE_CLASSES = 2  # enough to search with: a fourth to a half of the rows, most of the power
MAX_LEVELS = 3
MIN_BLOCKS = 20
ROOT_HALF = np.float32(0.7071067811865476)


class RowLayout:
    """Where every coefficient of a binned frame goes.

    Parameters
    ----------
    rows
        Number of binned rows.

    Attributes
    ----------
    levels, classes
        Depth of the transform, and number of classes (smooth rows first, then from coarse to fine differences).
    used
        Rows that take part; the rest is less than one block.
    place
        Output row of coefficient j of block b, shape (blocks * 2^levels,).
    edges
        First output row of every class of every strip, and the end, shape (strips * classes + 1,).
    strip_edges
        First output row of every strip, and the end, shape (strips + 1,).
    height, band_height
        Middle of every strip and of every band, -1 at the top and 1 at the bottom of the rows that take part, shapes
        (strips,) and (bands,).
    count
        Coefficient rows per strip and class, shape (strips, classes).
    smooth
        First row and one past the last, of every strip's smooth rows, shape (strips, 2).
    coarse
        First row and one past the last, of every strip's classes but the finest, shape (strips, 2).
    coarse_rows, coarse_edges, coarse_count
        The rows of the coarse classes, ordered by band and class; the first of every band and class among them, and
        the end; and their numbers, shape (bands, coarse classes).
    """

    def __init__(self, rows: int) -> None:
        self.levels = MAX_LEVELS
        while self.levels > 0 and rows >> self.levels < MIN_BLOCKS:
            self.levels -= 1
        self.classes = self.levels + 1
        size = 1 << self.levels
        blocks = rows // size
        self.used = blocks * size
        starts = np.linspace(0, blocks, STRIPS + 1).astype(np.int64)
        self.height = (starts[:-1] + starts[1:]) / blocks - 1.0
        self.band_height = self.height.reshape(BANDS, -1).mean(axis=1)
        per_class = np.array([1, *(1 << level for level in range(self.levels))], dtype=np.int64)
        self.count = np.diff(starts)[:, None] * per_class[None]
        self.edges = np.concatenate([[0], np.cumsum(self.count)]).astype(np.int64)
        self.strip_edges = self.edges[:: self.classes].copy()
        first = np.concatenate([[0], np.cumsum(per_class)])
        self.place = np.empty(self.used, dtype=np.int64)
        for strip in range(STRIPS):
            for block in range(starts[strip], starts[strip + 1]):
                for level, many in enumerate(per_class):
                    target = self.edges[strip * self.classes + level] + (block - starts[strip]) * many
                    source = block * size + first[level]
                    self.place[source : source + many] = np.arange(target, target + many)
        ends = self.edges[1:].reshape(STRIPS, self.classes)
        firsts = self.edges[:-1].reshape(STRIPS, self.classes)
        coarse = min(COARSE_CLASSES, max(1, self.levels))
        self.coarse = np.stack([firsts[:, 0], ends[:, max(0, self.levels - 1)]], axis=1)
        self.smooth = np.stack([firsts[:, 0], ends[:, 0]], axis=1)
        paired = [
            [np.arange(firsts[s, c], ends[s, c]) for s in (2 * band, 2 * band + 1)]
            for band in range(BANDS)
            for c in range(coarse)
        ]
        self.coarse_rows = np.concatenate([rows for pair in paired for rows in pair]).astype(np.int64)
        sizes = np.array([sum(map(len, pair)) for pair in paired], dtype=np.int64)
        self.coarse_edges = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self.coarse_count = sizes.reshape(BANDS, coarse).astype(np.float64)


@lru_cache(maxsize=16)
def row_layout(rows: int) -> RowLayout:
    """The layout of so many binned rows, shared: not to be written to."""
    return RowLayout(rows)


@kernel
def binned_coefficients(
    frame: NDArray[np.uint8],
    first_row: int,
    height: int,
    levels: int,
    place: Index,
    sums: NDArray[np.uint32],
    work: Plane,
    kept: NDArray[np.uint8],
    out: Plane,
) -> None:
    """Bin rows and transform blocks of ``2^levels`` of them; coefficient ``j`` of block ``b`` goes to ``place[b, j]``.

    Parameters
    ----------
    frame
        Picture (h, w).
    first_row
        Where the first bin starts.
    height
        Rows per bin.
    levels, place
        See :class:`RowLayout`.
    sums, work
        Scratch: (w,) as :func:`~axialnav.estimators.rows.row_sums` makes it, and (2^levels, w).
    kept
        Where the picture is copied to while it is near the processor, shape (h, w); (0, w): nowhere.
    out
        Sum of every block first, then differences from coarse to fine, shape (rows, w).
    """
    size = 1 << levels
    _copy(frame, 0, first_row, kept)
    for block in range(place.shape[0] // size):
        for j in range(size):
            top = first_row + (block * size + j) * height
            sum_rows(frame, top, height, sums, work[j])
            _copy(frame, top, top + height, kept)
        step = 1
        while step < size:
            half = size // (2 * step)
            for j in range(half):
                first, second = work[2 * step * j], work[2 * step * j + step]
                _difference(first, second, out[place[block * size + half + j]])
                _join(second, first)
            step *= 2
        out[place[block * size]] = work[0]
    _copy(frame, first_row + place.shape[0] * height, frame.shape[0], kept)


@kernel
def _copy(frame: NDArray[np.uint8], first: int, end: int, kept: NDArray[np.uint8]) -> None:
    for r in range(max(first, 0), min(end, kept.shape[0])):
        _copy_row(frame[r], kept[r])


@kernel
def _copy_row(line: NDArray[np.uint8], out: NDArray[np.uint8]) -> None:
    for c in range(out.shape[0]):
        out[c] = line[c]


@kernel
def _difference(first: Plane, second: Plane, out: Plane) -> None:
    for c in range(out.shape[0]):
        out[c] = (first[c] - second[c]) * ROOT_HALF


@kernel
def _join(line: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] = (total[c] + line[c]) * ROOT_HALF


@kernel
def remove_level(rows: Plane, smooth: Index, means: Plane) -> None:
    """Take the level of every column off the smooth rows: the median over five bands of its mean in the band.

    It is where columns of the sensor, vignettes and upright objects fixed to the camera live, and a wall that moves
    leaves almost nothing of itself there.  A plain mean would smear an object in one band over all rows.  Differences
    of rows hold none of it.

    Parameters
    ----------
    rows
        Coefficients, shape (r, w).
    smooth
        First smooth row of every strip, and one past its last, shape (s, 2).
    means
        Scratch, shape (5, w).
    """
    strips = smooth.shape[0]
    means[:] = np.float32(0.0)
    for band in range(BANDS):
        many = 0
        for s in range(band * strips // BANDS, (band + 1) * strips // BANDS):
            many += smooth[s, 1] - smooth[s, 0]
            for r in range(smooth[s, 0], smooth[s, 1]):
                _add(rows[r], means[band])
        _scale(means[band], np.float32(1.0 / max(many, 1)))
    _median(means[0], means[1], means[2], means[3], means[4])
    for s in range(strips):
        for r in range(smooth[s, 0], smooth[s, 1]):
            _subtract(means[0], rows[r])


@kernel
def _add(line: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] += line[c]


@kernel
def _subtract(line: Plane, total: Plane) -> None:
    for c in range(total.shape[0]):
        total[c] -= line[c]


@kernel
def _scale(line: Plane, factor: np.float32) -> None:
    for c in range(line.shape[0]):
        line[c] *= factor


@kernel
def _median(a: Plane, b: Plane, m: Plane, d: Plane, e: Plane) -> None:
    """Median of five, into the first."""
    for c in range(a.shape[0]):
        low, high = max(min(a[c], b[c]), min(d[c], e[c])), min(max(a[c], b[c]), max(d[c], e[c]))
        a[c] = max(min(low, high), min(m[c], max(low, high)))
