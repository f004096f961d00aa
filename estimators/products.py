"""What the frames say about positions along the rows, with everything else summed out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectrum import Band
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Products:
    """Sums of products of row spectra for one choice of windows.

    Axes: strip of the picture s, class of vertical detail c, pair of frames p, frequency f.  Pairs that are kept in a
    ring are not in the order of the frames.

    Parameters
    ----------
    re, im
        Sums of ``Y_i conj(Y_j)`` over the rows, shape (s, c, p, f).
    power
        Sums of ``|Y|^2`` over rows and frames, shape (s, c, f).
    offset_px
        Where each frame's window starts, relative to the others [px], shape (n,).
    band
        Frequencies in use.
    window_px
        Length of the windows; zeros fill up what ``band`` transforms.
    rows
        Number of rows behind every sum, shape (s, c).
    height
        Place of every strip, -1 at the top of the picture, 1 at the bottom, shape (s,).
    place
        Where every pair i < j, in the order of :func:`~axialnav.estimators.spectrum.pair_frames`, is on the pair axis.
    known
        The strips summed up if that has been done already, the pairs in order.
    """

    re: Plane
    im: Plane
    power: Plane
    offset_px: Array
    band: Band
    window_px: int
    rows: Array
    height: Array
    place: Index
    known: Sums | None = None

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.offset_px)

    @property
    def independent(self) -> float:
        """Independent frequencies among those in use [-]: zeros make neighbours alike."""
        return self.window_px / self.band.length

    def selected(self, strips: NDArray[np.bool_]) -> Products:
        """The same with some strips only."""
        if strips.all():
            return self
        return replace(
            self,
            re=self.re[strips],
            im=self.im[strips],
            power=self.power[strips],
            rows=self.rows[strips],
            height=self.height[strips],
            known=None,
        )

    def weighted(self, weight: Plane) -> Products:
        """One class in place of all, their weighted sum; ``weight`` (c, f).  Its own memory, its power is zero."""
        strips, count, place = len(self.re), self.band.count, self.place
        re, im = np.zeros((2, strips, 1, len(place), count), dtype=np.float32)
        _weigh(self.re, self.im, weight, place, re, im)
        power, rows = np.zeros((strips, 1, count), dtype=np.float32), self.rows.sum(axis=1, keepdims=True)
        return replace(self, re=re, im=im, power=power, rows=rows, place=np.arange(len(place)), known=None)

    @cached_property
    def total(self) -> Sums:
        """The strips summed up."""
        if self.known is not None:
            return self.known
        classes, count = self.re.shape[1], self.band.count
        re, im = np.zeros((2, classes, len(self.place), count), dtype=np.float32)
        power = np.zeros((classes, count), dtype=np.float32)
        _sum_strips(self.re, self.im, self.power, self.place, re, im, power)
        return Sums(re, im, power, self.rows.sum(axis=0))


@dataclass(frozen=True)
class Sums:
    """:class:`Products` with the strips summed up: shapes (c, p, f), (c, f) and (c,)."""

    re: Plane
    im: Plane
    power: Plane
    rows: Array


@kernel
def _sum_strips(
    re: Plane, im: Plane, power: Plane, place: Index, out_re: Plane, out_im: Plane, out_power: Plane
) -> None:
    for s in range(re.shape[0]):
        for c in range(re.shape[1]):
            _add(power[s, c], out_power[c])
            for p in range(place.shape[0]):
                _add(re[s, c, place[p]], out_re[c, p])
                _add(im[s, c, place[p]], out_im[c, p])


@kernel
def _add(line: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += line[f]


@kernel
def _weigh(re: Plane, im: Plane, weight: Plane, place: Index, out_re: Plane, out_im: Plane) -> None:
    for s in range(re.shape[0]):
        for c in range(re.shape[1]):
            for p in range(place.shape[0]):
                _add_weighted(re[s, c, place[p]], weight[c], out_re[s, 0, p])
                _add_weighted(im[s, c, place[p]], weight[c], out_im[s, 0, p])


@kernel
def _add_weighted(line: Plane, weight: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += line[f] * weight[f]
