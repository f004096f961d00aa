"""One reading as a row of numbers, in the layout of :mod:`axialnav.fusion.events`."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ReadingError
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

Row = tuple[float, ...]


def _or_nan(value: float | None) -> float:
    return nan if value is None else value


def _imu(r: ImuSample) -> Row:
    return (*r.gyro_rad_s, *r.accel_m_s2, nan, nan)


def _pixel_motion(r: PixelMotion) -> Row:
    own = _or_nan(r.sigma_px), _or_nan(r.quality), _or_nan(r.sigma_dy_px), _or_nan(r.coherence_px)
    return (r.window_s, r.dx_px, _or_nan(r.dy_px), *own, nan)


def _blur_length(r: BlurLength) -> Row:
    return (r.window_s, r.length_px, r.sigma_px, nan, nan, nan, nan, nan)


def _wall_range(r: WallRange) -> Row:
    return (r.range_m, _or_nan(r.sigma_m), nan, nan, nan, nan, nan, nan)


def _fix(r: UwbFix) -> Row:
    return (*r.position_m, *(r.sigma_m or (nan, nan, nan)), nan, nan)


def _height(r: Height) -> Row:
    return (r.height_m, _or_nan(r.sigma_m), nan, nan, nan, nan, nan, nan)


def _attitude(r: Attitude) -> Row:
    return (r.roll_rad, r.pitch_rad, r.yaw_rad, _or_nan(r.sigma_rad), nan, nan, nan, nan)


def _range_packer(anchors: dict[str, int]) -> Callable[[UwbRange], Row]:
    def pack(r: UwbRange) -> Row:
        """Row of a range."""
        powers = _or_nan(r.rssi_dbm), _or_nan(r.first_path_dbm)
        return (anchors.get(r.anchor, -1), r.range_m, _or_nan(r.sigma_m), *powers, nan, nan, nan)

    return pack


def _tdoa_packer(anchors: dict[str, int]) -> Callable[[UwbTdoa], Row]:
    def pack(r: UwbTdoa) -> Row:
        """Row of a difference."""
        pair = anchors.get(r.anchor_a, -1), anchors.get(r.anchor_b, -1)
        return (*pair, r.difference_m, _or_nan(r.sigma_m), nan, nan, nan, nan)

    return pack


PACKERS: dict[Kind, tuple[type[Reading], Callable[[Any], Row]]] = {
    Kind.IMU: (ImuSample, _imu),
    Kind.FLOW: (PixelMotion, _pixel_motion),
    Kind.BLUR: (BlurLength, _blur_length),
    Kind.RANGE: (WallRange, _wall_range),
    Kind.UWB_POSITION: (UwbFix, _fix),
    Kind.HEIGHT: (Height, _height),
    Kind.ATTITUDE: (Attitude, _attitude),
}


class Packer:
    """Turns typed readings of the configured sensors into event rows."""

    def __init__(self, config: Config) -> None:
        # one look-up a reading: by sensor name, to the source, the type it gives and how that is packed
        self._sources: dict[str, tuple[int, type[Reading], Callable[[Any], Row]]] = {}
        for index, name in enumerate(fused_sensors(config)):
            spec, kind = config.sensor[name], kind_of(config.sensor[name])
            assert kind is not None
            if isinstance(spec, Uwb) and kind != Kind.UWB_POSITION:
                anchors = {anchor: number for number, anchor in enumerate(spec.anchors)}
                is_range = kind == Kind.UWB_RANGE
                self._sources[name] = (
                    (index, UwbRange, _range_packer(anchors)) if is_range else (index, UwbTdoa, _tdoa_packer(anchors))
                )
            else:
                self._sources[name] = (index, *PACKERS[kind])

    def pack(self, reading: Reading) -> tuple[int, Row]:
        """Source index and the ``WIDTH`` values of a reading.

        Raises
        ------
        ReadingError
            The sensor is not configured, or it is not one that gives such readings.
        """
        found = self._sources.get(reading.sensor)
        if found is None:
            raise ReadingError(
                f"no sensor named {reading.sensor!r} is configured; there are {', '.join(self._sources) or 'none'}; "
                f"describe it as [sensor.{reading.sensor}]"
            )
        source, expected, values = found
        if type(reading) is not expected:
            raise ReadingError(
                f"{type(reading).__name__} from {reading.sensor}, which is configured as a source of "
                f"{expected.__name__}; send it under another sensor name"
            )
        return source, values(reading)
