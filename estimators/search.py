"""The likelihood of every displacement at once, by inverse transforms of the lag sums."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectrum import LAST_FREQUENCY, Band
from axialnav.estimators.texture import sharp_family, texture_power
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
STEP_PX, SAMPLES_PER_PX = 0.25, 2  # half a sample, which ``_gather`` relies on
SOFTENING = 3.0  # windows and texture that is not Gaussian make the likelihood over-confident by about this factor
NEAR_PX = 1.0
RIVAL_PX = 8.0
TINY = 1e-12
NOISE_SHARE = 0.85  # above this share of the frequencies the fixed windows hold mostly noise
ENOUGH_INFORMATION, REACH_MARGIN, REACH_STEP = 0.98, 1.25, LAST_FREQUENCY / 12
LEAST_REACH = 0.5 * LAST_FREQUENCY  # noise and patterns of the pixels are seen above the texture
HANN_VARIANCE = 1.94  # of a sum over neighbouring bins, which a Hann window makes dependent


@dataclass(frozen=True)
class Profiles:
    """Log-likelihoods over displacement, one row per band of the picture.

    Parameters
    ----------
    grid_px
        Displacements [px], shape (d,).
    gain
        Log-likelihood of every band, shape (b, d); differences matter.
    spread
        Standard deviation that ``gain`` would have if the frames had nothing in common, shape (b,).
    reach
        Frequency beyond which hardly anything tells of the motion [cycles/px].
    """

    grid_px: Array
    gain: Array
    spread: Array
    reach: float = LAST_FREQUENCY

    def total(self, bands: NDArray[np.bool_]) -> Array:
        """Sum over some bands, shape (d,)."""
        return np.asarray(bands.astype(np.float64) @ self.gain)

    def near(self, index: int, reach_px: float) -> slice:
        """Grid points within ``reach_px`` of a grid point."""
        steps = int(reach_px / (self.grid_px[1] - self.grid_px[0]) + 1e-9)
        return slice(max(0, index - steps), index + steps + 1)

    def peak_px(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Displacement at the top of a parabola through the total at a grid point and its neighbours."""
        if not 0 < index < len(self.grid_px) - 1:
            return float(self.grid_px[index])
        left, middle, right = (float(gain) for gain in bands.astype(np.float64) @ self.gain[:, index - 1 : index + 2])
        bend = 2.0 * middle - left - right
        shift = 0.5 * (right - left) / bend if bend > 0.0 else 0.0
        return float(self.grid_px[index]) + STEP_PX * max(-0.5, min(0.5, shift))

    def significance(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Height of the total at a grid point in standard deviations of unrelated frames."""
        return float(self.gain[bands, index].sum() / np.sqrt(np.sum(self.spread[bands] ** 2)))

    def rivals(self, index: int, bands: NDArray[np.bool_]) -> tuple[float, float]:
        """What speaks for displacements other than that of a grid point.

        Posterior mass further than 1 px from it under the softened likelihood, and the highest total further than 8 px
        away over the total there [-].
        """
        total = self.total(bands)
        mass = np.exp(np.minimum((total - total[index]) / SOFTENING, 50.0))
        near, apart = self.near(index, NEAR_PX), self.near(index, RIVAL_PX)
        whole = float(mass.sum())
        far = [float(part.max()) for part in (total[: apart.start], total[apart.stop :]) if len(part)]
        share = max(far) / float(total[index]) if far and total[index] > 0.0 else 0.0
        return (whole - float(mass[near].sum())) / whole, share


class LagTransform:
    """From pair products to the profiles of all bands; scratch of one size.

    Parameters
    ----------
    bands
        Bands of the picture.
    frames
        Number of frames.
    band
        Frequencies in use.
    """

    def __init__(self, bands: int, frames: int, band: Band) -> None:
        self.band, self.bands = band, bands
        length = SAMPLES_PER_PX * band.length
        self._sums = np.zeros((2, bands * (frames - 1), band.count), dtype=np.float32)
        self._packed = np.zeros((bands * (frames - 1), length), dtype=np.float32)
        self._correlation = np.zeros_like(self._packed)

    def profiles(
        self, re: Plane, im: Plane, order: NDArray[np.int64], weight: Array, grid_px: Array, spread: Array
    ) -> Profiles:
        """Evaluate ``2 sum_m sum_f Re(C_m exp(-i w d m))`` on the grid of displacements.

        Parameters
        ----------
        re, im
            Sums of ``Y_i conj(Y_j)`` for the frames in slots i, j, shape (n, n, b * c, f): only those of an older frame
            i and a younger j are read.
        order
            Slots of the frames, oldest first.
        weight
            Matched weights, shape (c, f).
        grid_px
            Displacements [px], neighbouring multiples of ``STEP_PX``, shape (d,).
        spread
            See :class:`Profiles`.
        """
        lags = self.bands * (len(order) - 1)
        sums, packed, correlation = self._sums[:, :lags], self._packed[:lags], self._correlation[:lags]
        lag_sums(re, im, order, weight.astype(np.float32), sums)
        _pack(sums, self.band.first, packed)
        cv2.dft(packed, correlation, flags=cv2.DFT_ROWS | cv2.DFT_INVERSE | cv2.DFT_REAL_OUTPUT)
        gain = np.zeros((self.bands, len(grid_px)))
        _gather(correlation.reshape(self.bands, -1, packed.shape[1]), round(grid_px[0] / STEP_PX), gain)
        return Profiles(grid_px, gain, spread)


@kernel
def lag_sums(re: Plane, im: Plane, order: NDArray[np.int64], weight: Plane, sums: Plane) -> None:
    """Weighted sums over all pairs of equal distance in time: (n, n, b * c, f) to (2, b * lags, f), lag 1 first."""
    frames, classes = order.shape[0], weight.shape[0]
    sums[:] = np.float32(0.0)
    for i in range(frames):
        for j in range(i + 1, frames):
            for b in range(re.shape[2] // classes):
                row = b * (frames - 1) + j - i - 1
                for c in range(classes):
                    group = b * classes + c
                    _add_weighted(re[order[i], order[j], group], weight[c], sums[0, row])
                    _add_weighted(im[order[i], order[j], group], weight[c], sums[1, row])


@kernel
def _add_weighted(values: Plane, weight: Plane, total: Plane) -> None:
    for f in range(total.shape[0]):
        total[f] += values[f] * weight[f]


@kernel
def _pack(sums: Plane, first: int, packed: Plane) -> None:
    """Conjugate spectra as rows of (Re_0, Re_1, Im_1, Re_2, ...), the form that the inverse transform takes."""
    for r in range(packed.shape[0]):
        re, im, line = sums[0, r], sums[1, r], packed[r, 2 * first - 1 :]
        for f in range(re.shape[0]):
            line[2 * f] = re[f]
            line[2 * f + 1] = -im[f]


@kernel
def _gather(correlation: Plane, first: int, gain: Array) -> None:
    """Read lag m of the circular correlations (b, m, l) at m times every displacement.

    Displacements are multiples of a quarter pixel from number ``first`` on, samples half a pixel apart: what is read
    lies on a sample or in the middle between two.
    """
    bands, lags, length = correlation.shape
    half = np.float32(0.5)
    for b in range(bands):
        for m in range(lags):
            line = correlation[b, m]
            for d in range(gain.shape[1]):
                place = (first + d) * (m + 1)
                left = place >> 1
                if left < 0 or left >= length:
                    left %= length
                right = left + (place & 1)
                gain[b, d] += (line[left] + line[right if right < length else 0]) * half


def unrelated_spread(power: Plane, weight: Array, frames: int, rows: Array) -> Array:
    """Standard deviation of the profile of frames that share nothing but their spectra, shape (b,).

    Parameters
    ----------
    power
        Power summed over the rows of a band and all frames, shape (b, c, f).
    weight
        Matched weights, shape (c, f).
    frames
        Number of frames.
    rows
        Rows of every band and class, shape (b, c).
    """
    pairs = 0.5 * frames * (frames - 1)
    of_one_frame = weight * power / frames
    variance = np.sum(np.sum(of_one_frame**2, axis=-1) / rows, axis=-1)
    return np.asarray(np.sqrt(2.0 * HANN_VARIANCE * pairs * variance))


def search_spectra(power: Array, looks: Array, band: Band) -> tuple[Array, Array]:
    """Texture (c, f) and noise (f,) from the mean power (c, f) of ``looks`` (c,) rows.

    The noise is white, and read off the finest class.
    """
    tail = int(NOISE_SHARE * band.count)
    noise = np.full(band.count, float(power[-1, tail:].mean()) + TINY)
    shapes, family, starts = sharp_family(band.first, band.count, band.length)
    texture = np.empty_like(power)
    for c in range(len(power)):
        texture_power(power[c], noise, float(looks[c]), shapes, family, starts, texture[c])
    return texture, noise


def informative(texture: Array, weight: Array, rows: Array, band: Band) -> float:
    """Frequency [cycles/px] beyond which hardly anything tells of the motion, in steps of a twelfth of the band.

    What the search's rows say, with a margin, for finer rows hold finer detail. ``texture`` and ``weight`` (c, f),
    ``rows`` (c,).
    """
    information = np.cumsum(rows @ (weight * texture) * band.omega() ** 2)
    last = int(np.searchsorted(information, ENOUGH_INFORMATION * information[-1])) + band.first
    steps = np.ceil(REACH_MARGIN * last / band.length / REACH_STEP)
    return float(min(max(steps * REACH_STEP, LEAST_REACH), LAST_FREQUENCY))
