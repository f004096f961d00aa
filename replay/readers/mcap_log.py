"""MCAP files: our own recordings bit for bit, other people's by a mapping."""

from __future__ import annotations

from pathlib import Path

from axialnav.replay.flight import Flight
from axialnav.replay.readers.mcap_records import read_mcap
from axialnav.replay.readers.recorded import is_own, read_recorded
from axialnav.replay.readers.ros_streams import read_topics


def read_mcap_log(path: Path, mapping: Path | None) -> Flight:
    """Read an MCAP file; a mapping, where one is given, goes before what a recording says of itself.

    Raises
    ------
    FlightError
        Not usable.
    """
    log = read_mcap(path)
    topics = list(log.topics.values())
    if is_own(log.metadata) and mapping is None:
        return read_recorded(path, topics, log.metadata["axialnav"], log.damage)
    return read_topics(path, topics, mapping, log.damage)
