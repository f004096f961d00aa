"""Bytes that mean harm: noise full of frame heads, mutated frames, and frames with right sums and any content."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink

from axialnav.fusion.live.autopilot import Autopilot
from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.receiver import Receiver
from axialnav.fusion.live.vehicle import Inputs, Vehicle
from tests.fusion.live import nooploop_vectors as vectors
from tests.fusion.live.streamed import streamed_flight

BLOCK_BYTES = 3000
CHUNK_BYTES = 100_000
MAVLINK_NAMES = (
    *("HEARTBEAT", "HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "ATTITUDE_QUATERNION", "DISTANCE_SENSOR", "OPTICAL_FLOW"),
    *("OPTICAL_FLOW_RAD", "VISION_POSITION_ESTIMATE", "TIMESYNC", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"),
)
Change = Callable[[bytearray, np.random.Generator], bytes]


@dataclass(frozen=True)
class Survived:
    """What became of a run: bytes taken, frames or messages that came out, the most bytes that ever waited inside."""

    taken: int
    came_out: int
    most_waiting: int


def blocks(data: bytes, rng: np.random.Generator, longest: int = BLOCK_BYTES) -> list[bytes]:
    """The bytes cut at random places."""
    cuts = np.cumsum(rng.integers(1, longest + 1, size=2 * len(data) // longest + 2))
    edges = [0, *cuts[cuts < len(data)].tolist(), len(data)]
    return [data[a:b] for a, b in pairwise(edges)]


def hostile(total: int, frames: list[bytes], mend: Change, rng: np.random.Generator) -> Iterator[bytes]:
    """Blocks of ``total`` bytes together: half noise in which the frames' heads abound, half mutated frames."""
    heads = [np.frombuffer(frame[:5], dtype=np.uint8) for frame in frames]
    made = 0
    while made < total:
        size = min(CHUNK_BYTES, total - made)
        if made // CHUNK_BYTES % 2:
            data = mutated(frames, size, mend, rng)
        else:
            noise = rng.integers(0, 256, size=size, dtype=np.uint8)
            for k, place in enumerate(rng.integers(0, max(size - 5, 1), size=size // 250).tolist()):
                head = heads[k % len(heads)][: size - place]
                noise[place : place + len(head)] = head
            data = noise.tobytes()
        made += size
        yield from blocks(data, rng)


def mutated(frames: list[bytes], size: int, mend: Change, rng: np.random.Generator) -> bytes:
    """Frames with bytes changed, dropped and doubled; three in ten get right sums again by ``mend``."""
    parts, made = [], 0
    while made < size:
        frame = bytearray(frames[rng.integers(len(frames))])
        for _ in range(int(rng.integers(0, 4))):
            place, kind = int(rng.integers(len(frame))), int(rng.integers(3))
            if kind == 0:
                frame[place] = int(rng.integers(256))
            elif kind == 1:
                del frame[place:]
                frame += frames[0][:1]
            else:
                frame[place:place] = rng.bytes(int(rng.integers(1, 9)))
        parts.append(mend(frame, rng) if rng.random() < 0.3 else bytes(frame))
        made += len(parts[-1])
    return b"".join(parts)[:size]


def mended_nlink(frame: bytearray, rng: np.random.Generator) -> bytes:
    """A frame whose sum is right, whatever is in it."""
    frame[-1] = sum(frame[:-1]) & 0xFF
    return bytes(frame)


def mended_mavlink(frame: bytearray, rng: np.random.Generator) -> bytes:
    """A message of the listed sender with any content and a right checksum."""
    kind = mavlink.mavlink_map[getattr(mavlink, f"MAVLINK_MSG_ID_{MAVLINK_NAMES[rng.integers(len(MAVLINK_NAMES))]}")]
    size = struct.calcsize(kind.unpacker.format)
    payload = bytearray(rng.bytes(size))
    if rng.random() < 0.5:  # the special numbers of floats
        special = struct.pack("<f", (np.nan, np.inf, -np.inf, 3.4e38, -0.0)[rng.integers(5)])
        at = 4 * int(rng.integers(max(size // 4, 1)))
        payload[at : at + 4] = special
    head = struct.pack("<BBBBBBB", size, 0, 0, int(rng.integers(256)), 1, 1, kind.id & 0xFF)
    body = head + (kind.id >> 8).to_bytes(2, "little") + bytes(payload[:size])
    crc = mavlink.x25crc(body)
    crc.accumulate(bytes([kind.crc_extra]))
    return b"\xfd" + body + struct.pack("<H", crc.crc)


def mavlink_frames() -> list[bytes]:
    """Packets as an autopilot sends them."""
    packer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    rng = np.random.default_rng(0)
    return [bytes(m) for m in (mended_mavlink(bytearray(), rng) for _ in range(40))] + [
        bytes(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3).pack(packer))
    ]


def feed_nlink(name: str | None, total: int, seed: int) -> Survived:
    """Hostile bytes into the decoder of one kind of frame, or of all; raises if the decoder does."""
    rng, decoder = np.random.default_rng(seed), NLinkDecoder(only=None if name is None else [name])
    came_out = most = 0
    for block in hostile(total, list(vectors.BYTES.values()), mended_nlink, rng):
        for frame in decoder.feed(block):
            came_out += 1
            msgspec.to_builtins(frame)
        most = max(most, decoder.status.waiting_bytes)
    status = decoder.status
    assert sum(status.frames.values()) == came_out
    assert status.skipped_bytes + status.waiting_bytes < status.total_bytes
    return Survived(status.total_bytes, came_out, most)


def feed_mavlink(key: bytes | None, total: int, seed: int) -> Survived:
    """Hostile bytes into the parser, and what comes out of it into everything that takes messages."""
    rng, now = np.random.default_rng(seed), 1_000_000_000_000
    receiver = Receiver([(1, 1)], key=key, ticks=lambda: 10**16)
    inputs = Inputs(flow="flow0", range={"range0": 25}, vision="uwb0")
    vehicle = Vehicle(filter=streamed_flight().config, input=inputs)
    sent: list[Any] = []
    autopilot = Autopilot(vehicle, lambda message: sent.append(message) is None, lambda: now, lambda _: None)
    taken = came_out = most = 0
    for block in hostile(total, mavlink_frames(), mended_mavlink, rng):
        now += 1_000_000
        taken += len(block)
        for message in receiver.feed(block, now):
            autopilot.take(message, now)
            came_out += 1
        autopilot.tick(now)
        autopilot.sentence(now, sending=True, why_not="", bad_signatures=0)
        autopilot.status(now)
        for message in sent:
            message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=197))
        sent.clear()
        most = max(most, len(receiver._parser.buf))
    assert len(receiver.all_counts()) < 100
    return Survived(taken, came_out, most)
