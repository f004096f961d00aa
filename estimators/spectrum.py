"""Row spectra, and the products of spectra that hold everything the frames say about the motion.

For rows ``r`` and frames ``k`` the model is ``Y_rk(w) = S_r(w) exp(-i w x_k) + n`` with the positions ``x_k`` of the
wall's content.  The likelihood needs only the sums over rows of ``Y_i conj(Y_j)``, one complex number per pair of
frames and frequency; they are kept for groups of rows (strips), whose spread gives sigma and whose quarrels give away
what does not move with the wall.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
Array = NDArray[np.float64]
FIRST_BIN = 4  # below: lamps and vignettes
LEAST_BINS = 4
LAST_FREQUENCY = 0.48  # cycles per pixel; above: aliasing


@dataclass(frozen=True)
class Band:
    """The frequencies in use for windows of one length.

    Parameters
    ----------
    length
        Window length [px].
    reach
        Frequencies end here [cycles/px].
    """

    length: int
    reach: float = LAST_FREQUENCY

    @property
    def first(self) -> int:
        """First bin."""
        return FIRST_BIN

    @property
    def last(self) -> int:
        """One past the last bin."""
        return max(FIRST_BIN + LEAST_BINS, int(self.length * self.reach))

    @property
    def count(self) -> int:
        """Number of bins."""
        return self.last - self.first

    def frequency(self) -> Array:
        """Frequencies [cycles/px], shape (count,), shared: not to be written to."""
        return _frequencies(self)[0]

    def omega(self) -> Array:
        """Frequencies [rad/px], shape (count,), shared: not to be written to."""
        return _frequencies(self)[1]


@lru_cache(maxsize=64)
def _frequencies(band: Band) -> tuple[Array, Array]:
    """Frequencies of a band in cycles and in radians per pixel."""
    cycles = np.arange(band.first, band.last, dtype=np.float64) / band.length
    return cycles, 2.0 * np.pi * cycles


def pair_count(frames: int) -> int:
    """Number of pairs i < j of ``frames`` frames."""
    return frames * (frames - 1) // 2


@lru_cache(maxsize=64)
def pair_frames(frames: int) -> NDArray[np.int64]:
    """Frames i and j of every pair in the order of the pair axis, shape (pairs, 2); shared, not to be written to."""
    return np.array([(i, j) for i in range(frames) for j in range(i + 1, frames)], dtype=np.int64).reshape(-1, 2)


def row_spectra(windowed: Plane, band: Band, packed: Plane, re: Plane, im: Plane) -> None:
    """Fourier transform of every row, the bins of ``band`` into ``re`` and ``im`` (r, count)."""
    cv2.dft(windowed, packed, flags=cv2.DFT_ROWS)
    _unpack(packed, band.first, re, im)


@kernel
def _unpack(packed: Plane, first: int, re: Plane, im: Plane) -> None:
    for r in range(re.shape[0]):
        _deinterleave(packed[r, 2 * first - 1 :], re[r], im[r])


@kernel
def _deinterleave(line: Plane, re: Plane, im: Plane) -> None:
    for f in range(re.shape[0]):
        re[f] = line[2 * f]
        im[f] = line[2 * f + 1]


@kernel
def pair_products(
    re_i: Plane, im_i: Plane, re_j: Plane, im_j: Plane, edges: NDArray[np.int64], out_re: Plane, out_im: Plane
) -> None:
    """Sums of ``Y_i conj(Y_j)`` over the rows of every group.

    Spectra (r, f) as planes; ``edges`` (g + 1,) first row of every group; outputs (g, f).
    """
    out_re[:] = np.float32(0.0)
    out_im[:] = np.float32(0.0)
    for g in range(edges.shape[0] - 1):
        _add_products(re_i, im_i, re_j, im_j, edges[g], edges[g + 1], out_re[g], out_im[g])


@kernel
def _add_products(
    re_i: Plane, im_i: Plane, re_j: Plane, im_j: Plane, first: int, end: int, out_re: Plane, out_im: Plane
) -> None:
    """Add the products of the rows from ``first`` to ``end``, two at a time: that saves half of the sums' traffic."""
    r = first
    while r + 1 < end:
        _add_two(re_i[r], im_i[r], re_j[r], im_j[r], re_i[r + 1], im_i[r + 1], re_j[r + 1], im_j[r + 1], out_re, out_im)
        r += 2
    if r < end:
        _add_product(re_i[r], im_i[r], re_j[r], im_j[r], out_re, out_im)


@kernel
def _add_two(
    a: Plane, b: Plane, c: Plane, d: Plane, p: Plane, q: Plane, u: Plane, v: Plane, out_re: Plane, out_im: Plane
) -> None:
    for f in range(a.shape[0]):
        out_re[f] += a[f] * c[f] + b[f] * d[f] + (p[f] * u[f] + q[f] * v[f])
        out_im[f] += b[f] * c[f] - a[f] * d[f] + (q[f] * u[f] - p[f] * v[f])


@kernel
def _add_product(a: Plane, b: Plane, c: Plane, d: Plane, out_re: Plane, out_im: Plane) -> None:
    """Add ``(a + i b) conj(c + i d)``, all (f,): a function of its own, so that the compiler sees plain arrays."""
    for f in range(a.shape[0]):
        out_re[f] += a[f] * c[f] + b[f] * d[f]
        out_im[f] += b[f] * c[f] - a[f] * d[f]


