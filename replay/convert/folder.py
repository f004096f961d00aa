"""Writes a flight folder, with the pictures that stand inside a recording as files of their own."""

from __future__ import annotations

from pathlib import Path

import msgspec

from axialnav.replay.flight import Flight
from axialnav.replay.flight_writer import write_flight


def write_folder(flight: Flight, folder: Path) -> Path:
    """Write ``flight`` as a flight folder.

    Raises
    ------
    FlightError
        The folder holds a flight already or cannot be written, or a picture cannot be read.
    """
    write_flight(flight, folder)
    if flight.frames:
        _write_pictures(flight, folder)
    return folder


def _write_pictures(flight: Flight, folder: Path) -> None:
    from axialnav.fusion.live.camera_codec import PictureEncoder
    from axialnav.replay.frames import camera_frames

    encode = PictureEncoder()
    for camera in flight.frames:
        place = folder / "mav0" / camera / "data"
        place.mkdir(parents=True, exist_ok=True)
        names = flight.tables[camera].columns["filename"].tolist()
        for name, frame in zip(names, camera_frames(flight, camera), strict=False):
            _, data = encode(msgspec.structs.replace(frame, exposure_s=None))
            (place / name).write_bytes(data)
