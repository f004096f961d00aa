"""Fewer points for the screen: extremes kept, breaks at gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MAX_POINTS = 2000
GOLDEN_RATIO = 0.6180339887498949


def minmax_rows(values: Array, max_points: int = MAX_POINTS) -> NDArray[np.int64]:
    """Rows to draw so that every extreme stays visible: lowest and highest of each of ``max_points / 2`` bins.

    values : (n,); NaN is never an extreme.  Returns ascending rows, all of them where n fits; first and last included.
    """
    count = values.size
    if count <= max_points:
        return np.arange(count)
    bins = max_points // 2 - 1
    edges = np.linspace(0, count, bins + 1).astype(np.int64)
    starts, ends = edges[:-1, None], edges[1:, None]
    rows = starts + np.arange(int(np.diff(edges).max()))
    outside = rows >= ends
    binned = values[np.minimum(rows, count - 1)]
    outside |= np.isnan(binned)
    lowest = np.argmin(np.where(outside, np.inf, binned), axis=1)
    highest = np.argmax(np.where(outside, -np.inf, binned), axis=1)
    return np.unique(np.concatenate(([0, count - 1], edges[:-1] + lowest, edges[:-1] + highest)))


def scatter_rows(values: Array, max_points: int = MAX_POINTS) -> NDArray[np.int64]:
    """Rows of a cloud of points to draw: three quarters spread evenly, so that its density is true, the rest extremes.

    The even part takes one row from each of equal stretches, at a place that shifts by the golden ratio from stretch to
    stretch, so that it cannot fall into step with readings that come in turns (one UWB anchor after the other).

    values : (n,).  Returns ascending rows, all of them where n fits.
    """
    if values.size <= max_points:
        return np.arange(values.size)
    even = 3 * max_points // 4
    stretch = np.arange(even)
    place = (stretch + np.modf(stretch * GOLDEN_RATIO)[0]) * (values.size / even)
    return np.unique(np.concatenate((place.astype(np.int64), minmax_rows(values, max_points - even))))


def gap_starts(seconds: Array) -> NDArray[np.int64]:
    """Rows after which a series falls silent: a step of more than 0.2 s and five times the median step."""
    steps = np.diff(seconds)
    if steps.size == 0:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(steps > max(0.2, 5.0 * float(np.median(steps)))).astype(np.int64)


def line_points(seconds: Array, values: Array, max_points: int = MAX_POINTS) -> tuple[Array, Array]:
    """Points of a line, decimated, with a NaN wherever the series was silent so that no line is drawn across.

    seconds, values : (n,) in order of time.  At most ``max_points`` rows are kept, breaks included up to a quarter.
    """
    breaks = gap_starts(seconds)
    longest = np.sort(breaks[np.argsort(np.diff(seconds)[breaks])[::-1][: max_points // 8]])
    rows = minmax_rows(values, max_points - 3 * longest.size)
    rows = np.unique(np.concatenate((rows, longest, longest + 1)))
    where = np.searchsorted(rows, longest) + 1
    x, y = seconds[rows], values[rows]
    return np.insert(x, where, x[where - 1]), np.insert(y, where, np.nan)


def envelope(seconds: Array, low: Array, high: Array, max_points: int = MAX_POINTS) -> tuple[Array, Array, Array]:
    """Band between two series as at most ``max_points`` stretches: lowest low and highest high of each.

    seconds, low, high : (n,).  Returns the middle of each stretch, low and high.
    """
    count = seconds.size
    if count <= max_points:
        return seconds, low, high
    edges = np.linspace(0, count, max_points + 1).astype(np.int64)
    starts = edges[:-1]
    middle = 0.5 * (seconds[starts] + seconds[edges[1:] - 1])
    return middle, np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
