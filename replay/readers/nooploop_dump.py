"""Raw dumps of a Nooploop serial line; time is the module's own clock, from its first frame on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.nooploop.readings import NLinkReadings, module_time_ms
from axialnav.fusion.live.nooploop.serial_port import dump_blocks
from axialnav.fusion.readings import Reading, UwbFix, UwbRange, WallRange
from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import load_mapping
from axialnav.replay.readers.streams import Stream

WRAP_MS = 1 << 32
FIELDS: dict[type[Reading], tuple[str, ...]] = {
    UwbRange: ("anchor", "range_m", "rssi_dbm", "first_path_dbm"),
    UwbFix: ("position_m", "sigma_m"),
    WallRange: ("range_m", "sigma_m"),
}
NAMES: dict[type[Reading], str] = {UwbRange: "ranges", UwbFix: "fixes", WallRange: "distances"}


def read_nooploop_dump(path: Path, mapping: Path | None) -> Flight:
    """Read a dump: streams ``ranges``, ``fixes`` and ``distances``.

    Raises
    ------
    FlightError
        No frame with a number that can be used.
    """
    found, asked = load_mapping(path, mapping, "nooploop")
    drops = DropLog()
    decoder = NLinkDecoder()
    turned = NLinkReadings(fixes="fixes")
    kept: dict[type[Reading], list[Any]] = {kind: [] for kind in NAMES}
    last_ms = wraps = 0
    for block in dump_blocks(path, 1 << 20):
        for frame in decoder.feed(block):
            time_ms = module_time_ms(frame)
            if time_ms is None:
                continue
            wraps += time_ms < last_ms - WRAP_MS // 2
            last_ms = time_ms
            for reading in turned.of(frame, (time_ms + WRAP_MS * wraps) * 1_000_000):
                kept[type(reading)].append(reading)
    status = decoder.status
    drops.add(path.name, "bytes that belong to no frame: skipped", status.skipped_bytes, path.name)
    for name, count in status.damaged.items():
        drops.add(path.name, f"{name} with a wrong sum: left out", count, path.name)
    for reason, count in turned.refused.items():
        drops.add(path.name, f"{reason}: left out", count, path.name)
    streams = [_stream(kind, readings) for kind, readings in kept.items() if readings]
    return Assembly(path, streams, found, asked, drops).flight()


def _stream(kind: type[Reading], readings: list[Any]) -> Stream:
    columns = {}
    for field in FIELDS[kind]:
        values = [getattr(reading, field) for reading in readings]
        if field == "anchor":
            columns[field] = np.array(values, dtype=np.str_)
        elif field in {"position_m"} or (kind is UwbFix and field == "sigma_m"):
            columns[field] = np.array([value or (np.nan,) * 3 for value in values], dtype=np.float64)
        else:
            columns[field] = np.array([np.nan if value is None else value for value in values], dtype=np.float64)
    stamps = np.array([reading.t_ns for reading in readings], dtype=np.int64)
    return Stream(NAMES[kind], NAMES[kind], stamps, columns)
