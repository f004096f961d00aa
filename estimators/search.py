"""The likelihood of every displacement at once, by inverse transforms of the lag sums."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from axialnav.estimators.spectrum import Band
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
STEP_PX = 0.25
SOFTENING = 3.0  # windows and texture that is not Gaussian make the likelihood over-confident by about this factor
NEAR_PX = 1.0
RIVAL_PX = 8.0
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
    """

    grid_px: Array
    gain: Array
    spread: Array

    def total(self, bands: NDArray[np.bool_]) -> Array:
        """Sum over some bands, shape (d,)."""
        return np.asarray(self.gain[bands].sum(axis=0))

    def significance(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Height of the total at a grid point in standard deviations of unrelated frames."""
        return float(self.gain[bands, index].sum() / np.sqrt(np.sum(self.spread[bands] ** 2)))

    def outside_mass(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Posterior mass further than 1 px from a grid point, under the softened likelihood."""
        total = self.total(bands) / SOFTENING
        mass = np.exp(np.minimum(total - total[index], 50.0))
        near = np.abs(self.grid_px - self.grid_px[index]) <= NEAR_PX
        return float(mass[~near].sum() / mass.sum())

    def rival_share(self, index: int, bands: NDArray[np.bool_]) -> float:
        """Highest total elsewhere (further than 8 px) over the total at a grid point [-]."""
        total = self.total(bands)
        far = np.abs(self.grid_px - self.grid_px[index]) > RIVAL_PX
        if not far.any() or total[index] <= 0.0:
            return 0.0
        return float(total[far].max() / total[index])


def lag_sums(re: Plane, im: Plane, frames: int) -> NDArray[np.complex64]:
    """Sum weighted pair products (b, p, f) of equal distance in time: complex, shape (b, n - 1, f), lag 1 first."""
    bands, _, count = re.shape
    sums = np.zeros((bands, frames - 1, count), dtype=np.complex64)
    p = 0
    for i in range(frames):
        for j in range(i + 1, frames):
            sums[:, j - i - 1].real += re[:, p]
            sums[:, j - i - 1].imag += im[:, p]
            p += 1
    return sums


def profiles(sums: NDArray[np.complex64], band: Band, grid_px: Array, spread: Array) -> Profiles:
    """Evaluate ``2 sum_m sum_f Re(C_m exp(-i w d m))`` on the grid of displacements.

    Parameters
    ----------
    sums
        Lag sums C_m, weights included, shape (b, lags, f).
    band
        Frequencies in use.
    grid_px
        Displacements [px], shape (d,).
    spread
        See :class:`Profiles`.
    """
    length = 2 * band.length
    padded = np.zeros((*sums.shape[:2], length // 2 + 1), dtype=np.complex64)
    padded[..., band.first : band.last] = np.conj(sums)
    correlation = scipy.fft.irfft(padded, length, axis=-1) * np.float32(length)
    gain = np.zeros((sums.shape[0], grid_px.shape[0]))
    _gather(np.asarray(correlation, dtype=np.float32), grid_px, 2.0, gain)
    return Profiles(grid_px, gain, spread)


@kernel
def _gather(correlation: Plane, grid_px: Array, samples_per_px: float, gain: Array) -> None:
    bands, lags, length = correlation.shape
    for b in range(bands):
        for m in range(lags):
            line = correlation[b, m]
            for d in range(grid_px.shape[0]):
                place = grid_px[d] * (m + 1) * samples_per_px
                left = int(np.floor(place))
                share = place - left
                gain[b, d] += line[left % length] * (1.0 - share) + line[(left + 1) % length] * share


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
