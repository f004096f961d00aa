"""The mean power spectrum of one exposure with everything its likelihood needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import Spectra
from axialnav.estimators.spectral.shapes import exposure_power, smooth_basis
from axialnav.estimators.spectral.whittle import (
    BLUR,
    NOISE,
    PARAMETERS,
    TEXTURE,
    maximise,
    normal_equations,
    spectrum,
)

Array = NDArray[np.float64]
LOOKS_PER_ROW = 0.4  # of neighbouring frequencies and rows, which are not independent; only the prior needs it
USUAL_SLOPE, USUAL_BEND, USUAL_LENS = (-1.2, 0.6), (-0.27, 0.15), (-3.0, 6.0)
LOW_QUANTILE = 0.05
TINY = 1e-9


@dataclass(frozen=True)
class Problem:
    """What the likelihood is maximised over.

    Parameters
    ----------
    bins
        Which frequencies take part, shape (f,).
    frequency, power, basis
        Those frequencies [cycles/px], mean power and the texture's columns; (g,), (g,), (g, 4).
    prior
        Mean and inverse variance per row of every parameter, shape (2, p).
    """

    bins: NDArray[np.bool_]
    frequency: Array
    power: Array
    basis: Array
    prior: Array

    def climb(self, start: Array, free: NDArray[np.bool_], steps: int) -> tuple[Array, float]:
        """Parameters of the highest likelihood near ``start``, whatever its texture, and their misfit per row."""
        return maximise(start, free, self.frequency, self.power, self.basis, self.prior, steps)

    def model(self, theta: Array) -> tuple[Array, Array]:
        """Model (g,) and the derivatives of its logarithm (g, p)."""
        shape, model = np.empty((len(self.power), 2)), np.empty(len(self.power))
        gradient = np.empty((len(self.power), PARAMETERS))
        exposure_power(self.frequency, theta[BLUR], shape)
        spectrum(theta, self.basis, shape, model, gradient)
        return model, gradient

    def information(self, model: Array, gradient: Array) -> Array:
        """Information per row, prior included, shape (p, p)."""
        score, J = np.empty(PARAMETERS), np.empty((PARAMETERS, PARAMETERS))
        normal_equations(self.power, model, gradient, score, J)
        return J + np.diag(self.prior[1])


def pose(spectra: Spectra, usable: NDArray[np.bool_]) -> Problem:
    """Problem of the usable bins (f,)."""
    frequency, power = spectra.frequency[usable], spectra.mean[usable]
    return Problem(usable, frequency, power, smooth_basis(frequency), usual(power, float(spectra.rows.sum())))


def usual(power: Array, rows: float) -> Array:
    """Prior (2, p): walls behind lenses look alike; level and noise are anything."""
    prior = np.zeros((2, PARAMETERS))
    ordered = np.sort(power)
    prior[0, TEXTURE] = np.log(max(float(ordered[len(ordered) // 2]), TINY))
    prior[0, NOISE] = np.log(max(float(ordered[int(LOW_QUANTILE * len(ordered))]), TINY))
    for k, (mean, sigma) in enumerate((USUAL_SLOPE, USUAL_BEND, USUAL_LENS)):
        prior[:, TEXTURE + 1 + k] = mean, 1.0 / (sigma**2 * LOOKS_PER_ROW * rows)
    return prior
