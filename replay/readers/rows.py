"""Which rows of a file can be used: values, duplicates, clock, order.  What cannot is left out, counted and named."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.replay.readers.columns import Column, Layout
from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.dropped import DropLog

Mask = NDArray[np.bool_]
FAR_NS = 10_000_000_000
JUMP_NS = 1_000_000_000
HOUR_NS = 3_600_000_000_000
QUATERNION_TOLERANCE = 0.01


class Sieve:
    """Rows that are still in use, and the log of those that are not.

    Parameters
    ----------
    rows
        Rows as read, in file order.
    sensor
        Name for the log.
    drops
        The log.
    """

    def __init__(self, rows: Rows, sensor: str, drops: DropLog) -> None:
        self.rows = rows
        self.sensor = sensor
        self._drops = drops

    def refuse(self, bad: Mask, reason: str) -> None:
        """Leave out the rows in ``bad``."""
        if bad.any():
            self.note(bad, reason)
            self.rows = self.rows.subset(~bad)

    def note(self, which: Mask, reason: str) -> None:
        """Log rows that stay in use."""
        self._drops.add(self.sensor, reason, int(which.sum()), self.rows.example(int(which.argmax())))


def usable_rows(
    rows: Rows, layout: Layout, sensor: str, drops: DropLog, span_ns: tuple[int, int] | None = None
) -> Rows:
    """Rows in ascending time whose values every reading class accepts.

    Parameters
    ----------
    rows
        As read, in file order.
    layout
        Columns with their limits.
    span_ns
        First and last stamp of the IMU; rows more than 10 s outside belong to another clock.  None: do not compare.

    Raises
    ------
    FlightError
        The clock starts again inside the file: its two parts overlap and cannot be put in order.
    """
    sieve = Sieve(rows, sensor, drops)
    if len(rows.t_ns):
        _check_values(sieve, layout)
        _check_pairs(sieve)
        _check_duplicates(sieve)
        _check_clock(sieve, span_ns)
        _sort(sieve)
    return sieve.rows


def _check_values(sieve: Sieve, layout: Layout) -> None:
    for column in layout:
        array = sieve.rows.values.get(column)
        if array is None:
            continue
        if column.text:
            sieve.refuse(array == "", f"{column.name} is empty")
            continue
        if column.required:
            sieve.refuse(np.isnan(array), f"{column.name} is empty or NaN")
            array = sieve.rows.values[column]
        outside = (array < column.low) | (array > column.high)
        sieve.refuse(outside, f"{column.name} outside {_limits(column)}")


def _limits(column: Column) -> str:
    unit = f" {column.unit}" if column.unit else ""
    if column.high >= 1e300:
        return f"the positive finite numbers{unit}" if column.low > 0.0 else f"the finite numbers{unit}"
    return f"{column.low:g}..{column.high:g}{unit}"


def _check_pairs(sieve: Sieve) -> None:
    """Rules over several columns: two different anchors, unit quaternions, sigmas on all axes or none."""
    by_target: dict[str, list[NDArray[Any]]] = {}
    for column, array in sieve.rows.values.items():
        by_target.setdefault(column.target, []).append(array)
    if "anchor_a" in by_target:
        sieve.refuse(by_target["anchor_a"][0] == by_target["anchor_b"][0], "anchor_a and anchor_b are the same")
    if "quaternion_WB" in by_target:
        norm = np.sqrt(sum(q * q for q in by_target["quaternion_WB"]))
        sieve.refuse(np.abs(norm - 1.0) > QUATERNION_TOLERANCE, f"quaternion not of length 1 +- {QUATERNION_TOLERANCE}")
    for target, arrays in by_target.items():
        if len(arrays) > 1 and arrays[0].dtype.kind == "f":
            absent = sum(np.isnan(array).astype(np.int64) for array in arrays)
            if np.shape(absent) == sieve.rows.t_ns.shape:
                sieve.refuse((absent > 0) & (absent < len(arrays)), f"{target} is incomplete")


def _check_duplicates(sieve: Sieve) -> None:
    """One row per stamp; UWB has one per stamp and anchors.  The first in the file counts."""
    rows = sieve.rows
    if len(rows.t_ns) < 2 or np.diff(rows.t_ns).min() > 0:
        return
    keys = [
        np.unique(array, return_inverse=True)[1]
        for column, array in rows.values.items()
        if column.target[:6] == "anchor"
    ]
    order = np.lexsort((*keys, rows.t_ns))
    same = np.ones(max(len(order) - 1, 0), dtype=np.bool_)
    for key in (rows.t_ns, *keys):
        same &= np.diff(key[order]) == 0
    if not same.any():
        return
    repeated = np.concatenate(([False], same))
    first = np.maximum.accumulate(np.where(repeated, 0, np.arange(len(order))))
    equal = np.ones(len(order), dtype=np.bool_)
    for array in rows.values.values():
        here, there = array[order], array[order[first]]
        equal &= (here == there) | ((here != here) & (there != there))
    identical = np.zeros(len(order), dtype=np.bool_)
    identical[order] = repeated & equal
    conflicting = np.zeros(len(order), dtype=np.bool_)
    conflicting[order] = repeated & ~equal
    sieve.refuse(identical, "duplicate row")
    sieve.refuse(conflicting[~identical], "other values for a stamp already read")


def _check_clock(sieve: Sieve, span_ns: tuple[int, int] | None) -> None:
    t_ns = sieve.rows.t_ns
    steps = np.diff(t_ns)
    if len(steps) and (steps.min() < 0 or steps.max() > JUMP_NS):
        sieve.refuse(_glitches(t_ns), "clock jump: the stamp leaves its neighbours by more than 1 s and returns")
        _refuse_restart(sieve)
        sieve.refuse(_islands(sieve.rows.t_ns), "clock jump: the stamp is far from the rest of the file")
    if span_ns is not None and len(sieve.rows.t_ns):
        t_ns = sieve.rows.t_ns
        outside = (t_ns < span_ns[0] - FAR_NS) | (t_ns > span_ns[1] + FAR_NS)
        sieve.refuse(outside, "stamp more than 10 s outside the IMU's time: another clock?")


def _runs(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Borders (first rows, and the end) of the stretches in file order without a step beyond 1 s."""
    cuts = np.flatnonzero(np.abs(np.diff(t_ns)) > JUMP_NS) + 1
    return np.concatenate(([0], cuts, [len(t_ns)]))


