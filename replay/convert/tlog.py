"""Writes a MAVLink ``.tlog``: standard messages for other tools, and every row bit for bit in TUNNEL packets for ours.

MAVLink rounds (32-bit floats, centimetres) and has no word for UWB ranges, so the standard messages alone would not
replay to the same numbers.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as dialect

from axialnav.fusion.sources import fused_sensors
from axialnav.models.rig import AttitudeSource, Camera, Flow, Imu, RangeFinder
from axialnav.replay.convert.exact import ROW, ROW_TYPE, TEXT_HEAD, TEXT_TYPE, exact_rows, exact_text, text_pieces
from axialnav.replay.convert.new_file import write_new
from axialnav.replay.flight import Flight

PIECE_BYTES = 120
PAYLOAD_BYTES = 128
DOWN = 25
FRD = np.array([1.0, -1.0, -1.0])
EPOCH_US = 1_577_836_800_000_000  # 2020-01-01: arrival stamps of flights whose clock is not the calendar's
Packer = Callable[[int, list[float]], Any]


def write_tlog(flight: Flight, path: Path) -> Path:
    """Write ``flight`` as a telemetry log.

    Raises
    ------
    FlightError
        The file exists or cannot be written.
    """
    return write_new(path, _records(flight))


def _records(flight: Flight) -> Iterator[bytes]:
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    rows = exact_rows(flight)
    start_ns = int(rows["t_ns"][0]) if len(rows) else 0
    base_us = 0 if start_ns > 1e9 * EPOCH_US / 1e6 else EPOCH_US

    def record(t_ns: int, message: Any) -> bytes:
        """Bytes of a message with its stamp before it."""
        packet: bytes = message.pack(link)
        link.seq = (link.seq + 1) % 256
        arrival_us = base_us + (t_ns if not base_us else t_ns - start_ns) // 1000
        return struct.pack(">Q", arrival_us) + packet

    pieces = [TEXT_HEAD.pack(n, count) + piece for n, count, piece in text_pieces(exact_text(flight), PIECE_BYTES)]
    for _ in range(2):  # twice, because a packet may be damaged and nothing can be read without the description
        for piece in pieces:
            yield record(start_ns, _tunnel(TEXT_TYPE, piece))
    packers = _packers(flight, start_ns)
    for source, t_ns, values in rows.tolist():
        if source in packers:
            yield record(t_ns, packers[source](t_ns, list(values)))
        yield record(t_ns, _tunnel(ROW_TYPE, ROW.pack(source, t_ns, *values)))


def _tunnel(kind: int, payload: bytes) -> Any:
    filled = list(payload.ljust(PAYLOAD_BYTES, b"\0"))
    return dialect.MAVLink_tunnel_message(0, 0, kind, len(payload), filled)


def _packers(flight: Flight, start_ns: int) -> dict[int, Packer]:
    """Functions that make the standard message of a source, for sources that have one."""
    sensors = flight.config.sensor
    plain = [name for name in fused_sensors(flight.config) if not isinstance(sensors[name], Camera)]
    packers: dict[int, Packer] = {}
    for index, name in enumerate(plain):
        spec = flight.config.sensor[name]
        rotation = FRD[:, None] * spec.rotation_BS
        if isinstance(spec, Imu):
            packers[index] = _imu(rotation, start_ns)
        elif isinstance(spec, RangeFinder):
            packers[index] = _distance(spec, start_ns)
        elif isinstance(spec, Flow):
            packers[index] = _flow(spec, start_ns)
        elif isinstance(spec, AttitudeSource):
            packers[index] = lambda t, v: dialect.MAVLink_attitude_message(
                _boot_ms(t, start_ns), v[0], v[1], v[2], 0.0, 0.0, 0.0
            )
    return packers


def _boot_ms(t_ns: int, start_ns: int) -> int:
    return (t_ns - start_ns) // 1_000_000 % 2**32


def _imu(rotation: NDArray[np.float64], start_ns: int) -> Packer:
    def pack(t_ns: int, values: list[float]) -> Any:
        """Message of an inertial sample."""
        gyro, accel = rotation @ values[:3], rotation @ values[3:6]
        stamp_us = (t_ns - start_ns) // 1000
        rest = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0x3F)
        return dialect.MAVLink_highres_imu_message(stamp_us, *accel.tolist(), *gyro.tolist(), *rest)

    return pack


def _distance(spec: RangeFinder, start_ns: int) -> Packer:
    low, high = (round(min(limit, 655.0) * 100) for limit in (spec.range_min_m, spec.range_max_m))

    def pack(t_ns: int, values: list[float]) -> Any:
        """Message of a range [m]."""
        centimetres = min(round(values[0] * 100), 65535)
        return dialect.MAVLink_distance_sensor_message(
            _boot_ms(t_ns, start_ns), low, high, centimetres, 0, 0, DOWN, 255
        )

    return pack


def _flow(spec: Flow, start_ns: int) -> Packer:
    fu, fv = spec.focal_px

    def pack(t_ns: int, values: list[float]) -> Any:
        """Message of image motion."""
        window_us = round(values[0] * 1e6)
        end_us = (t_ns - start_ns) // 1000 + window_us // 2
        dy = 0.0 if np.isnan(values[2]) else values[2]
        quality = 255 if np.isnan(values[4]) else int(min(max(values[4], 0), 255))
        nothing = (float("nan"),) * 3
        return dialect.MAVLink_optical_flow_rad_message(
            max(end_us, 0), 0, window_us, dy / fv, -values[1] / fu, *nothing, 0, quality, 0, float("nan")
        )

    return pack
