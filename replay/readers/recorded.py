"""Recordings of our own (MCAP and bags): messages back to tables, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.live.recorder.cdr import Codec, Decoded
from axialnav.fusion.live.recorder.messages import EXPOSURE, OUTCOME, OWN, OWN_READINGS, value_fields
from axialnav.fusion.outcome import Verdict
from axialnav.fusion.strict_toml import parse
from axialnav.models.rig import Camera, Uwb
from axialnav.replay.convert.messages import EVALUATION_KEYS, GPS_TOPIC, GPS_TYPE, TRUTH_TOPIC, TRUTH_TYPE
from axialnav.replay.flight import ANCHOR_FIELDS, Flight, GpsReference, SensorTable, Stamps, Truth
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mcap_records import Topic
from axialnav.replay.readers.pictures_inside import pictures_in_order

_OWN = {OWN + kind.__name__: kind for kind in OWN_READINGS}
MOTION = OWN + "PixelMotion"
ABOUT = ("source", "licence", "note")
Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class _Part:
    t_ns: Stamps
    columns: dict[str, NDArray[Any]]


def is_own(metadata: Mapping[str, Mapping[str, str]]) -> bool:
    """Whether a recording describes itself, as ours do."""
    return "config" in metadata.get("axialnav", {})


def read_recorded(path: Path, topics: Sequence[Topic], about: Mapping[str, str], damage: str) -> Flight:
    """Flight from the topics of a recording and what it says of itself.

    Raises
    ------
    FlightError
        Its description cannot be used.
    """
    drops = DropLog()
    if damage:
        drops.add(path.name, f"{damage}; read up to there", 1, path.name)
    try:
        config = Config.from_dict(parse(about["config"], where=f"{path}: config"), where=f"{path}: config")
    except ConfigError as error:
        raise FlightError(str(error)) from None
    by_name = {topic.name.lstrip("/"): topic for topic in topics}
    tables = {}
    frames: dict[str, Callable[[], Iterator[NDArray[np.generic]]]] = {}
    for name, spec in config.sensor.items():
        topic = by_name.get(name)
        if topic is None:
            continue
        if isinstance(spec, Camera) and topic.type != MOTION:
            tables[name], frames[name] = _camera(topic, by_name.get(f"{name}/exposure"), path)
            continue
        part = _part(topic, drops, _refused_as_late(by_name.get(f"{name}/outcome")))
        if part is not None:
            anchors = tuple(spec.anchors) if isinstance(spec, Uwb) else ()
            tables[name] = _table(part, anchors)
    return Flight(
        name=about.get("name") or path.stem,
        path=path,
        info={key: about[key] for key in ABOUT if about.get(key)},
        config=config,
        tables=tables,
        truth=_truth(by_name.get(TRUTH_TOPIC), drops),
        gps=_gps(by_name.get(GPS_TOPIC), drops),
        evaluation=(_number(about, EVALUATION_KEYS[0]), _number(about, EVALUATION_KEYS[1])),
        drops=drops.as_tuple(),
        frames=frames,
    )


def _number(about: Mapping[str, str], key: str) -> float | None:
    text = about.get(key)
    return float(text) if text else None


def decode_topic(topic: Topic, drops: DropLog) -> Decoded | None:
    """Columns of a topic; None, with a note, if its messages cannot be read."""
    if topic.encoding != "cdr":
        drops.add(
            topic.name, f"messages encoded as {topic.encoding or 'nothing'}: left out", len(topic.log_ns), topic.type
        )
        return None
    try:
        decoded = Codec(topic.type, topic.definition).decode(topic.payloads)
    except ValueError as error:
        drops.add(topic.name, f"left out: {error}", len(topic.log_ns), topic.type)
        return None
    drops.add(topic.name, "message does not fit its definition: left out", decoded.refused, topic.type)
    return decoded if len(decoded.message) else None


def stamps_ns(columns: Columns) -> Stamps | None:
    """Header stamps of decoded messages, None where there is no header."""
    for head in ("header.stamp", "stamp"):
        if f"{head}.sec" in columns:
            seconds = columns[f"{head}.sec"].astype(np.int64)
            return np.asarray(seconds * 1_000_000_000 + columns[f"{head}.nanosec"].astype(np.int64))
    return None


def _refused_as_late(topic: Topic | None) -> frozenset[tuple[int, int]]:
    """(arrival, stamp) of the readings that came too late for the filter in flight [ns]."""
    decoded = decode_topic(topic, DropLog()) if topic is not None and topic.type == OUTCOME else None
    if topic is None or decoded is None:
        return frozenset()
    stamps = stamps_ns(decoded.columns)
    assert stamps is not None
    late = np.flatnonzero(decoded.columns["verdict"] == int(Verdict.LATE))
    arrival = np.asarray(topic.log_ns, dtype=np.int64)[decoded.message]
    return frozenset(zip(arrival[late].tolist(), stamps[late].tolist(), strict=True))


def _part(topic: Topic, drops: DropLog, late: frozenset[tuple[int, int]] = frozenset()) -> _Part | None:
    """Stamps and columns of a topic, keyed as the fields of its reading class, sorted by time.

    Readings in ``late`` are left out, as the filter did in flight: a replay must not know more than it did.
    """
    decoded = decode_topic(topic, drops)
    if decoded is None:
        return None
    stamps = stamps_ns(decoded.columns)
    if stamps is None:
        drops.add(topic.name, "no stamp in the messages: left out", len(decoded.message), topic.type)
        return None
    columns = _renamed(topic.type, decoded.columns)
    order = np.argsort(stamps, kind="stable")
    if late:
        arrival = np.asarray(topic.log_ns, dtype=np.int64)[decoded.message]
        refused = np.array([pair in late for pair in zip(arrival.tolist(), stamps.tolist(), strict=True)])
        example = f"stamp {stamps[refused][0]}" if refused.any() else ""
        drops.add(topic.name, "came too late for the filter in flight: left out here too", refused.sum(), example)
        order = order[~refused[order]]
    return _Part(stamps[order], {name: array[order] for name, array in columns.items()})


def _vector(columns: Columns, name: str) -> NDArray[Any]:
    return np.stack([columns[f"{name}.{axis}"] for axis in "xyz"], axis=1)


def _renamed(kind: str, columns: Columns) -> dict[str, NDArray[Any]]:
    if kind == "sensor_msgs/msg/Imu":
        gyro, accel = _vector(columns, "angular_velocity"), _vector(columns, "linear_acceleration")
        return {"gyro_rad_s": gyro, "accel_m_s2": accel}
    if kind == "geometry_msgs/msg/PoseWithCovarianceStamped":
        sigma = np.sqrt(columns["pose.covariance"][:, [0, 7, 14]])
        sigma[sigma == 0.0] = np.nan
        return {"position_m": _vector(columns, "pose.pose.position"), "sigma_m": sigma}
    own = _OWN.get(kind)
    if own is not None:
        return {name: columns[name] for name in value_fields(own)}
    return {name: array for name, array in columns.items() if not name.startswith("header.")}


def _table(part: _Part, anchors: tuple[str, ...]) -> SensorTable:
    """Table with anchors as numbers."""
    names: dict[str, NDArray[Any]] = {name: part.columns[name] for name in ANCHOR_FIELDS if name in part.columns}
    if not names:
        return SensorTable(part.t_ns, part.columns, anchors)
    places = {name: index for index, name in enumerate(anchors)}
    numbered = {
        field: np.array([places.get(str(text), -1) for text in texts], dtype=np.int64) for field, texts in names.items()
    }
    strange = np.flatnonzero(np.any([index < 0 for index in numbered.values()], axis=0))
    unlisted = {row: tuple(str(texts[row]) for texts in names.values()) for row in strange.tolist()}
    return SensorTable(part.t_ns, {**part.columns, **numbered}, anchors, unlisted)


def _camera(
    topic: Topic, exposures: Topic | None, path: Path
) -> tuple[SensorTable, Callable[[], Iterator[NDArray[np.generic]]]]:
    """Table of a camera, and a function that goes through its pictures in the order of the table."""
    where = f"{path}: {topic.name}"
    stamps, pictures = pictures_in_order(topic.pictures, topic.type, topic.definition, where)
    times = np.full(len(stamps), np.nan)
    if exposures is not None and exposures.type == EXPOSURE:
        part = _part(exposures, DropLog())
        if part is not None:
            known = dict(zip(part.t_ns.tolist(), part.columns["exposure_s"].tolist(), strict=True))
            times = np.array([known.get(t, np.nan) for t in stamps.tolist()])
    names = np.array([f"{t}.png" for t in stamps.tolist()], dtype=np.str_)
    return SensorTable(stamps, {"filename": names, "exposure_s": times}), pictures


def _truth(topic: Topic | None, drops: DropLog) -> Truth | None:
    part = None if topic is None or topic.type != TRUTH_TYPE else _part(topic, drops)
    if part is None:
        return None
    columns = part.columns
    biases = {name: None if np.isnan(columns[name]).all() else columns[name] for name in ("gyro_bias", "accel_bias")}
    return Truth(part.t_ns, columns["position_m"], columns["quaternion_wb"], columns["velocity_m_s"], **biases)


def _gps(topic: Topic | None, drops: DropLog) -> GpsReference | None:
    part = None if topic is None or topic.type != GPS_TYPE else _part(topic, drops)
    return None if part is None else GpsReference(part.t_ns, part.columns["position_m"], part.columns["velocity_m_s"])
