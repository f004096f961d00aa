"""ROS topics to streams: header stamps, columns by dotted field names, pictures one at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import load_mapping
from axialnav.replay.readers.mcap_records import Topic
from axialnav.replay.readers.pictures_inside import pictures_in_order
from axialnav.replay.readers.recorded import decode_topic, stamps_ns
from axialnav.replay.readers.streams import Stream


def read_topics(path: Path, topics: Sequence[Topic], mapping: Path | None, damage: str) -> Flight:
    """Flight from topics by a mapping.

    Raises
    ------
    FlightError
        Nothing that can be used.
    """
    found, asked = load_mapping(path, mapping, "ros")
    drops = DropLog()
    if damage:
        drops.add(path.name, f"{damage}; read up to there", 1, path.name)
    wanted = {name for source in found.source.values() for name in source.streams}
    streams = []
    for topic in topics:
        bare = Stream(topic.name, topic.type, np.array(topic.log_ns, dtype=np.int64))
        if any(bare.matches(name) for name in wanted):
            stream = _picture_stream(topic, path) if topic.pictures else _stream(topic, drops)
            if stream is not None:
                streams.append(stream)
        else:
            streams.append(bare)
    return Assembly(path, streams, found, asked, drops).flight()


def _stream(topic: Topic, drops: DropLog) -> Stream | None:
    decoded = decode_topic(topic, drops)
    if decoded is None:
        return None
    stamps = stamps_ns(decoded.columns)
    if stamps is None or not stamps.any():
        stamps = np.array(topic.log_ns, dtype=np.int64)[decoded.message]
        drops.add(topic.name, "no stamps in the messages: time of recording used", len(stamps), topic.type)
    return Stream(topic.name, topic.type, stamps, decoded.columns)


def _picture_stream(topic: Topic, path: Path) -> Stream:
    where = f"{path}: {topic.name}"
    stamps, pictures = pictures_in_order(topic.pictures, topic.type, topic.definition, where)
    return Stream(topic.name, topic.type, stamps, {}, pictures)
