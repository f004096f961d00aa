"""One reading as a row of numbers, in the layout of :mod:`axialnav.fusion.events`."""

from __future__ import annotations

from math import nan

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ReadingError
from axialnav.fusion.events import WIDTH
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
from axialnav.fusion.sources import Kind, fused_sensors, kind_of
from axialnav.models.rig import Uwb

KIND_OF_READING: dict[type[Reading], Kind] = {
    ImuSample: Kind.IMU,
    PixelMotion: Kind.FLOW,
    BlurLength: Kind.BLUR,
    WallRange: Kind.RANGE,
    UwbRange: Kind.UWB_RANGE,
    UwbTdoa: Kind.UWB_TDOA,
    UwbFix: Kind.UWB_POSITION,
    Height: Kind.HEIGHT,
    Attitude: Kind.ATTITUDE,
}


_NOT_GIVEN = (nan,) * WIDTH


class Packer:
    """Turns typed readings of the configured sensors into event rows."""

    def __init__(self, config: Config) -> None:
        names = fused_sensors(config)
        self._sources = {name: index for index, name in enumerate(names)}
        self._kinds = {name: kind_of(config.sensor[name]) for name in names}
        self._anchors: dict[str, dict[str, int]] = {}
        for name in names:
            spec = config.sensor[name]
            if isinstance(spec, Uwb):
                self._anchors[name] = {anchor: index for index, anchor in enumerate(spec.anchors)}

    def pack(self, reading: Reading) -> tuple[int, NDArray[np.float64]]:
        """Source index and values (8,) of a reading.

        Raises
        ------
        ReadingError
            The sensor is not configured, or it is not one that gives such readings.
        """
        name = reading.sensor
        if name not in self._sources:
            raise ReadingError(
                f"no sensor named {name!r} is configured; there are {', '.join(self._sources) or 'none'}; "
                f"describe it as [sensor.{name}]"
            )
        kind = KIND_OF_READING.get(type(reading))
        if kind is not self._kinds[name]:
            expected = self._kinds[name]
            raise ReadingError(
                f"{type(reading).__name__} from {name}, which is configured as a source of "
                f"{expected.name if expected is not None else 'nothing'}; send it under another sensor name"
            )
        values = self._values(reading)
        return self._sources[name], np.array(values + _NOT_GIVEN[len(values) :])

    def _values(self, reading: Reading) -> tuple[float, ...]:
        match reading:
            case ImuSample(gyro_rad_s=gyro, accel_m_s2=accel):
                return (*gyro, *accel)
            case UwbTdoa(anchor_a=a, anchor_b=b, difference_m=difference, sigma_m=sigma):
                index = self._anchors[reading.sensor]
                return (index.get(a, -1), index.get(b, -1), difference, _or_nan(sigma))
            case UwbRange(anchor=anchor, range_m=range_m, sigma_m=sigma):
                number = self._anchors[reading.sensor].get(anchor, -1)
                powers = _or_nan(reading.rssi_dbm), _or_nan(reading.first_path_dbm)
                return (number, range_m, _or_nan(sigma), *powers)
            case PixelMotion(window_s=window, dx_px=dx, dy_px=dy):
                return (window, dx, _or_nan(dy), _or_nan(reading.sigma_px), _or_nan(reading.quality))
            case WallRange(range_m=range_m, sigma_m=sigma):
                return (range_m, _or_nan(sigma))
            case BlurLength(window_s=window, length_px=length, sigma_px=sigma):
                return (window, length, sigma)
            case UwbFix(position_m=position, sigma_m=sigmas):
                return (*position, *(sigmas or (nan, nan, nan)))
            case Height(height_m=height, sigma_m=sigma):
                return (height, _or_nan(sigma))
            case Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, sigma_rad=sigma):
                return (roll, pitch, yaw, _or_nan(sigma))
            case _:
                raise ReadingError(f"{type(reading).__name__} is not a reading that the filter takes")


def _or_nan(value: float | None) -> float:
    return nan if value is None else value
