"""Run against run: the largest difference of every channel, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.fused import Column
from axialnav.replay.reference import interpolate
from axialnav.replay.run_reader import StoredRun

Array = NDArray[np.float64]
MAX_GAP_NS = 100_000_000
QUATERNION = ("q_w", "q_x", "q_y", "q_z")
NOT_CHANNELS = ("t_ns", "flags", *QUATERNION)


@dataclass(frozen=True, slots=True)
class Difference:
    """How one channel differs between two runs.

    Attributes
    ----------
    channel
        Column of ``fused.csv``, ``attitude_rad`` (angle between the attitudes) or ``flags``.
    largest
        Largest size of the difference, in the channel's unit (flags: share of rows that differ).
    at_s
        When that was, seconds after the first common row; None where nothing differs.
    rms
        Root mean square of the difference.
    in_sigma
        Largest difference in sigmas that the first run states; None where it states none.
    """

    channel: str
    largest: float
    at_s: float | None
    rms: float
    in_sigma: float | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two runs side by side: ``compared`` rows of ``rows`` (first run) have a partner in the second."""

    first: str
    second: str
    identical: bool
    rows: int
    compared: int
    exact_stamps: bool
    differences: tuple[Difference, ...]

    def beyond(self, tolerance: float) -> tuple[Difference, ...]:
        """Channels whose largest difference is over ``tolerance`` (each in its own unit)."""
        return tuple(d for d in self.differences if not d.largest <= tolerance)


def compare_runs(first: StoredRun, second: StoredRun) -> Comparison:
    """Compare the second run with the first, at the stamps of the first.

    Stamps that the second run lacks are interpolated (never across more than 0.1 s) or left out; a row that is a number
    in one run and none in the other differs by infinity.
    """
    t_ns = first.columns["t_ns"]
    identical = first.digest == second.digest and list(first.columns) == list(second.columns)
    other, found = _at_stamps(t_ns, second.columns)
    exact = bool(np.isin(t_ns, second.columns["t_ns"]).all()) and t_ns.size == second.columns["t_ns"].size
    differences = () if identical else tuple(_differences(first.columns, other, found))
    compared = int(found.sum())
    return Comparison(first.name, second.name, identical, int(t_ns.size), compared, exact, differences)


def _at_stamps(t_ns: NDArray[np.int64], columns: dict[str, Column]) -> tuple[dict[str, Column], NDArray[np.bool_]]:
    """Columns of another run at the stamps of this one, and which rows have a partner."""
    source = columns["t_ns"]
    if source.size == t_ns.size and np.array_equal(source, t_ns):
        return columns, np.ones(t_ns.size, dtype=bool)
    right = np.clip(np.searchsorted(source, t_ns), 0, source.size - 1)
    left = np.clip(right - 1, 0, source.size - 1)
    exact = source[right] == t_ns
    inside = (t_ns >= source[0]) & (t_ns <= source[-1]) & (source[right] - source[left] <= MAX_GAP_NS)
    floats = [name for name, values in columns.items() if values.dtype.kind == "f"]
    values = interpolate(t_ns, source, np.stack([columns[name] for name in floats], axis=1), MAX_GAP_NS)
    other: dict[str, Column] = {name: values[:, i] for i, name in enumerate(floats)}
    if "flags" in columns:
        other["flags"] = columns["flags"][np.where(exact, right, left)]
    return other, exact | inside


def _differences(first: dict[str, Column], other: dict[str, Column], found: NDArray[np.bool_]) -> Sequence[Difference]:
    if not found.any():
        return ()
    seconds = (first["t_ns"][found] - first["t_ns"][found][0]) * 1e-9
    result = []
    for name in first:
        if name not in NOT_CHANNELS and name in other:
            gap = _gap(first[name][found], other[name][found])
            sigma = first.get(_sigma_name(name))
            result.append(_difference(name, gap, seconds, None if sigma is None else sigma[found]))
    if all(name in first and name in other for name in QUATERNION):
        result.append(_difference("attitude_rad", _angle(first, other, found), seconds, None))
    if "flags" in first and "flags" in other:
        unequal = (first["flags"][found] != other["flags"][found]).astype(np.float64)
        when = float(seconds[int(np.argmax(unequal))]) if unequal.any() else None
        result.append(Difference("flags", float(unequal.mean()), when, float(unequal.mean()), None))
    return result


def _gap(one: Array, two: Array) -> Array:
    """Size of the difference; 0 where both are NaN, infinity where one is."""
    with np.errstate(invalid="ignore"):
        gap: Array = np.abs(one - two)
    gap[(one == two) | (np.isnan(one) & np.isnan(two))] = 0.0
    gap[np.isnan(gap)] = np.inf
    return gap


def _angle(first: dict[str, Column], other: dict[str, Column], found: NDArray[np.bool_]) -> Array:
    """Angle between the attitudes [rad]; q and -q are the same attitude."""
    one = np.stack([first[name][found] for name in QUATERNION], axis=1)
    two = np.stack([other[name][found] for name in QUATERNION], axis=1)
    shorter = np.minimum(np.linalg.norm(one - two, axis=1), np.linalg.norm(one + two, axis=1))
    return _gap(4.0 * np.arcsin(np.clip(0.5 * shorter, 0.0, 1.0)), np.zeros(len(one)))


def _difference(name: str, gap: Array, seconds: Array, sigma: Array | None) -> Difference:
    worst = int(np.argmax(gap))
    largest = float(gap[worst])
    in_sigma = None
    if sigma is not None:
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(gap == 0.0, 0.0, gap / sigma)
        in_sigma = float(np.nanmax(ratio)) if np.isfinite(ratio).any() else None
    rms = float(np.sqrt(np.mean(gap**2)))
    return Difference(name, largest, float(seconds[worst]) if largest > 0.0 else None, rms, in_sigma)


def _sigma_name(channel: str) -> str:
    return f"sigma_{channel}"
