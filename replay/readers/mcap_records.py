"""Records of an MCAP file, also of one that was cut: what stands before the cut is read, wherever it fell.

The file is mapped, not loaded: pictures stay on the disk until one is asked for.

Source: the MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from axialnav.fusion.errors import FlightError

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, METADATA, DATA_END = 3, 4, 5, 6, 12, 15
PICTURE_TYPES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image", "foxglove_msgs/msg/CompressedImage")
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
Payload = bytes | memoryview


@dataclass
class Topic:
    """All messages of one channel, in the order of the file.

    Attributes
    ----------
    name, type, definition
        Topic, message type, and the text that defines it.
    encoding
        Of the messages; ``"cdr"`` is what can be read.
    log_ns
        When each was recorded.
    payloads
        The messages; of pictures, functions that fetch them.
    """

    name: str
    type: str
    definition: str
    encoding: str
    log_ns: list[int] = field(default_factory=list)
    payloads: list[Payload] = field(default_factory=list)
    pictures: list[Callable[[], Payload]] = field(default_factory=list)

    def keep(self, data: bytes) -> None:
        """Add a message that is in memory."""
        if self.type in PICTURE_TYPES:
            self.pictures.append(lambda: data)
        else:
            self.payloads.append(data)


@dataclass
class McapLog:
    """Contents of a file: topics by channel number, metadata by name, and in words how it ended if not properly."""

    topics: dict[int, Topic] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: str = ""


def read_mcap(path: Path) -> McapLog:
    """Read all messages.

    Raises
    ------
    FlightError
        Not an MCAP file, or a compression that is not known.
    """
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise FlightError(f"{path}: is no MCAP file; its first bytes are others")
        data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    reader = _Reader(path, data)
    reader.read()
    return reader.log


class _Reader:
    def __init__(self, path: Path, data: memoryview) -> None:
        self._path, self._data = path, data
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._unpacked: tuple[int, bytes] = (-1, b"")
        self.log = McapLog()

    def read(self) -> None:
        """Go through the records up to the end of the data or the cut."""
        for opcode, start, end in self._records(self._data, len(MAGIC)):
            if opcode == DATA_END:
                return
            try:
                self._top_record(opcode, start, end)
            except struct.error:
                self.log.damage = f"the record at byte {start} is damaged and left out"
        self.log.damage = self.log.damage or f"the file ends at byte {len(self._data)} without its summary: it was cut"

    def _top_record(self, opcode: int, start: int, end: int) -> None:
        if opcode == CHUNK:
            self._chunk(start, end)
        elif opcode == METADATA:
            self._metadata(self._data[start:end])
        else:
            self._record(opcode, self._data, start, end, None)

    def _records(self, data: memoryview, at: int) -> Iterator[tuple[int, int, int]]:
        """Operation, beginning and end of each record; of a cut one only if it is a chunk."""
        while at + _RECORD.size <= len(data):
            opcode, length = _RECORD.unpack_from(data, at)
            if opcode == 0:  # no record: space that was reserved and never written
                self.log.damage = f"nothing was written from byte {at} on"
                return
            start, end = at + _RECORD.size, at + _RECORD.size + length
            if end > len(data):
                if opcode == CHUNK:
                    yield opcode, start, len(data)
                return
            yield opcode, start, end
            at = end

    def _chunk(self, start: int, end: int) -> None:
        data = self._data
        if end - start < 32:
            return
        name_length = struct.unpack_from("<I", data, start + 28)[0]
        at = start + 32 + name_length
        if at + 8 > end:
            return
        compression = bytes(data[start + 32 : at]).decode(errors="replace")
        size = struct.unpack_from("<Q", data, at)[0]
        whole = at + 8 + size <= end
        inside = data[at + 8 : min(at + 8 + size, end)]
        if not compression:
            self._inside(inside, None)
            return
        if compression not in {"zstd", "lz4"}:
            raise FlightError(f"{self._path}: chunks are compressed with {compression!r}; there are zstd and lz4")
        if whole:
            place = at + 8, at + 8 + size
            self._inside(memoryview(self._unpack(*place, compression)), (*place, compression))
        else:
            self.log.damage = f"the file was cut inside a compressed chunk at byte {at}, which is lost"

    def _unpack(self, start: int, end: int, compression: str) -> bytes:
        """A chunk's records; the latest is kept, because pictures are asked for one after another."""
        if self._unpacked[0] != start:
            packed = bytes(self._data[start:end])
            try:
                if compression == "zstd":
                    import zstandard

                    unpacked = zstandard.ZstdDecompressor().decompressobj().decompress(packed)
                else:
                    import lz4.frame

                    unpacked = bytes(lz4.frame.decompress(packed))
            except Exception as error:  # each library has an error class of its own
                self.log.damage = f"a chunk at byte {start} cannot be decompressed: {error}"
                unpacked = b""
            self._unpacked = start, unpacked
        return self._unpacked[1]

    def _inside(self, data: memoryview, packed: tuple[int, int, str] | None) -> None:
        for opcode, start, end in self._records(data, 0):
            self._record(opcode, data, start, end, packed)

    def _record(self, opcode: int, data: memoryview, start: int, end: int, packed: tuple[int, int, str] | None) -> None:
        if opcode == MESSAGE and end - start >= _MESSAGE.size:
            channel, _, log_ns, _ = _MESSAGE.unpack_from(data, start)
            topic = self.log.topics.get(channel)
            if topic is None:
                return
            topic.log_ns.append(log_ns)
            begin = start + _MESSAGE.size
            if topic.type not in PICTURE_TYPES:
                topic.payloads.append(data[begin:end])
            elif packed is None:
                topic.pictures.append(lambda: data[begin:end])
            else:
                topic.pictures.append(lambda: self._unpack(*packed)[begin:end])
        elif opcode == SCHEMA:
            self._schema(data[start:end])
        elif opcode == CHANNEL:
            self._channel(data[start:end])

    def _schema(self, data: memoryview) -> None:
        number = struct.unpack_from("<H", data)[0]
        name, at = _text(data, 2)
        encoding, at = _text(data, at)
        definition, _ = _text(data, at)
        self._schemas[number] = name, encoding, definition

    def _channel(self, data: memoryview) -> None:
        number, schema = struct.unpack_from("<HH", data)
        if number in self.log.topics:
            return
        topic, at = _text(data, 4)
        encoding, _ = _text(data, at)
        name, _, definition = self._schemas.get(schema, ("", "", ""))
        self.log.topics[number] = Topic(topic, name, definition, encoding)

    def _metadata(self, data: memoryview) -> None:
        name, at = _text(data, 0)
        end = at + 4 + struct.unpack_from("<I", data, at)[0]
        at += 4
        values = {}
        while at < end:
            key, at = _text(data, at)
            values[key], at = _text(data, at)
        self.log.metadata[name] = values


def _text(data: memoryview, at: int) -> tuple[str, int]:
    """Text with its length before it, and where it ends."""
    length = struct.unpack_from("<I", data, at)[0]
    return bytes(data[at + 4 : at + 4 + length]).decode(errors="replace"), at + 4 + length
