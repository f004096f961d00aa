"""A flight's rows bit for bit in formats that have no word for them: MAVLink TUNNEL packets, messages of a ``.bin``.

A row is (source, stamp, eight numbers), the packing that the filter itself uses (:mod:`axialnav.fusion.events`); what
the sources are is told by the flight's description, which travels as text in pieces.  Camera frames do not fit.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.events import COLUMNS, WIDTH, pack_tables, reading_stamps
from axialnav.fusion.sources import fused_sensors, kind_of
from axialnav.fusion.strict_toml import parse
from axialnav.models.rig import Camera, Uwb
from axialnav.replay.convert.messages import EVALUATION_KEYS, description
from axialnav.replay.flight import Flight, GpsReference, SensorTable, Stamps, Truth
from axialnav.replay.readers.dropped import DropLog

if TYPE_CHECKING:
    from axialnav.replay.readers.tlog_records import TlogMessages

ROW_TYPE, TEXT_TYPE = 0x8A00, 0x8A01
ROW_MESSAGE, TEXT_MESSAGE = "AXRW", "AXTX"
ROW = struct.Struct("<Bq8d")
TEXT_HEAD = struct.Struct("<HH")
GPS, TRUTH_POSE, TRUTH_VELOCITY, TRUTH_BIASES = 252, 253, 254, 255
VECTORS = frozenset({"gyro_rad_s", "accel_m_s2", "position_m"})
ROW_DTYPE = np.dtype([("source", "u1"), ("t_ns", "<i8"), ("values", "<f8", (WIDTH,))])


def exact_text(flight: Flight) -> str:
    """The flight's description as one text."""
    return json.dumps(description(flight))


def exact_rows(flight: Flight) -> NDArray[Any]:
    """Rows of all readings but pictures, and of the references, in time order; fields source, t_ns, values (8,)."""
    config = _without_cameras(flight.config)
    events = pack_tables(config, flight.tables_for(config))
    parts = [(events.source, reading_stamps(config, events), events.values)]
    if flight.truth is not None:
        truth = flight.truth
        parts.append(_part(TRUTH_POSE, truth.t_ns, truth.position_m, truth.quaternion_WB))
        parts.append(_part(TRUTH_VELOCITY, truth.t_ns, truth.velocity_m_s))
        if truth.gyro_bias is not None and truth.accel_bias is not None:
            parts.append(_part(TRUTH_BIASES, truth.t_ns, truth.gyro_bias, truth.accel_bias))
    if flight.gps is not None:
        parts.append(_part(GPS, flight.gps.t_ns, flight.gps.position_m, flight.gps.velocity_m_s))
    rows = np.zeros(sum(len(part[1]) for part in parts), dtype=ROW_DTYPE)
    for name, column in zip(("source", "t_ns", "values"), zip(*parts, strict=True), strict=True):
        rows[name] = np.concatenate(column)
    return rows[np.argsort(rows["t_ns"], kind="stable")]


def row_sum(row: bytes) -> int:
    """Checksum of a packed row, for formats whose messages have none of their own."""
    return zlib.crc32(row) & 0xFFFF


