"""PX4 logs (``.ulg``) by way of pyulog."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from axialnav.fusion.errors import FlightError
from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import load_mapping
from axialnav.replay.readers.streams import Stream


def read_ulog(path: Path, mapping: Path | None) -> Flight:
    """Read a PX4 log; second instances of a topic are called ``topic[1]``.

    Raises
    ------
    FlightError
        Damaged beyond use, or nothing in it that can be used.
    """
    from pyulog import ULog

    found, asked = load_mapping(path, mapping, "ulog")
    drops = DropLog()
    said = io.StringIO()  # pyulog prints what it finds wrong
    try:
        with path.open("rb") as file, redirect_stdout(said):
            log = ULog(file)
    except Exception as error:  # pyulog raises whatever its struct and index accesses give
        raise FlightError(f"{path}: damaged PX4 log: {type(error).__name__}: {error}; copy it again") from None
    if log.dropouts:
        lost_ms = sum(dropout.duration for dropout in log.dropouts)
        drops.add(path.name, f"the logger lost {lost_ms} ms in all", len(log.dropouts), "dropouts of the log")
    if log.file_corruption or said.getvalue():
        drops.add(path.name, "the file is damaged; what could be read was", 1, said.getvalue().strip() or path.name)
    streams = []
    for data in log.data_list:
        if "timestamp" not in data.data:
            drops.add(
                data.name, "topic without timestamps: left out", len(next(iter(data.data.values()), ())), data.name
            )
            continue
        name = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
        columns = {field: np.asarray(values) for field, values in data.data.items()}
        streams.append(Stream(name, data.name, columns["timestamp"].astype(np.int64) * 1000, columns))
    return Assembly(path, streams, found, asked, drops).flight()
