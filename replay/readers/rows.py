"""Which rows of a file can be used: values, duplicates, clock, order.  What cannot is left out, counted and named."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.readers.clock import check_clock
from axialnav.replay.readers.columns import Column, Layout
from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.sieve import Sieve

QUATERNION_TOLERANCE = 0.01


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
        check_clock(sieve, span_ns)
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


def _sort(sieve: Sieve) -> None:
    t_ns = sieve.rows.t_ns
    if len(t_ns) > 1 and np.diff(t_ns).min() < 0:
        late = t_ns < np.maximum.accumulate(t_ns)
        sieve.note(late, "out of time order: sorted, kept")
        sieve.rows = sieve.rows.subset(np.argsort(t_ns, kind="stable"))
