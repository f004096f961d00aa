"""An MCAP file that grows: whole chunks or nothing, so that a full disk or a lost supply costs the last second at most.

The records come from the ``mcap`` package; its writer is not used because it cannot be told to write what it holds,
and because a failed write would leave its index pointing at chunks that are not there.  Chunks are not compressed: a
reader can then use the part of a chunk that a cut has left, and pictures, which are most of it, are compressed already.

Source: the MCAP specification (mcap.dev/spec).
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1 << 20


class McapSink:
    """Writes one MCAP file.

    Parameters
    ----------
    path
        File to create; an existing one is not overwritten.
    library
        Who wrote it.

    Raises
    ------
    OSError
        The file cannot be created or, from any method, written; what was written before stays readable.
    """

    def __init__(self, path: Path, library: str) -> None:
        self.path = path
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0), 0o644)
        self._size = 0
        self._channels: dict[str, Channel] = {}
        self._schemas: dict[str, Schema] = {}
        self._announced: set[str] = set()
        self._chunk = RecordBuilder()
        self._pending: dict[int, list[tuple[int, int]]] = {}
        self._times: tuple[int, int] | None = None
        self._chunk_index, self._chunks = bytearray(), 0
        self._metadata_index, self._metadata = bytearray(), 0
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        start = RecordBuilder()
        start.write(MAGIC)
        Header(profile="ros2", library=library).write(start)
        self._append(_taken(start))

    @property
    def written_bytes(self) -> int:
        """Size of the file."""
        return self._size

    @property
    def pending_bytes(self) -> int:
        """What waits to become a chunk."""
        return self._chunk.count

    @property
    def pending_messages(self) -> int:
        """Messages that wait to become a chunk."""
        return sum(map(len, self._pending.values()))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a table of texts."""
        record = RecordBuilder()
        Metadata(name=name, metadata=dict(values)).write(record)
        offset, data = self._size, _taken(record)
        self._append(data)
        MetadataIndex(offset=offset, length=len(data), name=name).write(record)
        self._metadata_index += _taken(record)
        self._metadata += 1

    def add(self, topic: str, kind: str, definition: str, data: bytes, *, log_ns: int, publish_ns: int) -> None:
        """Add a message to the chunk; times before zero, which MCAP does not know, become zero."""
        channel = self._channel(topic, kind, definition)
        log_ns, publish_ns = max(log_ns, 0), max(publish_ns, 0)
        self._pending.setdefault(channel.id, []).append((log_ns, self._chunk.count))
        self._times = _widened(self._times, log_ns)
        sequence = (self._counts.get(channel.id, 0) + len(self._pending[channel.id]) - 1) & 0xFFFFFFFF
        Message(channel.id, log_ns, data, publish_ns, sequence).write(self._chunk)

    def _channel(self, topic: str, kind: str, definition: str) -> Channel:
        channel = self._channels.get(topic)
        if channel is None:
            schema = self._schemas.get(kind)
            if schema is None:
                schema = Schema(id=len(self._schemas) + 1, data=definition.encode(), encoding="ros2msg", name=kind)
                self._schemas[kind] = schema
            channel = Channel(len(self._channels), topic, "cdr", {}, schema.id)
            self._channels[topic] = channel
        if topic not in self._announced:
            schema = next(s for s in self._schemas.values() if s.id == channel.schema_id)
            schema.write(self._chunk)
            channel.write(self._chunk)
            self._announced.add(topic)
        return channel

    def flush(self) -> None:
        """Write the chunk with its index; after an error its messages are gone and the file is as it was before."""
        if not self._pending or self._times is None:
            return
        data, pending, times = _taken(self._chunk), self._pending, self._times
        self._pending, self._times = {}, None
        record = RecordBuilder()
        Chunk("", data, times[1], times[0], zlib.crc32(data), len(data)).write(record)
        chunk_bytes, offsets = record.count, {}
        for channel, entries in pending.items():
            offsets[channel] = self._size + record.count
            MessageIndex(channel, entries).write(record)
        block, start = _taken(record), self._size
        try:
            self._append(block)
        except OSError:
            self._announced.clear()  # the next chunk has to say again what its channels are
            raise
        index_bytes = len(block) - chunk_bytes
        index = RecordBuilder()
        ChunkIndex(
            chunk_length=chunk_bytes,
            chunk_start_offset=start,
            compression="",
            compressed_size=len(data),
            message_end_time=times[1],
            message_index_length=index_bytes,
            message_index_offsets=offsets,
            message_start_time=times[0],
            uncompressed_size=len(data),
        ).write(index)
        self._chunk_index += _taken(index)
        self._chunks += 1
        for channel, entries in pending.items():
            self._counts[channel] = self._counts.get(channel, 0) + len(entries)
        self._span = _widened(_widened(self._span, times[0]), times[1])

    def finish(self) -> None:
        """Write what is pending and the summary, and close; the file is closed and readable after an error too."""
        try:
            self.flush()
            self._append(self._summary())
        finally:
            os.close(self._fd)
            self._fd = -1

    def _summary(self) -> bytes:
        builder, offsets = RecordBuilder(), RecordBuilder()
        DataEnd(0).write(builder)
        start = self._size + builder.count
        groups: list[tuple[Opcode, list[Schema] | list[Channel] | list[Statistics] | bytes]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_index)),
            (Opcode.METADATA_INDEX, bytes(self._metadata_index)),
        ]
        for opcode, group in groups:
            place = builder.count
            if isinstance(group, bytes):
                builder.write(group)
            else:
                for record in group:
                    record.write(builder)
            if builder.count > place:
                SummaryOffset(opcode, self._size + place, builder.count - place).write(offsets)
        offsets_start = self._size + builder.count
        builder.write(_taken(offsets))
        Footer(start, offsets_start, 0).write(builder)
        builder.write(MAGIC)
        return _taken(builder)

    def _statistics(self) -> Statistics:
        start, end = self._span or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=self._chunks,
            message_count=sum(self._counts.values()),
            message_end_time=end,
            message_start_time=start,
            metadata_count=self._metadata,
            schema_count=len(self._schemas),
        )

    def _append(self, data: bytes) -> None:
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._fd, view) :]
        except OSError:
            os.ftruncate(self._fd, self._size)
            os.lseek(self._fd, self._size, os.SEEK_SET)
            raise
        self._size += len(data)


def _widened(span: tuple[int, int] | None, time_ns: int) -> tuple[int, int]:
    return (time_ns, time_ns) if span is None else (min(span[0], time_ns), max(span[1], time_ns))


def _taken(builder: RecordBuilder) -> bytes:
    """What a builder holds, which is empty afterwards."""
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
