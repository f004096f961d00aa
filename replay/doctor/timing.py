"""Clocks, gaps and repeated stamps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import Imu
from axialnav.replay.doctor.symptom import Gravity, Symptom
from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.rates import SensorRate, sensor_rates

Rows = NDArray[np.int64]
MAX_IMU_GAP_S = 0.1  # beyond it the filter no longer trusts the samples at the two ends
LONG_GAP_S = 1.0
MIN_OVERLAP = 0.5
RATE_TOLERANCE = 0.2
UNITS = {1e3: "microseconds", 1e6: "milliseconds", 1e9: "seconds"}  # stamps that claim to be nanoseconds
UNIT_TOLERANCE = 0.2


def the_imu(flight: Flight) -> SensorTable | None:
    """Readings of the flight's inertial unit, None where there is none or it never spoke."""
    for name, spec in flight.config.sensor.items():
        if isinstance(spec, Imu) and len(flight.tables.get(name, ())) > 1:
            return flight.tables[name]
    return None


def clocks(flight: Flight) -> Iterator[Symptom]:
    """Sensors whose stamps cannot be of the inertial unit's clock."""
    imu = the_imu(flight)
    if imu is None:
        return
    begin, end = int(imu.t_ns[0]), int(imu.t_ns[-1])
    for name, table in flight.tables.items():
        if len(table) < 2 or table is imu:
            continue
        first, last = int(table.t_ns[0]), int(table.t_ns[-1])
        inside = float(np.mean((table.t_ns >= begin) & (table.t_ns <= end)))
        if inside >= MIN_OVERLAP:
            continue
        unit = _unit_of(last - first, end - begin)
        what = f"{100 * inside:.0f} % of its stamps lie within the inertial unit's (limit {100 * MIN_OVERLAP:.0f} %)"
        if unit:
            yield Symptom(Gravity.FIX, name, f"{what}; its stamps look like {unit}", f"write {unit} as nanoseconds")
        else:
            away_s = (first - begin) * 1e-9
            side = "after" if away_s > 0 else "before"
            yield Symptom(
                Gravity.FIX,
                name,
                f"{what}; it begins {abs(away_s):.1f} s {side} the inertial unit: another clock",
                "shift its stamps to the inertial unit's clock",
            )


def _unit_of(span: int, imu_span: int) -> str | None:
    for factor, unit in UNITS.items():
        if span > 0 and abs(span * factor / imu_span - 1.0) < UNIT_TOLERANCE:
            return unit
    return None


def gaps(flight: Flight) -> Iterator[Symptom]:
    """Silences: of the inertial unit beyond what can be bridged, of others beyond a second."""
    imu = the_imu(flight)
    first_ns = int(imu.t_ns[0]) if imu is not None else 0
    for rate in sensor_rates(flight, first_ns):
        if imu is not None and flight.tables[rate.name] is imu:
            steps_s = np.diff(imu.t_ns) * 1e-9
            count = int((steps_s > MAX_IMU_GAP_S).sum())
            if count:
                yield Symptom(
                    Gravity.FIX,
                    rate.name,
                    f"{_times(count)} of more than {MAX_IMU_GAP_S:g} s, {_longest(rate)}",
                    "find out why the logger lost samples; the filter widens its sigma over each gap",
                )
        elif rate.longest_s > LONG_GAP_S and rate.gaps:
            yield Symptom(
                Gravity.LOOK,
                rate.name,
                f"{_times(rate.gaps)}, {_longest(rate)}",
                "nothing, if the sensor was out of reach there; otherwise look at its cable and its driver",
            )


def _times(count: int) -> str:
    return "1 gap" if count == 1 else f"{count} gaps"


def _longest(rate: SensorRate) -> str:
    return f"the longest {rate.longest_s:.2f} s at {rate.longest_at_s:.1f} s"


def repeated_stamps(flight: Flight) -> Iterator[Symptom]:
    """Rows that come twice, and different rows with one stamp where a sensor cannot give two at a time."""
    for name, table in flight.tables.items():
        same_stamp = np.flatnonzero(np.diff(table.t_ns) == 0)
        if same_stamp.size == 0:
            continue
        alike = _alike(table, same_stamp)
        twice, differing = int(alike.sum()), int((~alike).sum())
        if twice:
            yield Symptom(
                Gravity.FIX,
                name,
                f"{twice} rows repeat the row before them",
                "delete the repeats: they count as independent readings",
            )
        if differing and isinstance(flight.config.sensor.get(name), Imu):
            yield Symptom(
                Gravity.FIX,
                name,
                f"{differing} samples share the stamp of another, with other values",
                "stamp samples when they are measured, not when a packet of them arrives",
            )


def _alike(table: SensorTable, rows: Rows) -> NDArray[np.bool_]:
    alike = np.ones(len(rows), dtype=bool)
    for column in table.columns.values():
        one, two = np.asarray(column)[rows], np.asarray(column)[rows + 1]
        same = one == two
        if np.issubdtype(one.dtype, np.floating):
            same |= np.isnan(one) & np.isnan(two)
        alike &= same.reshape(len(rows), -1).all(axis=1)
    return alike


def stated_rates(flight: Flight) -> Iterator[Symptom]:
    """Sensors that speak at another rate than their description says."""
    imu = the_imu(flight)
    for rate in sensor_rates(flight, int(imu.t_ns[0]) if imu is not None else 0):
        stated = getattr(flight.config.sensor.get(rate.name), "rate_hz", None)
        if stated and rate.rate_hz and abs(rate.rate_hz / stated - 1.0) > RATE_TOLERANCE:
            yield Symptom(
                Gravity.LOOK,
                rate.name,
                f"comes at {rate.rate_hz:.4g} Hz, its description says {stated:.4g} Hz",
                "correct rate_hz in its sensor.yaml, or find the readings that are missing",
            )
