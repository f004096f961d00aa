"""Rows of a file to the arrays that the filter reads: vectors stacked, anchors numbered, flow at mid-window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import (
    AnySensor,
    AttitudeSource,
    Barometer,
    BlurMeter,
    Camera,
    Flow,
    Gps,
    Imu,
    RangeFinder,
    Uwb,
)
from axialnav.replay.flight import GpsReference, SensorTable, Truth
from axialnav.replay.readers import columns as c
from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.sensor_yaml import anchor_name

Array = NDArray[np.float64]
_LAYOUTS: dict[type, c.Layout] = {
    Imu: c.IMU,
    Camera: c.CAMERA,
    Flow: c.FLOW,
    RangeFinder: c.RANGE,
    Barometer: c.HEIGHT,
    AttitudeSource: c.ATTITUDE,
    Gps: c.GPS,
}
_UWB_LAYOUTS = {"range": c.UWB_RANGE, "tdoa": c.UWB_TDOA, "position": c.UWB_POSITION}


def layout_of(spec: AnySensor) -> c.Layout:
    """Columns of the file of a sensor."""
    if isinstance(spec, Uwb):
        return _UWB_LAYOUTS[spec.measurement]
    if isinstance(spec, BlurMeter):
        return c.BLUR_SIGNED if spec.signed else c.BLUR
    return _LAYOUTS[type(spec)]


def half_window_ns(window_s: Array) -> NDArray[np.int64]:
    """Half of each window, rounded to nanoseconds: what lies between a flow chip's stamp and the window's middle."""
    return np.rint(window_s * 0.5e9).astype(np.int64)


def sensor_table(spec: AnySensor, rows: Rows, sensor: str, drops: DropLog) -> SensorTable:
    """Table of a sensor; an absent optional column is all NaN.  Rows with unlisted anchors are kept and noted."""
    t_ns = rows.t_ns
    stacked = stack(rows, layout_of(spec))
    if isinstance(spec, Flow):
        t_ns = t_ns - half_window_ns(stacked["window_s"])
        if len(t_ns) > 1 and np.diff(t_ns).min() < 0:  # windows of unequal length can change places
            order = np.argsort(t_ns, kind="stable")
            t_ns, stacked = t_ns[order], {name: array[order] for name, array in stacked.items()}
    if not isinstance(spec, Uwb):
        return SensorTable(t_ns, stacked)
    anchors = tuple(spec.anchors)
    names = {name: array for name, array in stacked.items() if name.startswith("anchor")}
    numbered = {name: _number(array, anchors) for name, array in names.items()}
    strange = np.zeros(len(t_ns), dtype=np.bool_)
    for index in numbered.values():
        strange |= index < 0
    unlisted = {
        row: tuple(anchor_name(str(a[row])) for a in names.values()) for row in np.flatnonzero(strange).tolist()
    }
    if unlisted:
        first = int(strange.argmax())
        drops.add(sensor, "anchor not in sensor.yaml: kept, cannot be fused", len(unlisted), rows.example(first))
    return SensorTable(t_ns, {**stacked, **numbered}, anchors, unlisted)


def stack(rows: Rows, layout: c.Layout) -> dict[str, NDArray[Any]]:
    """Arrays by target: (n,) for one column, (n, k) for k columns, NaN for columns that the file lacks."""
    n = len(rows.t_ns)
    parts: dict[str, list[NDArray[Any]]] = {}
    for column in layout:
        absent = np.zeros(n, dtype=np.str_) if column.text else np.full(n, np.nan)
        parts.setdefault(column.target, []).append(rows.values.get(column, absent))
    return {target: arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=1) for target, arrays in parts.items()}


def _number(names: NDArray[Any], anchors: tuple[str, ...]) -> NDArray[np.int64]:
    """Index of each name in ``anchors``, -1 for none."""
    places = {name: index for index, name in enumerate(anchors)}
    distinct, inverse = np.unique(names, return_inverse=True)
    index = np.array([places.get(anchor_name(str(name)), -1) for name in distinct], dtype=np.int64)
    return index[inverse]


def truth_of(rows: Rows, drops: DropLog, sensor: str) -> Truth | None:
    """Ground truth from its rows, None if there are none."""
    if not len(rows.t_ns):
        return None
    parts = stack(rows, c.TRUTH)
    if np.isnan(parts["velocity_m_s"]).all():
        drops.add(sensor, "no velocity columns: velocities cannot be scored", 1, "v_RS_R_x, v_RS_R_y, v_RS_R_z")
    biases = {name: None if np.isnan(parts[name]).all() else parts[name] for name in ("gyro_bias", "accel_bias")}
    return Truth(rows.t_ns, parts["position_m"], parts["quaternion_WB"], parts["velocity_m_s"], **biases)


def gps_of(rows: Rows) -> GpsReference | None:
    """GPS reference from its rows, None if there are none."""
    if not len(rows.t_ns):
        return None
    parts = stack(rows, c.GPS)
    return GpsReference(rows.t_ns, parts["position_m"], parts["velocity_m_s"])
