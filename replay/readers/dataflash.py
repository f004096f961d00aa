"""ArduPilot logs (``.bin``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from axialnav.fusion.errors import FlightError
from axialnav.replay.convert.exact import ROW_MESSAGE, TEXT_MESSAGE, flight_from_bin
from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.dataflash_records import read_dataflash_records
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import load_mapping
from axialnav.replay.readers.streams import Stream


def read_dataflash(path: Path, mapping: Path | None) -> Flight:
    """Read an ArduPilot log.

    Raises
    ------
    FlightError
        Nothing in it that can be used.
    """
    log = read_dataflash_records(path)
    drops = DropLog()
    if log.skipped_bytes:
        drops.add(path.name, "bytes that belong to no message: skipped", log.skipped_bytes, path.name)
    if mapping is None and {ROW_MESSAGE, TEXT_MESSAGE} <= set(log.messages):
        return flight_from_bin(path, log.messages, drops)
    found, asked = load_mapping(path, mapping, "dataflash")
    streams = []
    for name, columns in log.messages.items():
        stamp = columns.get("TimeUS")
        if stamp is None and "TimeMS" in columns:
            stamp = columns["TimeMS"].astype(np.int64) * 1000
        if stamp is not None:
            streams.append(Stream(name, name, stamp.astype(np.int64) * 1000, columns))
    if not streams:
        raise FlightError(f"{path}: an ArduPilot log without a single timed message; it was cut after its head")
    return Assembly(path, streams, found, asked, drops).flight()
