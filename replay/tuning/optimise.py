"""Curvature of a cost at its minimum, and what that says of each coordinate.

Costs are twice a negative log-likelihood: a rise by 1 is one standard deviation.  Gates make them rough, so differences
are taken over steps much wider than the roughness, all points at once and side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.tuning.scoring import Batch

Array = NDArray[np.float64]
FIRST_CURVE_STEP, SMALLEST_CURVE_STEP, LARGEST_CURVE_STEP = 0.1, 0.02, 1.0
WANTED_RISE = 2.0
NEAR_BOUND = 0.02
BLUNT_SIGMA = 1.0  # a factor of e: the data say next to nothing


@dataclass(frozen=True)
class Minimum:
    """Where a cost is smallest.

    Attributes
    ----------
    at
        Search coordinates, shape (n,).
    cost
        Cost there.
    sigma
        Standard errors from the curvature, shape (n,); infinite where there is none.
    correlation
        Of the errors, shape (n, n).
    at_bound
        Which coordinates ended at a bound.
    unidentifiable
        Which coordinates the cost does not fix: flat, or only in combination with others.
    """

    at: Array
    cost: float
    sigma: Array
    correlation: Array
    at_bound: NDArray[np.bool_]
    unidentifiable: NDArray[np.bool_]


def curvature(batch: Batch, at: Array, bounds: Sequence[tuple[float, float]]) -> Array:
    """Hessian at a minimum from second differences over about one standard deviation.

    Each coordinate gets a step on which the cost rises by about 2, so that neither roughness nor the next bend decides.
    """
    n = at.size
    lows, highs = np.array(bounds, dtype=np.float64).T
    inside = np.clip(at, lows + LARGEST_CURVE_STEP * 1e-3, highs - LARGEST_CURVE_STEP * 1e-3)
    cost = float(batch([inside])[0])
    unit = np.eye(n)
    step = np.full(n, FIRST_CURVE_STEP)
    for _ in range(2):
        pairs = batch([inside + sign * step[i] * unit[i] for i in range(n) for sign in (-1.0, 1.0)])
        rise = np.array(pairs).reshape(n, 2).mean(axis=1) - cost
        second = 2.0 * rise / step**2
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = np.where(second > 0.0, np.sqrt(2.0 * WANTED_RISE / second), LARGEST_CURVE_STEP)
        step = np.clip(wanted, SMALLEST_CURVE_STEP, LARGEST_CURVE_STEP)
    axes = np.array(batch([inside + sign * step[i] * unit[i] for i in range(n) for sign in (-1.0, 1.0)])).reshape(n, 2)
    couples = [(i, j) for i in range(n) for j in range(i)]
    signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    mixed = batch([inside + a * step[i] * unit[i] + b * step[j] * unit[j] for i, j in couples for a, b in signs])
    hessian = np.diag((axes.sum(axis=1) - 2.0 * cost) / step**2)
    for (i, j), (pp, pm, mp, mm) in zip(couples, np.array(mixed).reshape(-1, 4), strict=True):
        hessian[i, j] = hessian[j, i] = (pp - pm - mp + mm) / (4.0 * step[i] * step[j])
    return hessian


def describe(batch: Batch, at: Array, bounds: Sequence[tuple[float, float]]) -> Minimum:
    """A minimum with standard errors; coordinates at a bound, or not fixed by the cost, are marked."""
    cost = float(batch([at])[0])
    hessian = curvature(batch, at, bounds)
    lows, highs = np.array(bounds, dtype=np.float64).T
    at_bound = (at - lows < NEAR_BOUND) | (highs - at < NEAR_BOUND)
    sigma, correlation = standard_errors(hessian)
    blunt = ~(sigma < BLUNT_SIGMA)
    return Minimum(at, cost, sigma, correlation, at_bound, blunt)


def standard_errors(hessian: Array) -> tuple[Array, Array]:
    """Standard errors and correlations from the curvature of twice the negative log-likelihood.

    Directions without curvature are left out: the coordinates that they move get an infinite error.
    """
    n = hessian.shape[0]
    scale = np.sqrt(np.maximum(np.diag(hessian), 0.0))
    flat = scale <= 1.0 / (2.0 * LARGEST_CURVE_STEP)
    sigma, correlation = np.full(n, np.inf), np.eye(n)
    keep = np.flatnonzero(~flat)
    if keep.size == 0:
        return sigma, correlation
    scaled = hessian[np.ix_(keep, keep)] / np.outer(scale[keep], scale[keep])
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    sound = values > 1e-4
    covariance = 2.0 * (vectors[:, sound] / values[sound]) @ vectors[:, sound].T
    lost = (np.abs(vectors[:, ~sound]) > 0.3).any(axis=1)
    spread = np.sqrt(np.diag(covariance))
    sigma[keep] = np.where(lost, np.inf, spread / scale[keep])
    correlation[np.ix_(keep, keep)] = covariance / np.outer(spread, spread)
    return sigma, correlation
