"""Numbers in a frame: 24-bit integers, powers, angles, vectors."""

from __future__ import annotations

import struct

from axialnav.fusion.live.nooploop.frames import Vector3


class Implausible(ValueError):  # noqa: N818 - not an error: the bytes are just not a frame
    """The bytes have the right sum but cannot be such a frame."""


def int24(data: bytes, at: int) -> int:
    """Signed 24-bit integer."""
    return int.from_bytes(data[at : at + 3], "little", signed=True)


def vector24(data: bytes, at: int, per_unit: float) -> Vector3:
    """Three 24-bit integers over ``per_unit``."""
    return int24(data, at) / per_unit, int24(data, at + 3) / per_unit, int24(data, at + 6) / per_unit


def row24(data: bytes, at: int, count: int) -> tuple[float, ...]:
    """``count`` distances in millimetres, as metres."""
    return tuple(int24(data, at + 3 * k) / 1000.0 for k in range(count))


def floats(data: bytes, at: int, count: int) -> tuple[float, ...]:
    """``count`` 32-bit floats, exactly."""
    return struct.unpack_from(f"<{count}f", data, at)


def vector_f(data: bytes, at: int) -> Vector3:
    """Three 32-bit floats."""
    x, y, z = floats(data, at, 3)
    return x, y, z


def quaternion_f(data: bytes, at: int) -> tuple[float, float, float, float]:
    """Four 32-bit floats."""
    w, x, y, z = floats(data, at, 4)
    return w, x, y, z


def angles(data: bytes, at: int) -> Vector3:
    """Three angles in hundredths of a degree, as degrees."""
    a, b, c = struct.unpack_from("<3h", data, at)
    return a / 100.0, b / 100.0, c / 100.0


def position_error(data: bytes, at: int) -> Vector3:
    """Three bytes in centimetres, as metres."""
    return data[at] / 100.0, data[at + 1] / 100.0, data[at + 2] / 100.0


def power(byte: int) -> float:
    """Power in dBm from half negative dB."""
    return byte / -2.0


def u16(data: bytes, at: int) -> int:
    """Unsigned 16-bit integer."""
    return data[at] | data[at + 1] << 8


def u32(data: bytes, at: int) -> int:
    """Unsigned 32-bit integer."""
    return int.from_bytes(data[at : at + 4], "little")
