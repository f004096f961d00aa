"""Tables back to typed readings, in the order in which a vehicle would have pushed them."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Iterator
from typing import Any

import numpy as np

from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    Height,
    ImuSample,
    PixelMotion,
    Reading,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from axialnav.fusion.sources import fused_sensors
from axialnav.models.rig import AnySensor, AttitudeSource, Barometer, BlurMeter, Camera, Flow, Imu, RangeFinder, Uwb
from axialnav.replay.flight import ANCHOR_FIELDS, Flight, SensorTable, Stamps


def merge_readings(flight: Flight) -> Iterator[Reading]:
    """All fusable readings of a flight in time order; ties in the order in which the filter takes them."""
    return _merged(flight, fused_sensors(flight.config))


def all_readings(flight: Flight, without: Container[str] = ()) -> Iterator[Reading]:
    """Readings of every sensor of a flight, fused or not, in time order.

    Parameters
    ----------
    without
        Names of sensors to leave out.
    """
    first = fused_sensors(flight.config)
    names = [*first, *(name for name in flight.config.sensor if name not in first)]
    return _merged(flight, [name for name in names if name not in without])


def _merged(flight: Flight, names: Iterable[str]) -> Iterator[Reading]:
    makers: list[Callable[[int], Reading]] = []
    stamps: list[Stamps] = []
    for name in names:
        kind = reading_class(flight.config.sensor[name])
        if kind is not None and name in flight.tables:
            makers.append(_maker(kind, name, flight.tables[name]))
            stamps.append(flight.tables[name].t_ns)
        elif isinstance(flight.config.sensor[name], Camera) and name in flight.tables:
            table = flight.tables[name]
            makers.append(_maker(PixelMotion, name, table) if table.is_motion else _frame_maker(flight, name))
            stamps.append(flight.tables[name].t_ns)
    if not stamps:
        return
    source = np.repeat(np.arange(len(stamps)), [len(t) for t in stamps])
    row = np.concatenate([np.arange(len(t)) for t in stamps])
    order = np.lexsort((row, source, np.concatenate(stamps)))
    for which, index in zip(source[order].tolist(), row[order].tolist(), strict=True):
        yield makers[which](index)


def reading_class(spec: AnySensor) -> type[Reading] | None:
    """Reading class of a sensor; None for camera frames and for what is not fused (GPS)."""
    if isinstance(spec, Uwb):
        by_measurement: dict[str, type[Reading]] = {"range": UwbRange, "tdoa": UwbTdoa, "position": UwbFix}
        return by_measurement[spec.measurement]
    if isinstance(spec, BlurMeter):
        return PixelMotion if spec.signed else BlurLength
    kinds: dict[type, type[Reading]] = {
        Imu: ImuSample,
        Flow: PixelMotion,
        RangeFinder: WallRange,
        Barometer: Height,
        AttitudeSource: Attitude,
    }
    return kinds.get(type(spec))


def _maker(kind: type[Reading], sensor: str, table: SensorTable) -> Callable[[int], Reading]:
    """Function that builds the reading of a row."""
    t_ns = table.t_ns.tolist()
    columns = {name: [_plain(value) for value in array.tolist()] for name, array in table.columns.items()}
    columns |= {name: table.anchor_names(name) for name in ANCHOR_FIELDS if name in columns}

    def make(row: int) -> Reading:
        """Reading of a row."""
        fields: dict[str, Any] = {name: values[row] for name, values in columns.items()}
        return kind(t_ns=t_ns[row], sensor=sensor, **fields)

    return make


def _frame_maker(flight: Flight, camera: str) -> Callable[[int], Reading]:
    """Function that gives the next frame; rows of one sensor are asked for in order."""
    from axialnav.replay.frames import camera_frames

    frames = camera_frames(flight, camera)
    return lambda _: next(frames)


def _plain(value: Any) -> Any:
    """NaN to None, vectors to tuples (None for a vector of NaN)."""
    if isinstance(value, list):
        return None if any(math.isnan(part) for part in value) else tuple(value)
    return None if isinstance(value, float) and math.isnan(value) else value
