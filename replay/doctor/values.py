"""Values that cannot be what they claim: wrong units, clipped or frozen readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import Imu, RangeFinder, Uwb
from axialnav.replay.doctor.symptom import Gravity, Symptom
from axialnav.replay.flight import Flight, SensorTable

Array = NDArray[np.float64]
FORCE_M_S2 = (5.0, 16.0)  # median specific force of anything that flies or stands
FAST_TURN_RAD_S = 35.0  # 2000 deg/s, the range of most gyroscopes
FORCE_UNITS = {9.80665: "g", 9.80665e-3: "mg", 0.01: "cm/s^2"}
LENGTH_UNITS = {1e-3: "millimetres", 1e-2: "centimetres"}
FAR_M = 200.0  # no indoor UWB reaches farther
MIN_CLIPPED = 3  # equal extreme values in a row
FROZEN_ROWS = 5
FROZEN_RANGE_S = 2.0


def units(flight: Flight) -> Iterator[Symptom]:
    """Readings whose size betrays another unit."""
    for name, table in flight.tables.items():
        spec = flight.config.sensor.get(name)
        if len(table) < 2:
            continue
        if isinstance(spec, Imu):
            yield from _inertial_units(name, table)
        elif isinstance(spec, RangeFinder):
            yield from _length_unit(name, table.columns["range_m"], spec.range_max_m)
        elif isinstance(spec, Uwb) and spec.measurement == "range":
            yield from _length_unit(name, table.columns["range_m"], FAR_M)
        elif isinstance(spec, Uwb) and spec.measurement == "tdoa" and spec.anchors:
            yield from _length_unit(name, np.abs(table.columns["difference_m"]), _longest_baseline_m(spec))


def _longest_baseline_m(spec: Uwb) -> float:
    anchors = np.array(list(spec.anchors.values()))
    return 2.0 * float(np.linalg.norm(anchors[:, None] - anchors[None], axis=2).max()) + 1.0


def _inertial_units(name: str, table: SensorTable) -> Iterator[Symptom]:
    force = float(np.median(np.linalg.norm(table.columns["accel_m_s2"], axis=1)))
    low, high = FORCE_M_S2
    if not low <= force <= high:
        guess = next((unit for size, unit in FORCE_UNITS.items() if low <= force * size <= high), None)
        yield Symptom(
            Gravity.FIX,
            name,
            f"median specific force {force:.3g} where {low:g}..{high:g} m/s^2 is expected",
            f"it looks like {guess}: convert it to m/s^2" if guess else "find out unit and scale of the accelerometer",
        )
    turn = float(np.quantile(np.abs(table.columns["gyro_rad_s"]), 0.99))
    if turn > FAST_TURN_RAD_S:
        yield Symptom(
            Gravity.FIX,
            name,
            f"1 % of the rates are above {turn:.3g}, limit {FAST_TURN_RAD_S:g} rad/s (2000 deg/s)",
            "they look like degrees per second: convert them to rad/s",
        )


def _length_unit(name: str, values: NDArray[np.generic], longest_m: float) -> Iterator[Symptom]:
    known = np.asarray(values, dtype=np.float64)
    known = known[np.isfinite(known)]
    if known.size == 0:
        return
    middle = float(np.median(known))
    if middle <= longest_m:
        return
    guess = " or ".join(unit for size, unit in LENGTH_UNITS.items() if middle * size <= longest_m)
    yield Symptom(
        Gravity.FIX,
        name,
        f"median length {middle:.4g} m, but {longest_m:.4g} m is the most that can be",
        f"it looks like {guess}: convert it to metres" if guess else "find out the unit of its lengths",
    )


def clipped(flight: Flight) -> Iterator[Symptom]:
    """Inertial axes that stay at their extreme value."""
    for name, table in flight.tables.items():
        if not isinstance(flight.config.sensor.get(name), Imu) or len(table) < MIN_CLIPPED:
            continue
        for column, unit in (("accel_m_s2", "m/s^2"), ("gyro_rad_s", "rad/s")):
            size = np.abs(table.columns[column])
            for axis, letter in enumerate("xyz"):
                limit = float(size[:, axis].max())
                count = _longest_run(size[:, axis] == limit)
                if limit > 0.0 and count >= MIN_CLIPPED:
                    where = f"{column.split('_')[0]} {letter}"
                    yield Symptom(
                        Gravity.FIX,
                        name,
                        f"{where} stays at its extreme of {limit:.4g} {unit} for {count} samples",
                        "the sensor is saturated: set a larger range or damp the mounting",
                    )


def frozen(flight: Flight) -> Iterator[Symptom]:
    """Sensors that repeat one value as no living sensor does."""
    for name, table in flight.tables.items():
        spec = flight.config.sensor.get(name)
        if len(table) <= FROZEN_ROWS:
            continue
        if isinstance(spec, Imu):
            values = np.hstack([table.columns["gyro_rad_s"], table.columns["accel_m_s2"]])
        elif isinstance(spec, Uwb) and spec.measurement == "position":
            values = np.asarray(table.columns["position_m"])
        elif isinstance(spec, RangeFinder):
            values = np.asarray(table.columns["range_m"])[:, None]
        else:
            continue
        same = (np.diff(values, axis=0) == 0.0).all(axis=1)
        start, count = _longest(same)
        lasts_s = float(table.t_ns[start + count] - table.t_ns[start]) * 1e-9
        # a range finder counts millimetres: in front of a wall equal values are no wonder
        if count >= FROZEN_ROWS and (not isinstance(spec, RangeFinder) or lasts_s > FROZEN_RANGE_S):
            yield Symptom(
                Gravity.FIX,
                name,
                f"{count + 1} equal readings in a row, {lasts_s:.2f} s long",
                "the driver repeats its last value: make it send nothing when there is nothing new",
            )


def _longest(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    if edges.size == 0:
        return 0, 0
    lengths = edges[1::2] - edges[::2]
    best = int(np.argmax(lengths))
    return int(edges[2 * best]), int(lengths[best])


def _longest_run(flags: NDArray[np.bool_]) -> int:
    return _longest(flags)[1]
