"""Flights changed after the fact: reflections added, readings late, the camera's turning left in its readings."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import BlurMeter, Flow, Imu, Uwb
from axialnav.replay.flight import Flight, SensorTable

LATE_S = 0.1


def with_tables(flight: Flight, tables: Mapping[str, SensorTable]) -> Flight:
    """The flight with some tables replaced."""
    return dataclasses.replace(flight, tables={**flight.tables, **tables})


def reflected(flight: Flight, sensor: str, longer_m: Mapping[int, float], start_s: float, end_s: float) -> Flight:
    """Ranges to the anchors (by number) longer by so much between two instants after the first inertial sample."""
    table = flight.tables[sensor]
    t = (table.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9
    ranges, during = table.columns["range_m"].copy(), (t >= start_s) & (t < end_s)
    for anchor, metres in longer_m.items():
        ranges[during & (table.columns["anchor"] == anchor)] += metres
    return with_tables(flight, {sensor: dataclasses.replace(table, columns={**table.columns, "range_m": ranges})})


def late(flight: Flight) -> Flight:
    """Image motion and UWB a tenth of a second late and stamped on arrival."""
    behind = {
        name: dataclasses.replace(table, t_ns=table.t_ns + round(LATE_S * 1e9))
        for name, table in flight.tables.items()
        if isinstance(flight.config.sensor[name], Flow | BlurMeter | Uwb)
    }
    return with_tables(flight, behind)


def turning(flight: Flight) -> Flight:
    """Image motion as a filter sees it that does not know that a turning camera sees the wall move."""
    flows = {name: spec for name, spec in flight.config.sensor.items() if isinstance(spec, Flow | BlurMeter)}
    return with_tables(flight, {name: _with_turn(flight, name, spec) for name, spec in flows.items()})


def _with_turn(flight: Flight, name: str, spec: Flow | BlurMeter) -> SensorTable:
    table = flight.tables[name]
    window_s = table.columns["window_s"]
    rate = _mean_rate(flight, table.t_ns, window_s)
    columns = dict(table.columns)
    for axis, (column, sense) in enumerate((("dx_px", 1.0), ("dy_px", -1.0))):
        if column in columns:
            about = np.array(spec.rotation_BS)[:, 1 - axis]
            columns[column] = columns[column] - sense * spec.focal_px[axis] * window_s * (rate @ about)
    return dataclasses.replace(table, columns=columns)


def _mean_rate(flight: Flight, t_ns: NDArray[np.int64], window_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean rate in body axes over windows around ``t_ns``, shape (n, 3) [rad/s]."""
    name, spec = next((name, spec) for name, spec in flight.config.sensor.items() if isinstance(spec, Imu))
    imu = flight.tables[name]
    t = (imu.t_ns - imu.t_ns[0]) * 1e-9
    gyro = imu.columns["gyro_rad_s"] @ np.array(spec.rotation_BS).T
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (gyro[1:] + gyro[:-1]) * np.diff(t)[:, None], axis=0)])
    at = (t_ns - imu.t_ns[0]) * 1e-9
    turned = [[np.interp(at + half * window_s, t, angle[:, i]) for i in range(3)] for half in (-0.5, 0.5)]
    mean: NDArray[np.float64] = ((np.array(turned[1]) - np.array(turned[0])) / window_s).T
    return mean
