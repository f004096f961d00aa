"""Messages to bytes and back (CDR as ROS 2 uses it), whole channels at a time where their layout repeats.

The layout of a message depends on nothing but the lengths of its texts and sequences.  So the first message of a
channel is walked field by field, and all others with the same lengths are read with one :func:`numpy.frombuffer`.

Source: OMG DDSI-RTPS, "Common Data Representation", version 1; every value is aligned to its own size, counted from
behind the four bytes that name the byte order.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.live.recorder.definition import Field, parse_definition

HEAD = b"\x00\x01\x00\x00"
HEAD_BYTES = 4
MAX_ELEMENTS = 1 << 16
_STRUCT_CODES = {"?": "?", "u1": "B", "i1": "b", "u2": "H", "i2": "h", "u4": "I", "i4": "i", "u8": "Q", "i8": "q"}
_STRUCT_CODES |= {"f4": "f", "f8": "d"}


@dataclass
class _Layout:
    """Where everything stands in messages of one shape: (path, numpy code, place, count) and the places of lengths."""

    leaves: list[tuple[str, str, int, int | None]] = field(default_factory=list)
    lengths: list[tuple[int, int]] = field(default_factory=list)
    elements: int | None = None
    end: int = HEAD_BYTES


@dataclass(frozen=True)
class Decoded:
    """Columns of one channel.

    Attributes
    ----------
    message
        Index of the message that each row comes from, shape (n,), ascending.  A message with a sequence of messages
        gives one row per element.
    columns
        Dotted name -> values: (n,) numbers or texts, (n, k) for arrays; sequences of numbers are bytes objects.
    refused
        How many messages could not be read.
    """

    message: NDArray[np.int64]
    columns: dict[str, NDArray[Any]]
    refused: int


class Codec:
    """Encoder and decoder of one message type.

    Raises
    ------
    ValueError
        The definition cannot be understood.
    """

    def __init__(self, name: str, definition: str) -> None:
        self.fields = parse_definition(name, definition)
        self._structs: dict[tuple[int, ...], struct.Struct] = {}

    def encode(self, values: Sequence[Any]) -> bytes:
        """Message from its numbers, texts and bytes in the order of the definition, arrays spread out."""
        spread: list[Any] = []
        lengths: list[int] = []
        for value in values:
            if isinstance(value, str):
                text = value.encode() + b"\0"
                lengths.append(len(text))
                spread += [len(text), text]
            elif isinstance(value, bytes):
                lengths.append(len(value))
                spread += [len(value), value]
            else:
                spread.append(value)
        key = tuple(lengths)
        packer = self._structs.get(key)
        if packer is None:
            if len(self._structs) > 256:
                self._structs.clear()
            packer = self._structs[key] = struct.Struct(_format(self.fields, list(lengths)))
        return HEAD + packer.pack(*spread)

    def decode(self, payloads: Sequence[bytes | memoryview]) -> Decoded:
        """Columns of all messages that can be read."""
        parts: list[tuple[NDArray[np.int64], dict[str, NDArray[Any]]]] = []
        refused = 0
        for group in _by_length(payloads):
            left = group
            while len(left):
                try:
                    layout = _walk(self.fields, payloads[left[0]])
                except (struct.error, IndexError, ValueError, UnicodeDecodeError):
                    refused += 1
                    left = left[1:]
                    continue
                block = np.frombuffer(b"".join([payloads[i] for i in left]), dtype=np.uint8).reshape(len(left), -1)
                same = _alike(block, layout)
                parts.append(_columns(block[same], left[same], layout))
                left = left[~same]
        return _joined(parts, refused)


def _format(fields: tuple[Field, ...], lengths: list[int]) -> str:
    """Format of :mod:`struct` for a message with texts and sequences of these lengths."""
    codes, place = ["<"], 0

    def put(code: str, size: int, times: int = 1) -> None:
        """Add numbers of ``size`` bytes, aligned."""
        nonlocal place
        pad = -place % size
        codes.append("x" * pad + (code if times == 1 else f"{times}{code}"))
        place += pad + size * times

    def walk(members: tuple[Field, ...]) -> None:
        """Add the fields of a message."""
        nonlocal place
        for member in members:
            if member.kind == "message":
                if member.count == -1:
                    put("I", 4)  # its length, which has to be 0: no message that we write needs elements
                    continue
                for _ in range(member.count or 1):
                    walk(member.fields)
            elif member.kind == "text" or (member.count == -1 and member.kind == "u1"):
                length = lengths.pop(0)
                put("I", 4)
                codes.append(f"{length}s")
                place += length
            else:
                size = np.dtype(member.kind).itemsize
                for _ in range(1 if member.count is None else member.count):
                    put(_STRUCT_CODES[member.kind], size)

    walk(fields)
    return "".join(codes)


def _by_length(payloads: Sequence[bytes | memoryview]) -> list[NDArray[np.int64]]:
    sizes = np.array([len(payload) for payload in payloads], dtype=np.int64)
    return [np.flatnonzero(sizes == size) for size in np.unique(sizes)]


class _Walker:
    """Goes through one message field by field and notes where everything stands."""

    def __init__(self, data: bytes | memoryview) -> None:
        if data[1] not in (0, 1):
            raise ValueError("not plain CDR")
        self._data = data
        self._order = "<" if data[1] == 1 else ">"
        self.layout = _Layout()

    def members(self, fields: tuple[Field, ...], prefix: str = "") -> None:
        """All fields of a message."""
        for member in fields:
            (self._one if member.count is None else self._several)(member, prefix + member.name)

    def _align(self, size: int) -> None:
        self.layout.end += -(self.layout.end - HEAD_BYTES) % size

    def _length(self) -> int:
        self._align(4)
        count: int = struct.unpack_from(self._order + "I", self._data, self.layout.end)[0]
        self.layout.lengths.append((self.layout.end, count))
        self.layout.end += 4
        if count > len(self._data):
            raise ValueError("a length beyond the message")
        return count

    def _one(self, member: Field, path: str) -> None:
        if member.kind == "message":
            self.members(member.fields, path + ".")
        elif member.kind == "text":
            self._raw(path, "text", self._length())
        else:
            self._numbers(path, member.kind, None)

    def _several(self, member: Field, path: str) -> None:
        count = self._length() if member.count == -1 else member.count or 0
        if member.kind in {"message", "text"}:
            if count > MAX_ELEMENTS:
                raise ValueError("too many elements")
            if member.kind == "message" and self.layout.elements is None:
                self.layout.elements = count
            for element in range(count):
                self._one(member, f"{path}[{element}]")
        elif member.count == -1:
            size = np.dtype(member.kind).itemsize
            self._align(size if count else 1)
            self._raw(path, "bytes", size * count)
        else:
            self._numbers(path, member.kind, count)

    def _numbers(self, path: str, kind: str, count: int | None) -> None:
        size = np.dtype(kind).itemsize
        self._align(1 if count == 0 else size)
        self.layout.leaves.append((path, self._order + kind if size > 1 else kind, self.layout.end, count))
        self.layout.end += size * (1 if count is None else count)

    def _raw(self, path: str, kind: str, size: int) -> None:
        self.layout.leaves.append((path, kind, self.layout.end, size))
        self.layout.end += size


def _walk(fields: tuple[Field, ...], data: bytes | memoryview) -> _Layout:
    """Layout of one message."""
    walker = _Walker(data)
    walker.members(fields)
    if walker.layout.end > len(data):
        raise ValueError("the message is too short")
    return walker.layout


def _alike(block: NDArray[np.uint8], layout: _Layout) -> NDArray[np.bool_]:
    """Which messages of equal size have the same lengths inside."""
    same: NDArray[np.bool_] = block[:, 1] == block[0, 1]
    for place, _ in layout.lengths:
        same &= (block[:, place : place + 4] == block[0, place : place + 4]).all(axis=1)
    return same


def _columns(
    block: NDArray[np.uint8], rows: NDArray[np.int64], layout: _Layout
) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]]]:
    flat = {path: _column(block, kind, place, count) for path, kind, place, count in layout.leaves}
    if not layout.elements:
        return rows, flat
    count = layout.elements
    columns: dict[str, NDArray[Any]] = {}
    for path, array in flat.items():
        name = path.replace("[0]", "[]", 1)
        if "[0]" in path and f"{path.partition('[0]')[0]}[{count - 1}]" + path.partition("[0]")[2] in flat:
            head, _, tail = path.partition("[0]")
            columns[name] = np.stack([flat[f"{head}[{k}]{tail}"] for k in range(count)], axis=1).reshape(
                len(block) * count, *array.shape[1:]
            )
        elif "[" not in path:
            columns[path] = np.repeat(array, count, axis=0)
    return np.repeat(rows, count), columns


def _column(block: NDArray[np.uint8], kind: str, place: int, count: int | None) -> NDArray[Any]:
    if kind in {"text", "bytes"}:
        raw = [row[place : place + (count or 0)].tobytes() for row in block]
        if kind == "bytes":
            out = np.empty(len(raw), dtype=object)
            out[:] = raw
            return out
        distinct, inverse = np.unique(np.array(raw, dtype=object), return_inverse=True)
        return np.array([text.rstrip(b"\0").decode(errors="replace") for text in distinct], dtype=object)[inverse]
    dtype = np.dtype(kind)
    shape = (len(block),) if count is None else (len(block), count)
    part = np.ascontiguousarray(block[:, place : place + dtype.itemsize * (1 if count is None else count)])
    return part.view(dtype).reshape(shape).astype(dtype.newbyteorder("="))


def _joined(parts: list[tuple[NDArray[np.int64], dict[str, NDArray[Any]]]], refused: int) -> Decoded:
    """Parts put together in the order of the messages; a column that a part lacks is left out altogether."""
    parts = [part for part in parts if len(part[0])]
    nested = [part for part in parts if any("[]" in name for name in part[1])]
    parts = nested or parts
    if not parts:
        return Decoded(np.zeros(0, dtype=np.int64), {}, refused)
    message = np.concatenate([rows for rows, _ in parts])
    order = np.argsort(message, kind="stable")
    names = [name for name in parts[0][1] if all(name in columns for _, columns in parts)]
    columns = {
        name: np.concatenate([part[name] for _, part in parts])[order]
        for name in names
        if len({part[name].shape[1:] for _, part in parts}) == 1
    }
    return Decoded(message[order], columns, refused)
