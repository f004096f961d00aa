"""Search among all displacements with the coarse rows of windows that stay where they are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.layout import BANDS, RowLayout
from axialnav.estimators.rows import apply_window, fast_length, hann
from axialnav.estimators.search import HANN_VARIANCE, LagTransform, Profiles, search_weights
from axialnav.estimators.spectrum import Band, add_power, pair_count, pair_products, row_spectra, still_power

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
FINE_FROM, SURE = 0.75, 2.0


class CoarseSearch:
    """Rings of spectra and of products of all pairs, filled with one transform per frame.

    Parameters
    ----------
    layout
        Where the coefficients of a frame are.
    width
        Width of the frames [px].
    frames
        Length of the rings.
    """

    def __init__(self, layout: RowLayout, width: int, frames: int) -> None:
        self._layout, self.band = layout, Band(fast_length(width))
        self._start = (width - self.band.length) // 2
        self._hann = hann(self.band.length)
        rows, groups, count = len(layout.coarse_rows), layout.coarse_count.size, self.band.count
        self._windowed, self._packed = np.empty((2, rows, self.band.length), dtype=np.float32)
        self._re, self._im = np.empty((2, frames, rows, count), dtype=np.float32)
        self._power = np.empty((frames, groups, count), dtype=np.float32)
        self._pair_re, self._pair_im = np.empty((2, frames, frames, groups, count), dtype=np.float32)
        self._lags = LagTransform(BANDS, self.band)

    def push(self, rows: Plane, slot: int, older: list[int]) -> None:
        """Put a frame's coefficients (r, w) into a slot, beside those in the slots ``older``."""
        layout, edges = self._layout, self._layout.coarse_edges
        apply_window(rows, layout.coarse_rows, self._start, self._hann, self._windowed)
        row_spectra(self._windowed, self.band, self._packed, self._re[slot], self._im[slot])
        self._power[slot] = 0.0
        add_power(self._re[slot], self._im[slot], edges, self._power[slot])
        for other in older:
            pair_products(
                self._re[other], self._im[other], self._re[slot], self._im[slot],
                edges, self._pair_re[other, slot], self._pair_im[other, slot],
            )  # fmt: skip

    def repeats(self, order: list[int]) -> bool:
        """Whether fine detail repeats from frame to frame without moving: a pattern of the pixels, most likely.

        Asked of the frequencies beyond which few walls have any detail behind a lens.
        """
        slots, rows = np.array(order, dtype=np.int64), self._layout.coarse_count.ravel()
        first = int(FINE_FROM * self.band.count)
        shared, noise = still_power(self._pair_re, self._power, slots, rows, first)
        return shared > SURE * math.sqrt(0.5 * HANN_VARIANCE * pair_count(len(order)) * noise)

    def profiles(self, order: list[int], grid_px: Array) -> Profiles:
        """Likelihood of every displacement [px] for the frames in the slots ``order``, oldest first."""
        slots = np.array(order, dtype=np.int64)
        weight, spread, reach = search_weights(self._power, slots, len(order), self._layout.coarse_count, self.band)
        found = self._lags.profiles(self._pair_re, self._pair_im, slots, weight, grid_px, spread)
        return replace(found, reach=reach)
