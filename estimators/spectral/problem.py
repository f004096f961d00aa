"""A mean power spectrum with everything its likelihood needs, at a resolution that suits the search."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import FIRST_BIN, Spectra, row_window
from axialnav.estimators.spectral.shapes import comb, pair_lags, smooth_basis
from axialnav.estimators.spectral.whittle import (
    BLUR,
    NOISE,
    PARAMETERS,
    SHIFT,
    TEXTURE,
    maximise,
    normal_equations,
    spectrum,
)

Array = NDArray[np.float64]
SINGLE_BINS, GROWTH = 12, 1.06
PER_RIPPLE = 7.0
LOOKS_PER_ROW = 0.4  # of neighbouring frequencies and rows, which are not independent; only the prior needs it
USUAL_SLOPE, USUAL_BEND, USUAL_LENS = (-1.2, 0.6), (-0.27, 0.15), (-3.0, 6.0)
LOW_QUANTILE = 0.05
TINY = 1e-9
COARSE_FLOOR, EXACT_FLOOR = 0.02, 0.0


@dataclass(frozen=True)
class Problem:
    """What the likelihood is maximised over.

    Parameters
    ----------
    frames
        Number of copies N in the picture.
    lags
        Numbers of pairs of copies at every lag, as ``pair_lags`` counts them.
    bins
        Which frequencies take part, if they are not grouped, shape (f,).
    frequency, power, weight, basis
        Mean frequency [cycles/px], mean power and number of bins of every group, and the texture's columns; (g,), (g,),
        (g,), (g, 4).
    window
        Autocorrelation of the window.
    floor
        What fills the comb's dark lines.
    prior
        Mean and inverse variance per row of every parameter, shape (2, p).
    """

    frames: int
    lags: Array
    bins: NDArray[np.bool_]
    frequency: Array
    power: Array
    weight: Array
    basis: Array
    window: Array
    floor: float
    prior: Array

    def climb(
        self, start: Array, tie: float, free: NDArray[np.bool_], steps: int, fresh: bool = False
    ) -> tuple[Array, float]:
        """Parameters of the highest likelihood near ``start`` and their misfit per row; ``fresh``: texture unknown."""
        return maximise(
            start, tie, free, self.lags, self.frequency, self.window, self.floor, self.power, self.weight,
            self.basis, self.prior, fresh, steps,
        )  # fmt: skip

    def model(self, theta: Array, tie: float) -> tuple[Array, Array]:
        """Model (g,) and the derivatives of its logarithm (g, p)."""
        shape, model = np.empty((len(self.power), 3)), np.empty(len(self.power))
        gradient = np.empty((len(self.power), PARAMETERS))
        comb(theta[SHIFT], theta[BLUR], self.lags, self.frequency, self.window, self.floor, shape)
        spectrum(theta, tie, self.basis, shape, model, gradient)
        return model, gradient

    def information(self, model: Array, gradient: Array) -> Array:
        """Information per row, prior included, shape (p, p)."""
        score, J = np.empty(PARAMETERS), np.empty((PARAMETERS, PARAMETERS))
        normal_equations(self.power, self.weight, model, gradient, score, J)
        return J + np.diag(self.prior[1])


def group_edges(count: int, widest: float) -> NDArray[np.int64]:
    """First bin of every group and the end: single bins, then ever wider groups up to ``widest``."""
    edges, width, at = [0], 1.0, 0
    while at < count:
        width = min(width * GROWTH, max(widest, 1.0)) if at >= SINGLE_BINS else 1.0
        at = min(at + int(width), count)
        edges.append(at)
    return np.array(edges, dtype=np.int64)


@dataclass(frozen=True)
class Grouping:
    """Groups of neighbouring usable frequencies: first and number of bins, those not empty, and the model's columns."""

    first: NDArray[np.int64]
    count: Array
    kept: NDArray[np.bool_]
    frequency: Array
    basis: Array


@lru_cache(maxsize=128)
def grouping(length: int, usable: bytes, widest: float) -> Grouping:
    """Groups up to ``widest`` bins wide; ``usable`` is the mask of frequencies as bytes."""
    mask = np.frombuffer(usable, dtype=np.bool_)
    frequency = (FIRST_BIN + np.arange(len(mask))) / length
    first = group_edges(len(mask), widest)[:-1]
    count = np.add.reduceat(mask.astype(np.float64), first)
    kept = count > 0.0
    middle = np.add.reduceat(frequency * mask, first)[kept] / count[kept]
    return Grouping(first, count[kept], kept, middle, smooth_basis(middle))


def pose(spectra: Spectra, usable: NDArray[np.bool_], frames: int, reach_px: float = math.inf) -> Problem:
    """Problem whose groups of bins resolve the ripples of copies ``reach_px`` apart; unusable bins are left out."""
    floor = EXACT_FLOOR if reach_px == math.inf else COARSE_FLOOR
    widest = max(1.0, spectra.length / (PER_RIPPLE * max(reach_px, 1.0)))
    groups = grouping(spectra.length, usable.tobytes(), widest)
    power = np.add.reduceat(spectra.mean * usable, groups.first)[groups.kept] / groups.count
    window = row_window(spectra.length)[1]
    prior = usual(power, float(spectra.rows.sum()))
    lags = pair_lags(tuple(range(frames)))
    return Problem(frames, lags, usable, groups.frequency, power, groups.count, groups.basis, window, floor, prior)


def usual(power: Array, rows: float) -> Array:
    """Prior (2, p): walls behind lenses look alike; level and noise are anything."""
    prior = np.zeros((2, PARAMETERS))
    ordered = np.sort(power)
    prior[0, TEXTURE] = np.log(max(float(ordered[len(ordered) // 2]), TINY))
    prior[0, NOISE] = np.log(max(float(ordered[int(LOW_QUANTILE * len(ordered))]), TINY))
    for k, (mean, sigma) in enumerate((USUAL_SLOPE, USUAL_BEND, USUAL_LENS)):
        prior[:, TEXTURE + 1 + k] = mean, 1.0 / (sigma**2 * LOOKS_PER_ROW * rows)
    return prior
