"""Messages of an ArduPilot ``.bin``, type by type as columns.

The log describes itself: FMT messages say how long every other message is and what stands in it.

Source: ArduPilot, libraries/AP_Logger (format letters and multipliers).
"""

from __future__ import annotations

import mmap
import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEAD = b"\xa3\x95"
FMT_TYPE, FMT_BYTES = 0x80, 89
_LETTERS: dict[str, tuple[str, float | None]] = {
    **{"b": ("i1", None), "B": ("u1", None), "M": ("u1", None), "h": ("<i2", None), "H": ("<u2", None)},
    **{"i": ("<i4", None), "I": ("<u4", None), "q": ("<i8", None), "Q": ("<u8", None)},
    **{"f": ("<f4", None), "d": ("<f8", None), "g": ("<f2", None)},
    **{"n": ("S4", None), "N": ("S16", None), "Z": ("S64", None), "a": ("(32,)<i2", None)},
    **{"c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01), "L": ("<i4", 1e-7)},
}


@dataclass(frozen=True)
class MessageFormat:
    """What a FMT message says: name, whole length, numpy fields and the multipliers of those that have one."""

    name: str
    length: int
    dtype: np.dtype[Any]
    scales: dict[str, float]


@dataclass
class DataflashLog:
    """Columns by message name; how many bytes belonged to no message."""

    messages: dict[str, dict[str, NDArray[Any]]]
    skipped_bytes: int


def read_dataflash_records(path: Path) -> DataflashLog:
    """All messages of a log; damaged stretches are skipped and counted.  A cut log is read up to the cut."""
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    formats: dict[int, MessageFormat] = {}
    places: dict[int, list[int]] = {}
    skipped, at, size = 0, 0, len(data)
    lengths = [0] * 256
    lengths[FMT_TYPE] = FMT_BYTES
    while at + 3 <= size:
        length = lengths[data[at + 2]] if data[at : at + 2] == HEAD else 0
        if not length or at + length > size:
            following = data.find(HEAD, at + 1)
            following = size if following < 0 else following
            skipped += following - at
            at = following
            continue
        kind = data[at + 2]
        if kind == FMT_TYPE:
            found = _format(data[at + 3 : at + FMT_BYTES])
            if found is not None and lengths[found[0]] in (0, found[1].length):
                formats[found[0]], lengths[found[0]] = found[1], found[1].length
        else:
            places.setdefault(kind, []).append(at)
        at += length
    raw = np.frombuffer(data, dtype=np.uint8)
    messages = {}
    for kind, starts in places.items():
        form = formats[kind]
        index = np.array(starts, dtype=np.int64)[:, None] + np.arange(3, form.length)
        messages[form.name] = _columns(raw[index], form)
    return DataflashLog(messages, skipped)


def _format(body: bytes) -> tuple[int, MessageFormat] | None:
    """Number and format out of a FMT message, None where it makes no sense."""
    kind, length, name, letters, labels = struct.unpack("<BB4s16s64s", body)
    try:
        words = [part.rstrip(b"\0").decode("ascii") for part in (name, letters, labels)]
    except UnicodeDecodeError:
        return None
    fields = [label for label in words[2].split(",") if label]
    if not re.fullmatch(r"\w+", words[0]) or len(fields) != len(words[1]) or not set(words[1]) <= set(_LETTERS):
        return None
    if len(set(fields)) != len(fields):
        return None
    dtype = np.dtype([(field, _LETTERS[letter][0]) for field, letter in zip(fields, words[1], strict=True)])
    if dtype.itemsize + 3 != length:
        return None
    scales = {f: scale for f, c in zip(fields, words[1], strict=True) if (scale := _LETTERS[c][1]) is not None}
    return kind, MessageFormat(words[0], length, dtype, scales)


def _columns(block: NDArray[np.uint8], form: MessageFormat) -> dict[str, NDArray[Any]]:
    table = np.ascontiguousarray(block).view(form.dtype).reshape(-1)
    columns = {}
    for field in form.dtype.names or ():
        values = table[field]
        columns[field] = values * form.scales[field] if field in form.scales else values
    return columns
