"""A flight as the messages that would have been recorded on board, with its references and its description."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from axialnav.fusion.live.recorder.definition import BUILT_IN
from axialnav.fusion.live.recorder.messages import DEFINITIONS, Encoded, HeaderCodec, MessageEncoder
from axialnav.replay.flight import Flight, GpsReference, Truth
from axialnav.replay.flight_readings import all_readings

TRUTH_TOPIC, TRUTH_TYPE = "truth", "axialnav_msgs/msg/Truth"
GPS_TOPIC, GPS_TYPE = "gps_reference", "axialnav_msgs/msg/GpsReference"
EVALUATION_KEYS = ("evaluation_start_s", "evaluation_end_s")
_LINE = "\n" + "=" * 80 + "\nMSG: "
_HEADER = "".join(f"{_LINE}{name}\n{text}" for name, text in BUILT_IN.items() if not name.endswith("Duration"))
ALL_DEFINITIONS = {
    **DEFINITIONS,
    TRUTH_TYPE: "std_msgs/Header header\nfloat64[3] position_m\nfloat64[4] quaternion_wb\nfloat64[3] velocity_m_s\n"
    "float64[3] gyro_bias\nfloat64[3] accel_bias" + _HEADER,
    GPS_TYPE: "std_msgs/Header header\nfloat64[3] position_m\nfloat64[3] velocity_m_s" + _HEADER,
}


def description(flight: Flight) -> dict[str, str]:
    """What a recording says of itself: name, origin, scoring window and the whole configuration."""
    window = zip(EVALUATION_KEYS, flight.evaluation, strict=True)
    told = {key: repr(float(value)) for key, value in window if value is not None}
    return {"name": flight.name, **flight.info, **told, "config": flight.config.to_toml()}


def flight_messages(flight: Flight, *, ros1: bool = False) -> Iterator[tuple[int, Encoded]]:
    """Stamp and message of everything in a flight: first the references, then all readings in time order.

    Parameters
    ----------
    ros1
        Headers as in ROS 1.
    """
    from axialnav.fusion.live.camera_codec import PictureEncoder

    if flight.truth is not None:
        yield from _truth(flight.truth, ros1)
    if flight.gps is not None:
        yield from _gps(flight.gps, ros1)
    encoder = MessageEncoder(PictureEncoder(), ros1=ros1)
    for reading in all_readings(flight):
        for encoded in encoder.encode(reading.sensor, reading.t_ns, reading):
            yield reading.t_ns, encoded


def _truth(truth: Truth, ros1: bool) -> Iterator[tuple[int, Encoded]]:
    n = len(truth.t_ns)
    absent = np.full((n, 3), np.nan)
    gyro = absent if truth.gyro_bias is None else truth.gyro_bias
    accel = absent if truth.accel_bias is None else truth.accel_bias
    values = np.hstack([truth.position_m, truth.quaternion_WB, truth.velocity_m_s, gyro, accel])
    yield from _rows(TRUTH_TOPIC, TRUTH_TYPE, "world", truth.t_ns, values, ros1)


def _gps(gps: GpsReference, ros1: bool) -> Iterator[tuple[int, Encoded]]:
    yield from _rows(GPS_TOPIC, GPS_TYPE, "earth", gps.t_ns, np.hstack([gps.position_m, gps.velocity_m_s]), ros1)


def _rows(topic: str, kind: str, frame: str, t_ns: Any, values: Any, ros1: bool) -> Iterator[tuple[int, Encoded]]:
    codec = HeaderCodec(kind, ALL_DEFINITIONS[kind], ros1=ros1)
    for stamp, row in zip(t_ns.tolist(), values.tolist(), strict=True):
        yield stamp, Encoded(f"/{topic}", kind, codec.encode([*divmod(stamp, 10**9), frame, *row]))
