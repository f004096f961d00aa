"""What kind of recording a path holds, told by its first bytes."""

from __future__ import annotations

import struct
from enum import Enum
from pathlib import Path

from axialnav.fusion.errors import FlightError

HEAD_BYTES = 1 << 16
MCAP_MAGIC = b"\x89MCAP0\r\n"
MAVLINK_STARTS = (0xFD, 0xFE)
VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mkv", ".mov", ".webm"})
YEAR_2005_US, YEAR_2100_US = 1_104_537_600_000_000, 4_102_444_800_000_000
FOREIGN = {
    b"\x1f\x8b": "gzip: unpack it",
    b"PK\x03\x04": "a zip archive: unpack it",
    b"\x89HDF": "HDF5, which is not read: convert it to a flight folder",
    b"\x89PNG": "a picture: give the folder that holds mav0/",
    b"\xff\xd8\xff": "a picture: give the folder that holds mav0/",
    b"%PDF": "a PDF document",
    b"PAR1": "Parquet: is the run folder meant? give the recording",
    b"\x7fELF": "a program",
}
KNOWN = "flight folder, MCAP, ROS bag, MAVLink .tlog, ArduPilot .bin, PX4 .ulg, Nooploop dump, video with CSV"


class Format(Enum):
    """Formats that can be read."""

    FOLDER = "flight folder"
    MCAP = "MCAP"
    ROS1 = "ROS 1 bag"
    ROS2 = "ROS 2 bag"
    ULOG = "PX4 .ulg"
    DATAFLASH = "ArduPilot .bin"
    TLOG = "MAVLink .tlog"
    NOOPLOOP = "Nooploop dump"
    VIDEO = "video with CSV"


def detect(path: Path) -> Format:
    """Format of what is at ``path``.

    Raises
    ------
    FlightError
        Nothing there, nothing in it, or nothing that is known.
    """
    try:
        if path.is_dir():
            return _folder(path)
        if not path.exists():
            raise FlightError(f"{path}: no such file or folder; give a {KNOWN}")
        if not path.is_file():
            raise FlightError(f"{path}: is neither a file nor a folder; give a {KNOWN}")
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror or error}") from None
    if not head:
        raise FlightError(f"{path}: is empty (0 bytes); was the recording copied completely?")
    found = _by_magic(head) or (Format.VIDEO if path.suffix.lower() in VIDEO_SUFFIXES else None) or _by_content(head)
    if found is None:
        raise FlightError(f"{path}: {_unknown(head)}; what is read: {KNOWN}")
    return found


def _folder(path: Path) -> Format:
    inside = {entry.name for entry in path.iterdir()}
    if "mav0" in inside or path.resolve().name == "mav0" or {"imu0", "cam0"} & inside:
        return Format.FOLDER
    if "metadata.yaml" in inside or any(name.endswith((".db3", ".mcap")) for name in inside):
        return Format.ROS2
    if any(Path(name).suffix.lower() in VIDEO_SUFFIXES for name in inside):
        return Format.VIDEO
    if not inside:
        raise FlightError(f"{path}: is an empty folder; give the folder that holds mav0/, or a log file")
    return Format.FOLDER  # whose reader knows best what to say of it


def _by_magic(head: bytes) -> Format | None:
    if head.startswith(MCAP_MAGIC):
        return Format.MCAP
    if head.startswith(b"#ROSBAG V"):
        return Format.ROS1
    if head.startswith(b"SQLite format 3\0"):
        return Format.ROS2
    if head.startswith(b"ULog\x01\x12\x35"):
        return Format.ULOG
    if head.startswith(b"\xa3\x95\x80"):
        return Format.DATAFLASH
    return None


def _by_content(head: bytes) -> Format | None:
    """Formats without a magic number: their records have to follow each other."""
    if _tlog_records(head) >= min(3, _most_records(head)):
        return Format.TLOG
    from axialnav.fusion.live.nooploop.decoder import NLinkDecoder

    decoder = NLinkDecoder()
    decoder.feed(head)
    status = decoder.status
    whole = len(head) - status.skipped_bytes - status.waiting_bytes
    if sum(status.frames.values()) >= 3 and whole > 0.3 * len(head):
        return Format.NOOPLOOP
    return None


def _most_records(head: bytes) -> int:
    """How many records a log so short can hold at least; one is too few to be sure."""
    return 3 if len(head) >= 1000 else 2


def _tlog_records(head: bytes) -> int:
    """Records from the beginning on: a big-endian microsecond stamp, then a MAVLink packet."""
    at = count = 0
    while count < 8 and at + 10 <= len(head):
        stamp = struct.unpack_from(">Q", head, at)[0]
        start = head[at + 8]
        if start not in MAVLINK_STARTS or not (stamp < YEAR_2100_US):
            break
        length = head[at + 9] + (12 if start == MAVLINK_STARTS[0] else 8)
        if start == MAVLINK_STARTS[0] and at + 10 < len(head) and head[at + 10] & 1:
            length += 13
        at += 8 + length
        count += 1
    return count


def _unknown(head: bytes) -> str:
    for start, told in FOREIGN.items():
        if head.startswith(start):
            return f"is {told}"
    if not head.strip(b"\0"):
        return f"begins with {len(head)} bytes of zero: nothing was written there"
    if head[:4096].isascii() and b"\0" not in head:
        return "is a text file, not a log"
    return f"is of no known format (first bytes {head[:8].hex(' ')})"
