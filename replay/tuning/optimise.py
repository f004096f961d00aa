"""Minimum of a cost that is smooth at large and rough at small, its curvature there, and what that says of each axis.

Costs are twice a negative log-likelihood: a rise by 1 is one standard deviation.  Gates make them rough, so slopes are
taken over steps much wider than the roughness, all points of a slope at once and side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Batch = Callable[[list[Array]], list[float]]  # points -> costs, in order

STEP = 0.04
TOLERANCE = 0.02
ROUND_ITERATIONS = 10
MAX_ROUNDS = 6
ROUND_TOLERANCE = 0.5
MIN_CURVATURE = 1.0
LOOK = (-2.0, -0.7, 0.7, 2.0)
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
    evaluations
        Costs computed.
    """

    at: Array
    cost: float
    sigma: Array
    correlation: Array
    at_bound: NDArray[np.bool_]
    unidentifiable: NDArray[np.bool_]
    evaluations: int


def minimise(batch: Batch, start: Array, bounds: Sequence[tuple[float, float]]) -> tuple[Array, float, int]:
    """Best point found, its cost and the number of evaluations.

    Rounds of L-BFGS-B; between them every coordinate is looked at far to both sides, because a setting that hardly
    matters where the search began (a walk that is far too small) can hold it there.

    batch : costs of several points.  start : (n,).  bounds : of each coordinate.
    """
    descent = _Descent(batch, bounds)
    at, cost = np.array(start, dtype=np.float64), float(batch([start])[0])
    for _ in range(MAX_ROUNDS):
        before = cost
        at, cost = descent.run(at, cost)
        if before - cost > ROUND_TOLERANCE:
            continue
        at, cost, moved = descent.look_around(at, cost)
        if not moved:
            break
    return at, cost, descent.evaluations + 1


class _Descent:
    """L-BFGS-B on central differences, in coordinates scaled by the curvature where each round begins.

    Source: Byrd, Lu, Nocedal and Zhu (1995), as in scipy.
    """

    def __init__(self, batch: Batch, bounds: Sequence[tuple[float, float]]) -> None:
        self._batch = batch
        self._lows, self._highs = np.array(bounds, dtype=np.float64).T
        self.evaluations = 0

    def run(self, at: Array, cost: float) -> tuple[Array, float]:
        """One round; returns the best point seen."""
        from scipy.optimize import minimize

        seen: list[tuple[float, Array]] = [(cost, at)]
        _, slope, second = self._differences(at)
        scale = np.sqrt(np.clip(np.maximum(second, np.abs(slope)), MIN_CURVATURE, None))

        def scaled(y: Array) -> tuple[float, Array]:
            x = np.clip(y / scale, self._lows, self._highs)
            here, gradient, _ = self._differences(x)
            seen.append((here, x))
            return here, gradient / scale

        box = list(zip(self._lows * scale, self._highs * scale, strict=True))
        options: Any = {
            "maxiter": ROUND_ITERATIONS,
            "ftol": TOLERANCE / max(abs(cost), 1.0),
            "gtol": TOLERANCE,
            "maxls": 6,
        }
        minimize(scaled, at * scale, args=(), jac=True, method="L-BFGS-B", bounds=box, options=options)
        best, point = min(seen, key=lambda pair: pair[0])
        return point, best

    def look_around(self, at: Array, cost: float) -> tuple[Array, float, bool]:
        """Try every coordinate far to both sides; whether any of it was better."""
        points = []
        for i in range(at.size):
            for far in LOOK:
                point = at.copy()
                point[i] = np.clip(at[i] + far, self._lows[i], self._highs[i])
                points.append(point)
        costs = self._batch(points)
        self.evaluations += len(points)
        best = int(np.argmin(costs))
        if costs[best] < cost - ROUND_TOLERANCE:
            return points[best], costs[best], True
        return at, cost, False

    def _differences(self, x: Array) -> tuple[float, Array, Array]:
        """Cost, slope and second derivative along each coordinate."""
        points = [x]
        for i in range(x.size):
            for side in (-STEP, STEP):
                point = x.copy()
                point[i] = np.clip(x[i] + side, self._lows[i], self._highs[i])
                points.append(point)
        costs = self._batch(points)
        self.evaluations += len(points)
        pairs = np.array(costs[1:]).reshape(-1, 2)
        span = np.array([points[2 * i + 2][i] - points[2 * i + 1][i] for i in range(x.size)])
        return costs[0], np.diff(pairs, axis=1)[:, 0] / span, (pairs.sum(axis=1) - 2.0 * costs[0]) / STEP**2


def curvature(batch: Batch, at: Array, bounds: Sequence[tuple[float, float]]) -> tuple[Array, int]:
    """Hessian at a minimum from second differences over about one standard deviation; and the evaluations it took.

    Each coordinate gets a step on which the cost rises by about 2, so that neither roughness nor the next bend decides.
    """
    n = at.size
    lows, highs = np.array(bounds, dtype=np.float64).T
    inside = np.clip(at, lows + LARGEST_CURVE_STEP * 1e-3, highs - LARGEST_CURVE_STEP * 1e-3)
    cost = float(batch([inside])[0])
    unit = np.eye(n)
    step, count = np.full(n, FIRST_CURVE_STEP), 1
    for _ in range(2):
        pairs = batch([inside + sign * step[i] * unit[i] for i in range(n) for sign in (-1.0, 1.0)])
        count += 2 * n
        rise = np.array(pairs).reshape(n, 2).mean(axis=1) - cost
        second = 2.0 * rise / step**2
        with np.errstate(divide="ignore", invalid="ignore"):
            wanted = np.where(second > 0.0, np.sqrt(2.0 * WANTED_RISE / second), LARGEST_CURVE_STEP)
        step = np.clip(wanted, SMALLEST_CURVE_STEP, LARGEST_CURVE_STEP)
    axes = np.array(batch([inside + sign * step[i] * unit[i] for i in range(n) for sign in (-1.0, 1.0)])).reshape(n, 2)
    couples = [(i, j) for i in range(n) for j in range(i)]
    signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    mixed = batch([inside + a * step[i] * unit[i] + b * step[j] * unit[j] for i, j in couples for a, b in signs])
    count += 2 * n + 4 * len(couples)
    hessian = np.diag((axes.sum(axis=1) - 2.0 * cost) / step**2)
    for (i, j), (pp, pm, mp, mm) in zip(couples, np.array(mixed).reshape(-1, 4), strict=True):
        hessian[i, j] = hessian[j, i] = (pp - pm - mp + mm) / (4.0 * step[i] * step[j])
    return hessian, count


def describe(batch: Batch, at: Array, bounds: Sequence[tuple[float, float]]) -> Minimum:
    """A minimum with standard errors; coordinates at a bound, or not fixed by the cost, are marked."""
    cost = float(batch([at])[0])
    hessian, looked = curvature(batch, at, bounds)
    lows, highs = np.array(bounds, dtype=np.float64).T
    at_bound = (at - lows < NEAR_BOUND) | (highs - at < NEAR_BOUND)
    sigma, correlation = standard_errors(hessian)
    blunt = ~(sigma < BLUNT_SIGMA)
    return Minimum(at, cost, sigma, correlation, at_bound, blunt & ~at_bound, looked + 1)


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
