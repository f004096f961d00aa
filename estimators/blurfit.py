"""Search and refinement of the displacement (or blur length) that explains one power spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectrum import Band
from axialnav.estimators.whittle import fitted_spectrum, parabola, transfer, whittle_costs

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
SLOPES = (1.0, 1.5, 2.0, 2.5, 3.0)
LENS_SIGMAS_PX = (0.4, 0.8, 1.4)
CANDIDATES = 6
SLOW_PX, SLOW_RATIO, SLOW_CANDIDATES = 7.0, 1.06, 3
NOTCHES = (0.125, 0.25, 0.375)  # the block grid of JPEG
NOTCH_BINS = 2
HANN_VARIANCE = 1.94
ROUNDS = 4


@dataclass(frozen=True)
class BlurFit:
    """The best explanation of a spectrum.

    Parameters
    ----------
    value_px
        Displacement per frame, or blur length for a single frame [px].
    sigma_px
        From the spread of the strips [px].
    gain
        Log-likelihood over the best explanation without blur.
    lead
        Log-likelihood over the best explanation that lies elsewhere.
    """

    value_px: float
    sigma_px: float
    gain: float
    lead: float


@dataclass(frozen=True)
class BlurModel:
    """What is fitted: ``frames`` in the mean, exposure ratio, and the range of displacements [px]."""

    frames: int
    exposure_ratio: float
    low_px: float
    high_px: float

    def grid(self) -> Array:
        """Displacements fine enough for every ridge and dark line up to the highest frequency."""
        step = 0.2 / (max(self.frames, 2) * 0.48) if self.frames > 1 else 0.25
        return np.arange(self.low_px, self.high_px, step)


@lru_cache(maxsize=8)
def _tables(model: BlurModel, band: Band) -> tuple[Array, Plane, Plane, Array]:
    """Grid (d,), transfers and smooth transfers as float32 (d, f), usable bins (f,)."""
    grid, frequency = model.grid(), band.frequency()
    sharp = transfer(grid, frequency, model.frames, model.exposure_ratio).astype(np.float32)
    smooth = np.empty_like(sharp)
    for row, value in enumerate(grid):
        width = _period_bins(float(value), band, model)
        smooth[row] = cv2.blur(sharp[row][None], (width, 1))[0]
    usable = np.ones(band.count)
    for notch in NOTCHES:
        usable[np.abs(np.arange(band.first, band.last) - notch * band.length) <= NOTCH_BINS] = 0.0
    return grid, sharp, smooth, usable


def _period_bins(value_px: float, band: Band, model: BlurModel) -> int:
    return max(3, min(band.count // 2, round(band.length / max(value_px, 2.0)))) | 1


@lru_cache(maxsize=8)
def blur_shapes(band: Band) -> Array:
    """Power laws behind Gaussian lenses, candidate spectra of texture, shape (m, f)."""
    f = band.frequency()
    family = [(f / f[0]) ** -a * np.exp(-((2.0 * np.pi * s * f) ** 2)) for a in SLOPES for s in LENS_SIGMAS_PX]
    return np.array(family)


def fit_blur(strips: Array, band: Band, looks: float, model: BlurModel) -> BlurFit:
    """Fit a blur to a power spectrum.

    Parameters
    ----------
    strips
        Mean power of the rows of every strip of the picture, shape (s, f).
    band
        Its frequencies.
    looks
        Number of rows in all strips.
    model
        What to fit.
    """
    grid, sharp, smooth, usable = _tables(model, band)
    power = strips.mean(axis=0)
    shapes, keep = blur_shapes(band), usable > 0.0
    first = np.concatenate(
        [grid[_candidates(power, sharp, smooth, usable, band)], _slow_candidates(power, band, model, shapes)]
    )
    cost, best = _costs(power[keep], first, band, model, shapes, keep)
    winner = int(np.argmin(cost))
    elsewhere = np.abs(first - first[winner]) > max(1.0, 0.1 * float(first[winner]))
    shape = shapes[best[winner]][None]
    value, least = _refine(power[keep], float(first[winner]), float(grid[1] - grid[0]), band, model, shape, keep)
    none = np.empty(1)
    whittle_costs(power[keep], np.ones((1, int(keep.sum()))), shapes[:, keep], none, np.empty(1, dtype=np.int64))
    scale = looks / HANN_VARIANCE
    return BlurFit(
        value,
        _sigma(strips, value, band, model, shape, keep),
        scale * (float(none[0]) - least),
        scale * (float(cost[elsewhere].min()) - least) if elsewhere.any() else math.inf,
    )


def _candidates(power: Array, sharp: Plane, smooth: Plane, usable: Array, band: Band) -> NDArray[np.int64]:
    """Grid points whose ripple matches that of the spectrum best, local maxima only."""
    floor = float(np.median(power[int(0.85 * band.count) :]))
    score = np.zeros(sharp.shape[0])
    for width in {max(3, band.count // n) | 1 for n in (6, 16, 48)}:
        level = cv2.blur(power[None], (width, 1))[0]
        ripple = (usable * (power / level - 1.0)).astype(np.float32)
        noise = (floor / level).clip(0.0, 1.0).astype(np.float32)
        template = (sharp / np.maximum(smooth, 1e-6) - 1.0) * (1.0 - noise)
        norm = np.sqrt(np.einsum("df,df->d", template, template)) + 1e-6
        score = np.maximum(score, template @ ripple / norm)
    inner = np.flatnonzero((score[1:-1] >= score[:-2]) & (score[1:-1] >= score[2:])) + 1
    if not len(inner):
        inner = np.array([int(np.argmax(score))])
    return np.asarray(inner[np.argsort(score[inner])[::-1][:CANDIDATES]], dtype=np.int64)


def _slow_candidates(power: Array, band: Band, model: BlurModel, shapes: Array) -> Array:
    """The best few of slow displacements [px], whose spectra have no ripple to look for.

    They vary so slowly over frequency that a few bins may share one value.
    """
    high = min(SLOW_PX, model.high_px)
    values = np.geomspace(model.low_px, high, max(3, int(math.log(high / model.low_px) / math.log(SLOW_RATIO))))
    size = max(1, int(band.length / (6.0 * max(model.frames, 2) * high)))
    count = band.count // size
    grouped = power[: count * size].reshape(count, size).mean(axis=1)
    frequency = band.frequency()[: count * size].reshape(count, size).mean(axis=1)
    some = shapes[:: len(LENS_SIGMAS_PX), : count * size].reshape(-1, count, size).mean(axis=2)
    cost = np.empty(len(values))
    whittle_costs(
        grouped, transfer(values, frequency, model.frames, model.exposure_ratio), some, cost,
        np.empty(len(values), dtype=np.int64),
    )  # fmt: skip
    return np.asarray(values[np.argsort(cost)[:SLOW_CANDIDATES]])


def _costs(
    power: Array, values: Array, band: Band, model: BlurModel, shapes: Array, keep: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.int64]]:
    table = transfer(values, band.frequency()[keep], model.frames, model.exposure_ratio)
    cost, best = np.empty(len(values)), np.empty(len(values), dtype=np.int64)
    whittle_costs(power, table, np.ascontiguousarray(shapes[:, keep]), cost, best)
    return cost, best


def _refine(
    power: Array, value: float, step: float, band: Band, model: BlurModel, shape: Array, keep: NDArray[np.bool_]
) -> tuple[float, float]:
    """Value and cost of the minimum near ``value``, by ever smaller grids and a last parabola."""
    least = math.inf
    for _ in range(ROUNDS):
        values = max(value, 4.0 * step) + step * np.arange(-3.0, 4.0)
        cost, _ = _costs(power, values, band, model, shape, keep)
        k = int(np.clip(np.argmin(cost), 1, len(cost) - 2))
        place, _ = parabola(values[k - 1 : k + 2], cost[k - 1 : k + 2])
        value, least = float(np.clip(place, values[0], values[-1])), min(least, float(cost.min()))
        step /= 3.0
    return value, least


def _sigma(strips: Array, value: float, band: Band, model: BlurModel, shape: Array, keep: NDArray[np.bool_]) -> float:
    """Standard deviation from the scores of single strips: texture is lumpier than any smooth spectrum allows for."""
    step = 0.02 * max(0.05, min(1.0, value))
    around = np.array([value - step, value, value + step])
    tables = transfer(around, band.frequency()[keep], model.frames, model.exposure_ratio)
    power, g = strips[:, keep], shape[0, keep]
    low, level, high = (fitted_spectrum(power.mean(axis=0), table, g) for table in tables)
    slope = (high - low) / (2.0 * step)
    score = ((power - level) * slope / level**2).sum(axis=1)
    information = len(power) * float(np.sum((slope / level) ** 2))
    spread = float(np.sum((score - score.mean()) ** 2)) * len(score) / (len(score) - 1)
    return math.sqrt(spread) / information if information > 0.0 else math.inf
