"""Writes a flight as one MCAP file that replays to the same digest."""

from __future__ import annotations

from pathlib import Path

from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder.recorder import METADATA
from axialnav.fusion.live.recorder.sink import CHUNK_BYTES, McapSink
from axialnav.replay.convert.messages import ALL_DEFINITIONS, description, flight_messages
from axialnav.replay.flight import Flight


def write_mcap(flight: Flight, path: str | Path) -> Path:
    """Write ``flight`` to ``path`` and return it.

    Raises
    ------
    FlightError
        The file exists or cannot be written, or a picture cannot be read.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        sink = McapSink(path, "axialnav")
        try:
            sink.add_metadata(METADATA, description(flight))
            for t_ns, one in flight_messages(flight):
                sink.add(one.topic, one.type, ALL_DEFINITIONS[one.type], one.data, log_ns=t_ns, publish_ns=t_ns)
                if sink.pending_bytes > CHUNK_BYTES:
                    sink.flush()
        finally:
            sink.finish()
    except FileExistsError:
        raise FlightError(f"{path}: exists already; remove it or choose another name") from None
    except OSError as error:
        raise FlightError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
