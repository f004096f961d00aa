r"""Minimum of a cost by Fisher's method of scoring, damped.

A cost of innovations :math:`y` with predicted variances :math:`S` is twice a negative log-likelihood.  Its expected
curvature follows from first differences of y and S alone,

.. math:: H_{ij} = \sum_k w_k \left( \partial_i \ln S_k \, \partial_j \ln S_k
                   + 2 \, \partial_i y_k \, \partial_j y_k / S_k \right)

so the replays that give the slope give the curvature too, and a handful of steps lead to the minimum.  Source: Gupta
and Mehra (1974), "Computational aspects of maximum likelihood estimation"; damping: Marquardt (1963).  Gates make the
cost rough at small; a curvature that is a sum of squares does not mind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Batch = Callable[[list[Array]], list[float]]  # points -> costs, in order

TOLERANCE = 0.05  # of the cost: a fifth of a standard deviation
ROUND_TOLERANCE = 0.5
MAX_STEPS, MAX_LOOKS, MAX_ROUNDS = 25, 12, 6
LONGEST_STEP = 1.5  # a factor of 4.5 for what is searched as a logarithm
FLOOR = 0.1  # curvature that even a coordinate that does not matter is taken to have
FIRST_DAMPING, CALMER, BOLDER, HOPELESS_DAMPING = 1e-2, 10.0, 0.1, 1e6
SPREAD = 30.0  # between the two dampings that are tried side by side
LOOK = (-2.0, -0.7, 0.7, 2.0)


class Expansion(NamedTuple):
    """Cost at a point, its slope (n,) and its expected curvature (n, n)."""

    cost: float
    slope: Array
    curvature: Array


class Search(NamedTuple):
    """Where a search ended, and the cost there."""

    at: Array
    cost: float


def minimise(
    batch: Batch,
    expand: Callable[[Array], Expansion],
    start: Array,
    bounds: Sequence[tuple[float, float]],
    tolerance: float = TOLERANCE,
) -> Search:
    """Best point found within the bounds.

    Before a descent every coordinate is looked at far to both sides, as long as that helps: where many readings lie
    outside their gates the slope says little, and a setting that hardly matters where the search began (a walk that is
    far too small) has none.

    Parameters
    ----------
    batch
        Costs of several points.
    expand
        Cost, slope and curvature at a point.
    start
        (n,).
    bounds
        Lowest and highest value of each coordinate.
    tolerance
        Stop where a step gains less than this.
    """
    box = np.array(bounds, dtype=np.float64).T
    found = Search(np.array(start, dtype=np.float64), batch([start])[0])
    for _ in range(MAX_ROUNDS):
        looked = found = _look_around(batch, found, box)
        found = _descend(batch, expand, found.at, box, tolerance)
        if float(np.abs(found.at - looked.at).max()) < LOOK[2] or tolerance > ROUND_TOLERANCE:
            break
    return found


def _look_around(batch: Batch, found: Search, box: Array) -> Search:
    """Best point among many that are far away in one coordinate, from there again until there is no better one."""
    for _ in range(MAX_LOOKS):
        points = [_clip(_moved(found.at, i, far), box) for i in range(found.at.size) for far in LOOK]
        costs = batch(points)
        best = int(np.argmin(costs))
        if costs[best] > found.cost - ROUND_TOLERANCE:
            break
        found = Search(points[best], costs[best])
    return found


def _descend(batch: Batch, expand: Callable[[Array], Expansion], start: Array, box: Array, tolerance: float) -> Search:
    at, here, damping = start, expand(start), FIRST_DAMPING
    for _ in range(MAX_STEPS):
        points = [_clip(at + _step(at, here, d, box), box) for d in (damping, SPREAD * damping)]
        costs = batch(points)
        best = int(np.argmin(costs))
        gain = here.cost - costs[best]
        if gain > 0.0:
            at, damping = points[best], damping * (BOLDER if best == 0 else 1.0)
        else:
            damping *= CALMER * SPREAD
        if abs(gain) < tolerance or damping > HOPELESS_DAMPING:
            return Search(at, min(here.cost, costs[best]))
        if gain > 0.0:
            here = expand(at)
    return Search(at, here.cost)


def _step(at: Array, here: Expansion, damping: float, box: Array) -> Array:
    """Damped step of the coordinates that no bound holds."""
    held = ((at <= box[0]) & (here.slope > 0.0)) | ((at >= box[1]) & (here.slope < 0.0))
    free = np.flatnonzero(~held)
    step = np.zeros_like(at)
    if free.size:
        bent = here.curvature[np.ix_(free, free)]
        bent = bent + np.diag(damping * np.diag(bent) + FLOOR)
        step[free] = -np.linalg.solve(bent, here.slope[free])
    longest = float(np.abs(step).max(initial=0.0))
    return step * min(1.0, LONGEST_STEP / longest) if longest > 0.0 else step


def _moved(at: Array, index: int, by: float) -> Array:
    point = at.copy()
    point[index] += by
    return point


def _clip(point: Array, box: Array) -> Array:
    clipped: Array = np.clip(point, box[0], box[1])
    return clipped
