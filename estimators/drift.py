"""Motion across the rows: estimated from a few columns, so that the rows can follow the wall up and down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.positions import centred_times
from axialnav.estimators.rows import SUMMED_COLUMNS, apply_window, bin_columns, fast_length, hann
from axialnav.estimators.search import STEP_PX, LagTransform, search_weights
from axialnav.estimators.spectrum import Band, add_power, pair_products, row_spectra

Plane = NDArray[np.float32]
COLUMNS = 32
REACH_PX = 24.0
MANY_FRAMES = 5
KEPT_WINDOWS = 30
TALL_PX = 400  # taller pictures are read every second (third, ...) row: that is sharp enough
MIN_SIGNIFICANCE = 6.0
SIGMA_PX = 0.08  # of what is read between two of the asked frames, measured on rendered walls; a pixel pattern is in it


@dataclass(frozen=True)
class Drift:
    """Displacement across the rows per frame and its standard deviation [px]; ``seen = False`` where nothing tells."""

    cross_px: float
    seen: bool
    sigma_px: float = math.nan


class DriftBelief:
    """Whether the drift that the columns show has proved to be the wall's, for as long as it goes on."""

    def __init__(self) -> None:
        self.good, self._cross_px, self._left = False, math.inf, 0

    def forget(self) -> None:
        """Begin anew."""
        self._left = 0

    def holds(self, cross_px: float, jump_px: float) -> bool:
        """Whether the last answer still holds for this drift [px per frame]; it is the last one seen from now on."""
        near = self._left > 0 and abs(cross_px - self._cross_px) <= jump_px
        self._cross_px, self._left = cross_px, self._left - 1 if near else 0
        return near

    def note(self, cross_px: float) -> None:
        """Take note of a drift [px per frame] that is too small to be followed."""
        self._cross_px = cross_px

    def renew(self, good: bool) -> None:
        """Take note of what the strips say about the last drift seen."""
        self.good, self._left = good, KEPT_WINDOWS


class DriftMeter:
    """Buffers for frames of one size.

    Parameters
    ----------
    height, width
        Size of the frames [px].
    frames
        Largest number of frames.
    """

    def __init__(self, height: int, width: int, frames: int) -> None:
        self._count = min(COLUMNS, width // SUMMED_COLUMNS)
        self._stride = max(1, round(height / TALL_PX))
        height //= self._stride
        self.band = Band(fast_length(height))
        self._every = np.arange(self._count)
        self._window = hann(self.band.length)
        shape, count = (self._count, self.band.length), self.band.count
        self._columns = np.zeros((self._count, height), dtype=np.float32)
        self._windowed, self._packed = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
        self._spectra = np.zeros((2, frames, self._count, count), dtype=np.float32)
        self._pairs = np.zeros((2, frames, frames, 1, count), dtype=np.float32)
        self._edges = np.array([0, self._count], dtype=np.int64)
        self._lags = LagTransform(1, self.band)
        reach = round(REACH_PX / STEP_PX)
        self._grid = np.asarray(STEP_PX * np.arange(-reach, reach + 1), dtype=np.float64)

    def measure(self, images: list[Image], displacement_px: float) -> Drift:
        """Drift of frames (oldest first) whose wall moves by ``displacement_px`` per frame along the rows.

        The columns follow the wall, or there would be nothing in common between them.  Of many frames the first, the
        middle and the last are asked.
        """
        lag = 1
        if len(images) >= MANY_FRAMES:
            lag = (len(images) - 1) // 2
            images, displacement_px = images[: 2 * lag + 1 : lag], displacement_px * lag
        found = self._measure(images, displacement_px)
        return Drift(found.cross_px / lag, found.seen, self._stride * SIGMA_PX / lag)

    def _measure(self, images: list[Image], displacement_px: float) -> Drift:
        offset = np.rint(displacement_px * centred_times(len(images))).astype(np.int64)
        offset -= offset.min()
        room = images[0].shape[1] - int(offset.max()) - self._count * SUMMED_COLUMNS
        if room < 0:
            return Drift(0.0, False)
        step = SUMMED_COLUMNS + room // self._count
        squares = np.zeros((1, self.band.count), dtype=np.float32)
        (all_re, all_im), (pair_re, pair_im) = self._spectra, self._pairs
        for k, image in enumerate(images):
            bin_columns(image, int(offset[k]), step, self._stride, self._columns)
            apply_window(self._columns, self._every, 0, self._window, self._windowed)
            row_spectra(self._windowed, self.band, self._packed, all_re[k], all_im[k])
            add_power(all_re[k], all_im[k], self._edges, squares)
            for i in range(k):
                pair_products(all_re[i], all_im[i], all_re[k], all_im[k], self._edges, pair_re[i, k], pair_im[i, k])
        return self._solve(squares, len(images))

    def _solve(self, squares: Plane, frames: int) -> Drift:
        order, rows = np.arange(frames), np.array([[float(self._count)]])
        weight, spread, _ = search_weights(squares[None], order[:1], frames, rows, self.band)
        found = self._lags.profiles(self._pairs[0], self._pairs[1], order, weight, self._grid, spread)
        everyone, best = np.ones(1, dtype=np.bool_), int(np.argmax(found.gain[0]))
        if best in (0, len(self._grid) - 1) or found.significance(best, everyone) < MIN_SIGNIFICANCE:
            return Drift(0.0, False)
        return Drift(self._stride * found.peak_px(best, everyone), True)


def cross_or_nan(drift: Drift) -> tuple[float, float]:
    """Drift for the estimate and its sigma [px per frame]; NaN where it was not seen."""
    return (drift.cross_px, drift.sigma_px) if drift.seen else (math.nan, math.nan)