def _glitches(t_ns: NDArray[np.int64]) -> Mask:
    """Up to three rows that lie elsewhere in time while the rows around them follow each other closely."""
    bad = np.zeros(len(t_ns), dtype=np.bool_)
    if np.count_nonzero(np.diff(t_ns) < 0) > 0.05 * len(t_ns):
        return bad  # a shuffled file: neighbours say nothing
    borders = _runs(t_ns)
    for start, end in pairwise(borders[1:-1]):
        if end - start <= 3 and 0 <= t_ns[end] - t_ns[start - 1] <= JUMP_NS:
            bad[start:end] = True
    return bad


def _refuse_restart(sieve: Sieve) -> None:
    """Raise when long stretches of the file overlap in time, as after a restart of the clock."""
    t_ns = sieve.rows.t_ns
    borders = _runs(t_ns)
    if np.count_nonzero(np.diff(t_ns) < -JUMP_NS) > 5:
        return
    stretches = [(a, b) for a, b in pairwise(borders) if b - a >= 10]
    for (a, b), (c, d) in pairwise(stretches):
        overlap_ns = min(t_ns[a:b].max(), t_ns[c:d].max()) - max(t_ns[a:b].min(), t_ns[c:d].min())
        if overlap_ns > JUMP_NS:
            raise FlightError(
                f"{sieve.rows.where}: the clock starts again at {sieve.rows.example(int(c)).partition(':')[0]}: "
                f"{(t_ns[b - 1] - t_ns[c]) / 1e9:.1f} s back, and {overlap_ns / 1e9:.1f} s are covered twice "
                f"(limit 1 s); split the recording there"
            )


def _islands(t_ns: NDArray[np.int64]) -> Mask:
    """Small groups of rows far from the main body: over 10 s away and under 1 % of it, or over an hour away."""
    order = np.argsort(t_ns, kind="stable")
    gaps = np.diff(t_ns[order])
    cuts = np.flatnonzero(gaps > FAR_NS)
    bad = np.zeros(len(t_ns), dtype=np.bool_)
    if not len(cuts):
        return bad
    borders = np.concatenate(([0], cuts + 1, [len(t_ns)]))
    sizes = np.diff(borders)
    main = int(sizes.argmax())
    for group, size in enumerate(sizes):
        if group != main:
            away_ns = int(gaps[cuts[min(group, main) : max(group, main)]].max())
            if away_ns > HOUR_NS or size < 0.01 * sizes[main]:
                bad[order[borders[group] : borders[group + 1]]] = True
    return bad


def _sort(sieve: Sieve) -> None:
    t_ns = sieve.rows.t_ns
    if len(t_ns) > 1 and np.diff(t_ns).min() < 0:
        late = t_ns < np.maximum.accumulate(t_ns)
        sieve.note(late, "out of time order: sorted, kept")
        sieve.rows = sieve.rows.subset(np.argsort(t_ns, kind="stable"))
