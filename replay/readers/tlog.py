"""MAVLink telemetry logs (``.tlog``)."""

from __future__ import annotations

from pathlib import Path

from axialnav.fusion.errors import FlightError
from axialnav.replay.convert.exact import flight_from_tunnels, tunnel_columns
from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import load_mapping
from axialnav.replay.readers.streams import Stream
from axialnav.replay.readers.tlog_records import read_tlog_records

AUTOPILOT = 1


def read_tlog(path: Path, mapping: Path | None) -> Flight:
    """Read a telemetry log; streams are called by their message, of a second sender ``NAME@system.component``.

    Raises
    ------
    FlightError
        Nothing in it that can be used.
    """
    log = read_tlog_records(path)
    drops = DropLog()
    drops.add(path.name, "packet with a wrong checksum: left out", log.damaged, path.name)
    drops.add(path.name, "packet of an unknown kind: left out", log.unknown, path.name)
    drops.add(path.name, "bytes that belong to no packet: skipped", log.skipped_bytes, path.name)
    if not log.messages:
        raise FlightError(f"{path}: holds no whole MAVLink packet; is it a telemetry log?")
    tunnel = tunnel_columns(log.messages)
    if mapping is None and tunnel is not None:
        return flight_from_tunnels(path, tunnel, drops)
    found, asked = load_mapping(path, mapping, "mavlink")
    taken: set[str] = set()
    streams = []
    for part in sorted(log.messages, key=lambda m: (m.sender[1] != AUTOPILOT, m.sender)):
        name = part.name if part.name not in taken else f"{part.name}@{part.sender[0]}.{part.sender[1]}"
        taken.add(part.name)
        streams.append(Stream(name, name, part.arrival_us * 1000, part.columns))
    return Assembly(path, streams, found, asked, drops).flight()
