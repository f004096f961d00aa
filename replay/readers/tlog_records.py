"""Messages of a MAVLink ``.tlog``, type by type as columns.

Packets are found one after another; checksums and contents are then computed for all packets of a kind at once.

Source: MAVLink developer guide ("Packet serialization"); message layouts from pymavlink's dialect.
"""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as dialect

STX1, STX2 = 0xFE, 0xFD
HEAD_BYTES = {STX1: 6, STX2: 10}
_TYPES = {"char": "u1", "float": "<f4", "double": "<f8", "uint8_t": "u1", "int8_t": "i1"}
_TYPES |= {f"{u}int{b}_t": f"<{u or 'i'}{b // 8}" for u in ("u", "") for b in (16, 32, 64)}


@dataclass(frozen=True)
class TlogMessages:
    """All messages of one kind from one sender: arrival [us since 1970], and columns by field name."""

    name: str
    sender: tuple[int, int]
    arrival_us: NDArray[np.int64]
    columns: dict[str, NDArray[Any]]


@dataclass
class TlogLog:
    """Messages by kind and sender; damaged packets, packets of unknown kinds, and bytes between packets."""

    messages: list[TlogMessages]
    damaged: int
    unknown: int
    skipped_bytes: int


def read_tlog_records(path: Path) -> TlogLog:
    """All messages of a log; damaged stretches are skipped and counted."""
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    groups: dict[tuple[int, int, int, int, int], list[int]] = {}
    skipped = unknown = 0
    at, size = 0, len(data)
    known = dialect.mavlink_map
    while at + 16 <= size:
        start = at + 8
        head = HEAD_BYTES.get(data[start])
        length = data[start + 1]
        if head is None or start + head + length + 2 > size:
            at, skipped = at + 1, skipped + 1
            continue
        if head == 10:
            kind = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
            sender, end = (data[start + 5], data[start + 6]), start + 12 + length + 13 * (data[start + 2] & 1)
        else:
            kind, sender, end = data[start + 5], (data[start + 3], data[start + 4]), start + 8 + length
        if end < size - 9 and data[end + 8] not in HEAD_BYTES:  # the next packet has to follow
            at, skipped = at + 1, skipped + 1
            continue
        if kind in known:
            groups.setdefault((kind, *sender, head, length), []).append(at)
        else:
            unknown += 1
        at = end
    raw = np.frombuffer(data, dtype=np.uint8)
    parts, damaged = _parts(raw, groups)
    return TlogLog(parts, damaged, unknown, skipped)


def _parts(
    raw: NDArray[np.uint8], groups: dict[tuple[int, int, int, int, int], list[int]]
) -> tuple[list[TlogMessages], int]:
    """Groups of one kind and sender put together in the order of the log."""
    merged: dict[tuple[int, int, int], list[tuple[NDArray[np.int64], NDArray[np.uint8]]]] = {}
    damaged = 0
    for (kind, system, component, head, length), starts in groups.items():
        places = np.array(starts, dtype=np.int64)
        block = raw[places[:, None] + np.arange(8 + head + length + 2)]
        whole = _intact(block[:, 9:], dialect.mavlink_map[kind].crc_extra)
        damaged += int((~whole).sum())
        full = _dtype(kind).itemsize
        payload = np.zeros((int(whole.sum()), full), dtype=np.uint8)
        used = min(length, full)
        payload[:, :used] = block[whole, 8 + head : 8 + head + used]
        merged.setdefault((kind, system, component), []).append((places[whole], _with_stamp(block[whole], payload)))
    out = []
    for (kind, system, component), pieces in merged.items():
        places = np.concatenate([piece[0] for piece in pieces])
        block = np.concatenate([piece[1] for piece in pieces])[np.argsort(places, kind="stable")]
        if len(block):
            arrival = np.ascontiguousarray(block[:, :8]).view(">u8").reshape(-1).astype(np.int64)
            name = dialect.mavlink_map[kind].msgname
            out.append(TlogMessages(name, (system, component), arrival, _columns(block[:, 8:], kind)))
    return out, damaged


def _with_stamp(block: NDArray[np.uint8], payload: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.concatenate([block[:, :8], payload], axis=1)


def _intact(block: NDArray[np.uint8], extra: int) -> NDArray[np.bool_]:
    """Whether the checksum of each packet holds; ``block`` begins behind the start byte and ends with the checksum.

    Source: MCRF4XX (X.25) CRC, one byte of all packets at a time.
    """
    crc = np.full(len(block), 0xFFFF, dtype=np.uint16)
    for column in [*block[:, :-2].T, np.full(len(block), extra, dtype=np.uint8)]:
        low = column ^ (crc & 0xFF).astype(np.uint8)
        low = low ^ (low << np.uint8(4))
        wide = low.astype(np.uint16)
        crc = (crc >> 8) ^ (wide << 8) ^ (wide << 3) ^ (wide >> 4)
    told = block[:, -2].astype(np.uint16) | block[:, -1].astype(np.uint16) << 8
    return np.asarray(crc == told)


def _dtype(kind: int) -> np.dtype[Any]:
    """Fields as they stand on the wire."""
    message = dialect.mavlink_map[kind]
    types = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = []
    for name, count in zip(message.ordered_fieldnames, message.array_lengths, strict=True):
        fields.append((name, _TYPES[types[name]], (count,)) if count else (name, _TYPES[types[name]]))
    return np.dtype(fields)


def _columns(payload: NDArray[np.uint8], kind: int) -> dict[str, NDArray[Any]]:
    dtype = _dtype(kind)
    table = np.ascontiguousarray(payload).view(dtype).reshape(-1)
    return {name: table[name] for name in dtype.names or ()}
