"""A ``.db3`` of a ROS 2 bag by itself, without the folder and its ``metadata.yaml``."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from axialnav.fusion.errors import FlightError
from axialnav.replay.readers.mcap_records import Topic


def read_sqlite(path: Path) -> list[Topic]:
    """Topics of the file; definitions from the file where it has them, else those of ROS 2 Humble.

    Raises
    ------
    FlightError
        Damaged, or no bag.
    """
    try:
        with closing(sqlite3.connect(f"file:{path.resolve()}?mode=ro", uri=True)) as base:
            return _topics(base)
    except sqlite3.Error as error:
        raise FlightError(f"{path}: the bag cannot be read: {error}; was it copied completely?") from None


def _topics(base: sqlite3.Connection) -> list[Topic]:
    known = (
        dict(base.execute("SELECT topic_type, encoded_message_definition FROM message_definitions"))
        if (base.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone())
        else {}
    )
    topics: dict[int, Topic] = {}
    for number, name, kind, encoding in base.execute("SELECT id, name, type, serialization_format FROM topics"):
        topics[number] = Topic(name, kind, known.get(kind) or _humble(kind), encoding)
    for number, stamp, data in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
        topic = topics.get(number)
        if topic is not None:
            topic.log_ns.append(stamp)
            topic.keep(bytes(data))
    return list(topics.values())


def _humble(kind: str) -> str:
    """Definition of a standard type, empty for others."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    if kind not in store.fielddefs:
        return ""
    text: str = store.generate_msgdef(kind, ros_version=2)[0]
    return text