@kernel
def all_pair_products(re: Plane, im: Plane, edges: NDArray[np.int64], out_re: Plane, out_im: Plane) -> None:
    """:func:`pair_products` of every pair of frames: spectra (n, r, f), outputs (g, p, f)."""
    frames = re.shape[0]
    out_re[:] = np.float32(0.0)
    out_im[:] = np.float32(0.0)
    for g in range(edges.shape[0] - 1):
        p = 0
        for i in range(frames):
            for j in range(i + 1, frames):
                _add_products(re[i], im[i], re[j], im[j], edges[g], edges[g + 1], out_re[g, p], out_im[g, p])
                p += 1


@kernel
def fresh_products(
    re: Plane,
    im: Plane,
    edges: NDArray[np.int64],
    slots: NDArray[np.int64],
    fresh: NDArray[np.bool_],
    number: NDArray[np.int64],
    out_re: Plane,
    out_im: Plane,
    total_re: Plane,
    total_im: Plane,
) -> None:
    """:func:`pair_products` of the pairs that a fresh frame is in, and their sums over the strips.

    Parameters
    ----------
    re, im
        Spectra by slot, shape (slots, r, f).
    edges
        First row of every class of every strip, and the end, shape (s c + 1,).
    slots
        Slots in use, oldest first, shape (n,).
    fresh
        Which of them have new spectra, shape (n,).
    number
        Where the pair of two slots goes, shape (slots, slots).
    out_re, out_im
        Products, shape (s c, p, f).
    total_re, total_im
        Sums of them, shape (c, p, f).
    """
    frames, classes = slots.shape[0], total_re.shape[0]
    for g in range(edges.shape[0] - 1):
        c = g % classes
        for i in range(frames):
            for j in range(i + 1, frames):
                if not (fresh[i] or fresh[j]):
                    continue
                a, b = slots[i], slots[j]
                p = number[a, b]
                out_re[g, p] = np.float32(0.0)
                out_im[g, p] = np.float32(0.0)
                _add_products(re[a], im[a], re[b], im[b], edges[g], edges[g + 1], out_re[g, p], out_im[g, p])
                if g < classes:
                    total_re[c, p] = np.float32(0.0)
                    total_im[c, p] = np.float32(0.0)
                _add_line(out_re[g, p], total_re[c, p])
                _add_line(out_im[g, p], total_im[c, p])


@kernel
def in_order(lines: Plane, place: NDArray[np.int64], out: Plane) -> None:
    """Lines (c, q, f) at ``place`` (p,) as ``out`` (c, p, f)."""
    for c in range(out.shape[0]):
        for p in range(place.shape[0]):
            out[c, p] = lines[c, place[p]]


@kernel
def total_power(powers: Plane, slots: NDArray[np.int64], out: Plane, total: Plane) -> None:
    """Sum powers (slots, s c, f) over slots into ``out`` (s c, f), and these over the strips into ``total`` (c, f)."""
    total[:] = np.float32(0.0)
    for g in range(out.shape[0]):
        out[g] = np.float32(0.0)
        for k in range(slots.shape[0]):
            _add_line(powers[slots[k], g], out[g])
        _add_line(out[g], total[g % total.shape[0]])


@kernel
def _add_line(line: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += line[f]


@kernel
def still_power(re: Plane, power: Plane, slots: NDArray[np.int64], rows: Array, first: int) -> tuple[float, float]:
    """What frames share without moving from frequency ``first`` on, and its variance if they share nothing.

    Parameters
    ----------
    re
        Real parts of pair products, shape (slots, slots, g, f).
    power
        Sums of squares, shape (slots, g, f).
    slots
        Slots in use, oldest first.
    rows
        Rows behind every group, shape (g,).
    first
        First frequency.

    Returns
    -------
    shared
        Sum over all pairs, groups and frequencies.
    variance
        Of the product of one pair with unrelated phases, summed over groups and frequencies, twice.
    """
    fine = re.shape[3] - first
    total, square, shared, variance = np.zeros(fine, dtype=np.float32), np.empty(fine, dtype=np.float32), 0.0, 0.0
    for i in range(slots.shape[0]):
        for j in range(i + 1, slots.shape[0]):
            for g in range(re.shape[2]):
                _add_line(re[slots[i], slots[j], g, first:], total)
    for g in range(re.shape[2]):
        square[:] = np.float32(0.0)
        for i in range(slots.shape[0]):
            _add_line(power[slots[i], g, first:], square)
        mean = 0.0
        for f in range(fine):
            mean += square[f]
        mean /= fine * slots.shape[0]
        variance += fine * mean * mean / rows[g]
    for f in range(fine):
        shared += total[f]
    return shared, variance


@kernel
def add_power(re: Plane, im: Plane, edges: NDArray[np.int64], out: Plane) -> None:
    """Add the sums of ``|Y|^2`` over the rows of every group to ``out`` (g, f)."""
    for g in range(edges.shape[0] - 1):
        for r in range(edges[g], edges[g + 1]):
            _add_square(re[r], im[r], out[g])


@kernel
def _add_square(a: Plane, b: Plane, out: Plane) -> None:
    for f in range(a.shape[0]):
        out[f] += a[f] * a[f] + b[f] * b[f]
