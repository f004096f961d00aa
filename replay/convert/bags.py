"""Writes ROS bags with rosbags, without ROS: ``.bag`` (ROS 1) or a folder (ROS 2, sqlite3)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag1 import WriterError as WriterError1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.rosbag2 import WriterError as WriterError2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder.cdr import Codec
from axialnav.replay.convert.messages import ALL_DEFINITIONS, description, flight_messages
from axialnav.replay.flight import Flight

DESCRIPTION_TOPIC, DESCRIPTION_TYPE = "/axialnav/description", "std_msgs/msg/String"
OWN = "axialnav_msgs/"


def write_bag(flight: Flight, path: Path) -> Path:
    """Write ``flight`` as a ROS 1 bag (``.bag``) or a ROS 2 bag (any other name).

    Raises
    ------
    FlightError
        The output exists or cannot be written.
    """
    if path.exists():
        raise FlightError(f"{path}: exists already; remove it or choose another name")
    try:
        _write(flight, path, ros1=path.suffix == ".bag")
    except (OSError, WriterError1, WriterError2) as error:
        raise FlightError(f"{path}: cannot be written: {error}") from None
    return path


def _write(flight: Flight, path: Path, *, ros1: bool) -> None:
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    for name, text in ALL_DEFINITIONS.items():
        if name.startswith(OWN):
            store.register({name: get_types_from_msg(text.partition("\n=")[0], name)[name]})
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    connections: dict[str, Any] = {}

    def write(topic: str, kind: str, t_ns: int, data: bytes) -> None:
        """Write one message, its connection first where it is new."""
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        payload = store.cdr_to_ros1(data, kind) if ros1 else data
        writer.write(connections[topic], max(t_ns, 0), payload)

    with writer:
        told = Codec(DESCRIPTION_TYPE, "string data").encode([json.dumps(description(flight))])
        first = min((int(table.t_ns[0]) for table in flight.tables.values() if len(table)), default=0)
        write(DESCRIPTION_TOPIC, DESCRIPTION_TYPE, first, told)
        for t_ns, one in flight_messages(flight, ros1=ros1):
            write(one.topic, one.type, t_ns, one.data)