def text_pieces(text: str, size: int) -> Iterator[tuple[int, int, bytes]]:
    """Number, count and bytes of the pieces of a text."""
    data = text.encode()
    count = -(-len(data) // size)
    for number in range(count):
        yield number, count, data[number * size : (number + 1) * size]


def flight_from_rows(path: Path, text: str, rows: NDArray[Any], drops: DropLog) -> Flight:
    """Flight from its description and rows.

    Raises
    ------
    FlightError
        The description cannot be used.
    """
    try:
        about: dict[str, str] = json.loads(text)
        config = Config.from_dict(parse(about["config"], where=f"{path}: config"), where=f"{path}: config")
    except (ConfigError, KeyError, ValueError) as error:
        raise FlightError(f"{path}: the description of the flight is damaged: {error}") from None
    plain = _without_cameras(config)
    cameras = set(config.sensor) - set(plain.sensor)
    drops.add(path.name, "camera that this format cannot carry: left out", len(cameras), ", ".join(sorted(cameras)))
    tables = {name: _table(rows, index, name, plain) for index, name in enumerate(fused_sensors(plain))}
    window = tuple(float(about[key]) if key in about else None for key in EVALUATION_KEYS)
    return Flight(
        name=about.get("name") or path.stem,
        path=path,
        info={key: about[key] for key in ("source", "licence", "note") if about.get(key)},
        config=plain,
        tables=tables,
        truth=_truth(rows),
        gps=_gps(rows),
        evaluation=(window[0], window[1]),
        drops=drops.as_tuple(),
    )


def tunnel_columns(messages: Sequence[TlogMessages]) -> dict[str, NDArray[Any]] | None:
    """Columns of the TUNNEL packets that carry a flight, None if there are none."""
    for part in messages:
        if part.name == "TUNNEL" and (part.columns["payload_type"] == TEXT_TYPE).any():
            return part.columns
    return None


def flight_from_tunnels(path: Path, columns: Mapping[str, NDArray[Any]], drops: DropLog) -> Flight:
    """Flight from TUNNEL packets.

    Raises
    ------
    FlightError
        A piece of the description is missing.
    """
    kinds, lengths = columns["payload_type"], columns["payload_length"]
    payload = np.ascontiguousarray(columns["payload"])
    texts = np.flatnonzero(kinds == TEXT_TYPE)
    heads = [TEXT_HEAD.unpack_from(payload[i].tobytes()) for i in texts]
    pieces = {number: payload[i, 4 : int(lengths[i])].tobytes() for i, (number, _) in zip(texts, heads, strict=True)}
    chosen = (kinds == ROW_TYPE) & (lengths == ROW.size)
    rows = np.ascontiguousarray(payload[chosen][:, : ROW.size]).view(ROW_DTYPE).reshape(-1)
    return flight_from_rows(path, _joined(path, pieces, heads[0][1]), rows, drops)


def flight_from_bin(path: Path, messages: Mapping[str, Mapping[str, NDArray[Any]]], drops: DropLog) -> Flight:
    """Flight from the messages of a ``.bin``.

    Raises
    ------
    FlightError
        A piece of the description is missing.
    """
    texts, found = messages[TEXT_MESSAGE], messages[ROW_MESSAGE]
    pieces = {
        int(n): bytes(text).ljust(64, b"\0")[: int(k)]
        for n, k, text in zip(texts["N"], texts["L"], texts["T"], strict=True)
    }
    rows = np.zeros(len(found["S"]), dtype=ROW_DTYPE)
    rows["source"], rows["t_ns"] = found["S"], found["TNs"]
    rows["values"] = np.stack([found[f"V{k}"] for k in range(WIDTH)], axis=1)
    sums = np.array([row_sum(row.tobytes()) for row in rows], dtype=np.int64)
    whole = sums == np.asarray(found["Sum"], dtype=np.int64)
    drops.add(path.name, "row with a wrong sum: left out", int((~whole).sum()), path.name)
    return flight_from_rows(path, _joined(path, pieces, int(texts["Of"][0])), rows[whole], drops)


def _joined(path: Path, pieces: Mapping[int, bytes], count: int) -> str:
    missing = [number for number in range(count) if number not in pieces]
    if missing:
        raise FlightError(
            f"{path}: {len(missing)} of {count} pieces of the flight's description are missing; give a mapping"
        )
    return b"".join(pieces[number] for number in range(count)).decode(errors="replace")


def _without_cameras(config: Config) -> Config:
    plain = {name: spec for name, spec in config.sensor.items() if not isinstance(spec, Camera)}
    return msgspec.structs.replace(config, sensor=plain)


def _part(source: int, t_ns: Stamps, *arrays: NDArray[np.float64]) -> tuple[Any, Any, Any]:
    values = np.full((len(t_ns), WIDTH), np.nan)
    block = np.hstack(arrays)
    values[:, : block.shape[1]] = block
    return np.full(len(t_ns), source), t_ns, values


def _table(rows: NDArray[Any], index: int, name: str, config: Config) -> SensorTable:
    own = rows[rows["source"] == index]
    spec = config.sensor[name]
    kind = kind_of(spec)
    assert kind is not None
    columns: dict[str, NDArray[Any]] = {}
    at = 0
    for field in COLUMNS[kind]:
        width = 3 if field in VECTORS or (field == "sigma_m" and "position_m" in columns) else 1
        values = own["values"][:, at : at + width]
        at += width
        if field.startswith("anchor"):
            columns[field] = values[:, 0].astype(np.int64)
        else:
            columns[field] = np.ascontiguousarray(values if width > 1 else values[:, 0])
    anchors = tuple(spec.anchors) if isinstance(spec, Uwb) else ()
    strange = np.zeros(len(own), dtype=np.bool_)
    fields = [field for field in columns if field.startswith("anchor")]
    for field in fields:
        strange |= columns[field] < 0
    unlisted = {row: ("?",) * len(fields) for row in np.flatnonzero(strange).tolist()}
    return SensorTable(own["t_ns"].astype(np.int64), columns, anchors, unlisted)


def _truth(rows: NDArray[Any]) -> Truth | None:
    pose, velocity, biases = (rows[rows["source"] == k] for k in (TRUTH_POSE, TRUTH_VELOCITY, TRUTH_BIASES))
    if not len(pose) or len(pose) != len(velocity):
        return None
    gyro, accel = (biases["values"][:, :3], biases["values"][:, 3:6]) if len(biases) == len(pose) else (None, None)
    stamps = pose["t_ns"].astype(np.int64)
    return Truth(stamps, pose["values"][:, :3], pose["values"][:, 3:7], velocity["values"][:, :3], gyro, accel)


def _gps(rows: NDArray[Any]) -> GpsReference | None:
    own = rows[rows["source"] == GPS]
    return GpsReference(own["t_ns"].astype(np.int64), own["values"][:, :3], own["values"][:, 3:6]) if len(own) else None
