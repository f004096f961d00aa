"""ROS 1 bags and ROS 2 bags (sqlite3 or MCAP) by way of rosbags, without ROS."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder.cdr import Codec
from axialnav.replay.flight import Flight
from axialnav.replay.readers.mcap_records import Payload, Topic, read_mcap
from axialnav.replay.readers.recorded import is_own, read_recorded
from axialnav.replay.readers.ros_streams import read_topics
from axialnav.replay.readers.sqlite_bag import read_sqlite

DESCRIPTION_TOPIC = "/axialnav/description"
SQLITE = b"SQLite format 3\0"


def read_bag(path: Path, mapping: Path | None) -> Flight:
    """Read a bag; for ROS 2 the folder or the file in it.

    Raises
    ------
    FlightError
        Damaged, or nothing in it that can be used.
    """
    inside = sorted(path.glob("*.mcap")) if path.is_dir() else []
    if inside:
        return _mcap_folder(path, inside, mapping)
    topics = _read_topics(path)
    about = _description(topics)
    if about is not None and mapping is None:
        return read_recorded(path, topics, about, "")
    return read_topics(path, topics, mapping, "")


def _mcap_folder(path: Path, files: list[Path], mapping: Path | None) -> Flight:
    """Topics of all files of a bag that was split."""
    merged: dict[str, Topic] = {}
    damage = ""
    for file in files:
        log = read_mcap(file)
        damage = damage or log.damage
        if is_own(log.metadata) and mapping is None and len(files) == 1:
            return read_recorded(file, list(log.topics.values()), log.metadata["axialnav"], log.damage)
        for topic in log.topics.values():
            kept = merged.setdefault(topic.name, Topic(topic.name, topic.type, topic.definition, topic.encoding))
            kept.log_ns += topic.log_ns
            kept.payloads += topic.payloads
            kept.pictures += topic.pictures
    return read_topics(path, list(merged.values()), mapping, damage)


def _read_topics(path: Path) -> list[Topic]:
    """Topics of a bag.  rosbags tells formats by their names, so a file with another one is given a link."""
    if path.is_dir():
        return _by_rosbags(path)
    with path.open("rb") as file:
        if file.read(16) == SQLITE:
            return read_sqlite(path)
    if path.suffix == ".bag":
        return _by_rosbags(path)
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "flight.bag"
        link.symlink_to(path.resolve())
        try:
            return _by_rosbags(link)
        except FlightError as error:
            raise FlightError(str(error).replace(str(link), str(path))) from None


def _by_rosbags(path: Path) -> list[Topic]:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import ConnectionExtRosbag1
    from rosbags.typesys import Stores, get_typestore

    topics: dict[int, Topic] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            for connection, log_ns, raw in reader.messages():
                topic = topics.get(connection.id)
                if topic is None:
                    text, _ = reader.typestore.generate_msgdef(connection.msgtype, ros_version=2)
                    topic = topics[connection.id] = Topic(connection.topic, connection.msgtype, text, "cdr")
                ros1 = isinstance(connection.ext, ConnectionExtRosbag1)
                data = bytes(reader.typestore.ros1_to_cdr(raw, connection.msgtype)) if ros1 else bytes(raw)
                topic.log_ns.append(log_ns)
                topic.keep(data)
    except Exception as error:  # readers of single formats have error classes of their own
        raise FlightError(f"{path}: the bag cannot be read: {type(error).__name__}: {error}") from None
    return _merged(list(topics.values()))


def _merged(topics: list[Topic]) -> list[Topic]:
    """One topic for all publishers of it."""
    by_name: dict[str, Topic] = {}
    for topic in topics:
        if topic.name not in by_name:
            by_name[topic.name] = topic
            continue
        kept = by_name[topic.name]
        kept.log_ns += topic.log_ns
        kept.payloads += topic.payloads
        kept.pictures += topic.pictures
    return list(by_name.values())


def _description(topics: list[Topic]) -> dict[str, str] | None:
    """What one of our own bags says of itself."""
    for topic in topics:
        if topic.name == DESCRIPTION_TOPIC and topic.payloads:
            data: Payload = topic.payloads[0]
            texts = Codec(topic.type, topic.definition).decode([data]).columns.get("data")
            if texts is None:
                return None
            about: dict[str, str] = json.loads(str(texts[0]))
            return about
    return None
