"""Motion across the rows: estimated from a few columns, so that the rows can follow the wall up and down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.positions import centred_times
from axialnav.estimators.rows import apply_window, bin_columns, fast_length, hann
from axialnav.estimators.search import lag_sums, profiles, unrelated_spread
from axialnav.estimators.spectrum import Band, all_pair_products, pair_count, power, row_spectra
from axialnav.estimators.texture import matched_weight, shape_family, texture_power

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
COLUMNS = 40
COLUMN_WIDTH = 8
REACH_PX = 24.0
MANY_FRAMES = 5
STEP_PX = 0.25
MIN_SIGNIFICANCE = 6.0
NOISE_SHARE = 0.85
TINY = 1e-12


@dataclass(frozen=True)
class Drift:
    """Displacement across the rows per frame [px]; 0 and ``seen = False`` where the columns do not tell."""

    cross_px: float
    seen: bool


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
        self._width = max(1, min(COLUMN_WIDTH, width // COLUMNS))
        self._count = min(COLUMNS, width // self._width)
        self.band = Band(fast_length(height))
        self._window = hann(self.band.length)
        shape = (self._count, self.band.length)
        self._columns = np.zeros((self._count, height), dtype=np.float32)
        self._windowed, self._packed = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
        self._spectra = np.zeros((2, frames, self._count, self.band.count), dtype=np.float32)
        self._edges = np.array([0, self._count], dtype=np.int64)

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
        return Drift(found.cross_px / lag, found.seen)

    def _measure(self, images: list[Image], displacement_px: float) -> Drift:
        offset = np.rint(displacement_px * centred_times(len(images))).astype(np.int64)
        offset -= offset.min()
        room = images[0].shape[1] - int(offset.max()) - self._count * self._width
        if room < 0:
            return Drift(0.0, False)
        step = self._width + room // self._count
        total, squares = np.zeros((1, self.band.count)), np.empty((1, self.band.count), dtype=np.float32)
        for k, image in enumerate(images):
            bin_columns(image, int(offset[k]), self._width, step, self._columns)
            apply_window(self._columns, 0, self._window, self._windowed)
            row_spectra(self._windowed, self.band, self._packed, self._spectra[0, k], self._spectra[1, k])
            power(self._spectra[0, k], self._spectra[1, k], self._edges, squares)
            total += squares
        return self._solve(total, len(images))

    def _solve(self, total: Array, frames: int) -> Drift:
        mean_power = total[0] / (frames * self._count)
        noise = np.full_like(mean_power, float(mean_power[int(NOISE_SHARE * self.band.count) :].mean()) + TINY)
        shapes = shape_family(self.band.first, self.band.count, self.band.length)
        texture = texture_power(mean_power, noise, self._count * frames, shapes)
        weight = matched_weight(texture, noise, frames)
        re, im = self._products(frames)
        factor = weight.astype(np.float32)
        grid = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
        rows = np.array([[float(self._count)]])
        spread = unrelated_spread(total[None].astype(np.float32), weight[None], frames, rows)
        found = profiles(lag_sums(re * factor, im * factor, frames), self.band, grid, spread)
        best = int(np.argmax(found.gain[0]))
        if best in (0, len(grid) - 1) or found.significance(best, np.ones(1, dtype=np.bool_)) < MIN_SIGNIFICANCE:
            return Drift(0.0, False)
        left, middle, right = found.gain[0, best - 1 : best + 2]
        bend = 2.0 * middle - left - right
        shift = 0.5 * (right - left) / bend if bend > 0.0 else 0.0
        return Drift(float(grid[best] + STEP_PX * max(-0.5, min(0.5, shift))), True)

    def _products(self, frames: int) -> tuple[Plane, Plane]:
        out = np.empty((2, 1, pair_count(frames), self.band.count), dtype=np.float32)
        re, im = self._spectra[0, :frames], self._spectra[1, :frames]
        all_pair_products(re, im, self._edges, out[0], out[1])
        return out[0], out[1]


def cross_or_nan(drift: Drift) -> float:
    """Drift for the estimate [px per frame]; NaN where it was not seen."""
    return drift.cross_px if drift.seen else math.nan
