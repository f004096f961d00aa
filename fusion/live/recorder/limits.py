"""What a recorder may use, and what it tells of itself."""

from __future__ import annotations

import msgspec


class RecorderStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What a recorder has done so far.

    Attributes
    ----------
    written, dropped
        Channel -> messages on disk, and messages given up.
    reasons
        Why messages were given up -> how many.
    bytes_written
        Size of the file.
    queued
        Messages that wait.
    recording, pictures
        Whether messages, and whether pictures, are being written at the moment.
    problem
        The latest trouble in words, empty if there was none.
    """

    written: dict[str, int]
    dropped: dict[str, int]
    reasons: dict[str, int]
    bytes_written: int
    queued: int
    recording: bool
    pictures: bool
    problem: str


class Limits(msgspec.Struct, frozen=True, kw_only=True):
    """How much a recorder may keep in memory and must leave on the disk, in bytes."""

    picture_queue: int = 64 << 20
    queue: int = 64 << 20
    picture_reserve: int = 256 << 20
    reserve: int = 16 << 20
