"""Writes a log in ArduPilot's ``.bin`` form: IMU, ATT and RFND for other tools, and every row bit for bit for ours."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from axialnav.fusion.sources import fused_sensors
from axialnav.models.rig import AttitudeSource, Camera, Imu, RangeFinder
from axialnav.replay.convert.exact import ROW, ROW_MESSAGE, TEXT_MESSAGE, exact_rows, exact_text, row_sum, text_pieces
from axialnav.replay.convert.new_file import write_new
from axialnav.replay.flight import Flight

HEAD = b"\xa3\x95"
FRD = np.array([1.0, -1.0, -1.0])
PIECE_BYTES = 64
# number, name, letters, labels
FORMATS = (
    (0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
    (0x81, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    (0x82, "ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw"),
    (0x83, "RFND", "QBfB", "TimeUS,Instance,Dist,Orient"),
    (0x90, TEXT_MESSAGE, "QHHBZ", "TimeUS,N,Of,L,T"),
    (0x91, ROW_MESSAGE, "QBqddddddddH", "TimeUS,S,TNs,V0,V1,V2,V3,V4,V5,V6,V7,Sum"),
)
_CODES = {"Q": "Q", "B": "B", "H": "H", "q": "q", "d": "d", "f": "f", "c": "h", "n": "4s", "N": "16s", "Z": "64s"}
PACKERS = {
    name: (number, struct.Struct("<" + "".join(_CODES[c] for c in letters))) for number, name, letters, _ in FORMATS
}


def write_dataflash(flight: Flight, path: Path) -> Path:
    """Write ``flight`` as a ``.bin``.

    Raises
    ------
    FlightError
        The file exists or cannot be written.
    """
    return write_new(path, _messages(flight))


def _pack(name: str, *values: Any) -> bytes:
    number, packer = PACKERS[name]
    return HEAD + bytes([number]) + packer.pack(*values)


def _messages(flight: Flight) -> Iterator[bytes]:
    for number, name, letters, labels in FORMATS:
        length = 3 + PACKERS[name][1].size
        yield _pack("FMT", number, length, name.encode(), letters.encode(), labels.encode())
    for number, count, piece in list(text_pieces(exact_text(flight), PIECE_BYTES)) * 2:  # as in a .tlog
        yield _pack(TEXT_MESSAGE, 0, number, count, len(piece), piece)
    rows = exact_rows(flight)
    start_ns = int(rows["t_ns"][0]) if len(rows) else 0
    specs = [
        spec for name in fused_sensors(flight.config) if not isinstance(spec := flight.config.sensor[name], Camera)
    ]
    for source, t_ns, values in rows.tolist():
        stamp_us = (t_ns - start_ns) // 1000
        of_row = specs[source] if source < len(specs) else None
        if isinstance(of_row, Imu):
            rotation = FRD[:, None] * of_row.rotation_BS
            yield _pack("IMU", stamp_us, 0, *(rotation @ values[:3]).tolist(), *(rotation @ values[3:6]).tolist())
        elif isinstance(of_row, AttitudeSource):
            angles = np.degrees(values[:3]) * 100.0
            angles[2] %= 36000.0
            yield _pack("ATT", stamp_us, *(int(a) if a < 32768 else int(a) - 36000 for a in np.rint(angles).tolist()))
        elif isinstance(of_row, RangeFinder):
            yield _pack("RFND", stamp_us, 0, values[0], 25)
        yield _pack(ROW_MESSAGE, stamp_us, source, t_ns, *values, row_sum(ROW.pack(source, t_ns, *values)))
