"""Motion across the rows: estimated from a few columns, so that the rows can follow the wall up and down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.anchor import Anchor
from axialnav.estimators.frames import Image
from axialnav.estimators.rows import SUMMED_COLUMNS, apply_window, bin_columns, fast_length, hann
from axialnav.estimators.search import STEP_PX, LagTransform, search_weights
from axialnav.estimators.spectrum import Band, add_power, pair_products, row_spectra

Plane = NDArray[np.float32]
COLUMNS = 32
REACH_PX = 24.0
MANY_FRAMES = 5
DRIFT_SHARE = 1.0  # of a bin: drift over the whole window that is worth following
FAST_DRIFT_PX = 12.0  # per frame: faster than anything that flies beside a wall; bins that hide it need no look
KEPT_WINDOWS = 30
TALL_PX = 400  # taller pictures are read every second (third, ...) row: that is sharp enough
MIN_SIGNIFICANCE = 6.0
SIGMA_PX = 0.08  # of what is read between two of the asked frames, measured on rendered walls; a pixel pattern is in it


def hidden_drift_px(bin_height: int, frames: int) -> float:
    """Drift [px per frame] of so many frames that bins of so many rows hide, so that it is not worth following."""
    return DRIFT_SHARE * bin_height / (frames - 1)


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
        self._power = np.zeros((frames, 1, count), dtype=np.float32)
        self._pairs = np.zeros((2, frames, frames, 1, count), dtype=np.float32)
        self._serial = np.zeros((frames, frames), dtype=np.int64)
        self._edges = np.array([0, self._count], dtype=np.int64)
        self._lags = LagTransform(1, self.band)
        reach = round(REACH_PX / STEP_PX)
        self._grid = np.asarray(STEP_PX * np.arange(-reach, reach + 1), dtype=np.float64)

    def measure(self, images: list[Image], order: list[int], anchor: Anchor) -> Drift:
        """Drift of the frames in the slots ``order``, oldest first, of ``images`` by slot.

        The columns follow the wall with the section that is anchored to it, or there would be nothing in common between
        them.  Of many frames the first, the middle and the last are asked.
        """
        lag = 1
        if len(order) >= MANY_FRAMES:
            lag = (len(order) - 1) // 2
            order = order[: 2 * lag + 1 : lag]
        room = anchor.length - self._count * SUMMED_COLUMNS
        if room < 0:
            return Drift(0.0, False)
        step = SUMMED_COLUMNS + room // self._count
        for younger, slot in enumerate(order):
            if self._serial[slot, slot] != anchor.serial[slot]:
                self._transform(images[slot], anchor.start[slot], step, slot)
                self._serial[slot, slot] = anchor.serial[slot]
            for other in order[:younger]:
                self._pair(other, slot, max(anchor.serial[other], anchor.serial[slot]))
        found = self._solve(order)
        return Drift(found.cross_px / lag, found.seen, self._stride * SIGMA_PX / lag)

    def _transform(self, image: Image, first_column: int, step: int, slot: int) -> None:
        bin_columns(image, first_column, step, self._stride, self._columns)
        apply_window(self._columns, self._every, 0, self._window, self._windowed)
        re, im = self._spectra[:, slot]
        row_spectra(self._windowed, self.band, self._packed, re, im)
        self._power[slot] = 0.0
        add_power(re, im, self._edges, self._power[slot])

    def _pair(self, i: int, j: int, serial: int) -> None:
        """Products of an older and a younger frame; the greater of their serial numbers says whether they are known."""
        if self._serial[i, j] != serial:
            (all_re, all_im), (pair_re, pair_im) = self._spectra, self._pairs
            pair_products(all_re[i], all_im[i], all_re[j], all_im[j], self._edges, pair_re[i, j], pair_im[i, j])
            self._serial[i, j] = serial

    def _solve(self, slots: list[int]) -> Drift:
        order, rows = np.array(slots), np.array([[float(self._count)]])
        weight, spread, _ = search_weights(self._power, order, len(slots), rows, self.band)
        found = self._lags.profiles(self._pairs[0], self._pairs[1], order, weight, self._grid, spread)
        everyone, best = np.ones(1, dtype=np.bool_), int(np.argmax(found.gain[0]))
        if best in (0, len(self._grid) - 1) or found.significance(best, everyone) < MIN_SIGNIFICANCE:
            return Drift(0.0, False)
        return Drift(self._stride * found.peak_px(best, everyone), True)


def cross_or_nan(drift: Drift) -> tuple[float, float]:
    """Drift for the estimate and its sigma [px per frame]; NaN where it was not seen."""
    return (drift.cross_px, drift.sigma_px) if drift.seen else (math.nan, math.nan)
