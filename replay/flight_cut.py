"""A stretch of a flight as a flight of its own; stamps stay what they were."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

import msgspec
import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.replay.flight import Flight, GpsReference, SensorTable, Stamps, Truth

T = TypeVar("T", Truth, GpsReference)


def cut_flight(flight: Flight, start_s: float, end_s: float, *, name: str | None = None) -> Flight:
    """Keep what lies between two times after the first IMU sample.

    The scoring window moves with the beginning.  ``[initial]`` belongs to the old beginning and is dropped unless the
    cut keeps it.

    Parameters
    ----------
    start_s, end_s
        Limits [s], both included.
    name
        Name of the new flight; the old one if None.

    Raises
    ------
    FlightError
        No IMU sample lies between the limits.
    """
    imu = next((table for sensor, table in flight.tables.items() if sensor.startswith("imu") and len(table)), None)
    zero_ns = int(imu.t_ns[0]) if imu is not None else 0
    low, high = zero_ns + round(start_s * 1e9), zero_ns + round(end_s * 1e9)
    if imu is None or not np.any((imu.t_ns >= low) & (imu.t_ns <= high)):
        raise FlightError(f"{flight.name}: no IMU sample from {start_s:g} s to {end_s:g} s; choose other limits")
    shift_s = (int(imu.t_ns[np.searchsorted(imu.t_ns, low)]) - zero_ns) / 1e9
    keeps_start = shift_s == 0.0
    return dataclasses.replace(
        flight,
        name=name or flight.name,
        config=flight.config if keeps_start else _without_initial(flight),
        tables={sensor: _cut_table(table, low, high) for sensor, table in flight.tables.items()},
        truth=None if flight.truth is None else _cut_reference(flight.truth, low, high),
        gps=None if flight.gps is None else _cut_reference(flight.gps, low, high),
        evaluation=_shifted(flight.evaluation, shift_s, end_s - shift_s),
    )


def _without_initial(flight: Flight) -> Config:
    return msgspec.structs.replace(flight.config, initial=None)


def _shifted(
    window: tuple[float | None, float | None], shift_s: float, length_s: float
) -> tuple[float | None, float | None]:
    start_s, end_s = window
    start = None if start_s is None else max(start_s - shift_s, 0.0)
    end = None if end_s is None else min(end_s - shift_s, length_s)
    if start is not None and end is not None and start >= end:
        return None, None
    return start, end


def _cut_table(table: SensorTable, low: int, high: int) -> SensorTable:
    first, last = _rows(table.t_ns, low, high)
    columns = {name: array[first:last] for name, array in table.columns.items()}
    unlisted = {row - first: names for row, names in table.unlisted.items() if first <= row < last}
    return SensorTable(table.t_ns[first:last], columns, table.anchors, unlisted)


def _cut_reference(reference: T, low: int, high: int) -> T:
    first, last = _rows(reference.t_ns, low, high)
    arrays = {field.name: getattr(reference, field.name) for field in dataclasses.fields(reference)}
    cut: dict[str, Any] = {name: None if array is None else array[first:last] for name, array in arrays.items()}
    return type(reference)(**cut)


def _rows(t_ns: Stamps, low: int, high: int) -> tuple[int, int]:
    return int(np.searchsorted(t_ns, low)), int(np.searchsorted(t_ns, high, side="right"))
