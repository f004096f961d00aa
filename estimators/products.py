"""What the frames say about positions along the rows, with everything else summed out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectrum import Band

Array = NDArray[np.float64]
Plane = NDArray[np.float32]


@dataclass(frozen=True)
class Products:
    """Sums of products of row spectra for one choice of windows.

    Axes: strip of the picture s, class of vertical detail c, pair of frames p, frequency f.

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
    rows
        Number of rows behind every sum, shape (s, c).
    height
        Place of every strip, -1 at the top of the picture, 1 at the bottom, shape (s,).
    """

    re: Plane
    im: Plane
    power: Plane
    offset_px: Array
    band: Band
    rows: Array
    height: Array

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.offset_px)

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
        )

    def weighted(self, weight: Array) -> tuple[Plane, Plane]:
        """Sum over the classes with weights (c, f): two planes of shape (s, p, f)."""
        factor = weight.astype(np.float32)
        return (
            np.einsum("scpf,cf->spf", self.re, factor, optimize=False),
            np.einsum("scpf,cf->spf", self.im, factor, optimize=False),
        )
