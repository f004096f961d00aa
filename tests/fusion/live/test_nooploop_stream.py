"""The decoders on bad lines: cut, joined, damaged, foreign and hostile bytes."""

from __future__ import annotations

import os
import tty
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.nooploop.layouts import MAX_FRAME_BYTES
from axialnav.fusion.live.nooploop.serial_port import SerialPort, dump_blocks
from tests.fusion.live import nooploop_vectors as v

CLEAN = NLinkDecoder().feed(v.ALL)


def blocks(data: bytes, rng: np.random.Generator, longest: int) -> list[bytes]:
    """The bytes cut at random places."""
    cuts = np.cumsum(rng.integers(1, longest + 1, size=2 * len(data) // longest + 2))
    edges = [0, *cuts[cuts < len(data)].tolist(), len(data)]
    return [data[a:b] for a, b in pairwise(edges)]


@pytest.mark.parametrize("longest", [1, 2, 7, 64, 4096])
def test_how_the_bytes_are_cut_does_not_matter(longest: int) -> None:
    decoder = NLinkDecoder()
    found = [
        frame for block in blocks(v.ALL * 3, np.random.default_rng(longest), longest) for frame in decoder.feed(block)
    ]
    assert found == CLEAN * 3
    assert decoder.status.skipped_bytes == 0


@pytest.mark.parametrize("name", v.BYTES)
def test_frames_are_found_between_foreign_bytes(name: str) -> None:
    rng = np.random.default_rng(1)
    noise = bytes(rng.integers(0, 0x50, size=300, dtype=np.uint8))
    decoder = NLinkDecoder(only=[name])
    found = decoder.feed(noise + v.BYTES[name] + noise + v.BYTES[name] + noise)
    assert found == [frame for frame in CLEAN if type(frame).__name__ == name] * 2
    assert decoder.status.skipped_bytes == 900


@pytest.mark.parametrize("name", [name for name in v.BYTES if name != "AnchorFrame0"])
def test_every_single_damaged_byte_is_noticed(name: str) -> None:
    """The sum sees every change of one byte; nothing but frames hidden inside may come out instead."""
    good = v.BYTES[name][:64] if name == "NodeFrame4" else v.BYTES[name]
    for place in range(len(good)):
        bad = good[:place] + bytes([good[place] ^ 0x24]) + good[place + 1 :]
        assert NLinkDecoder(only=[name]).feed(bad) == []


def test_a_damaged_frame_costs_only_itself() -> None:
    decoder = NLinkDecoder()
    bad = bytearray(v.BYTES["NodeFrame2"])
    bad[60] ^= 0xFF
    found = decoder.feed(v.BYTES["NodeFrame3"] + bytes(bad) + v.BYTES["NodeFrame3"])
    assert [type(frame).__name__ for frame in found] == ["NodeFrame3", "NodeFrame3"]
    assert decoder.status.damaged == {"NodeFrame2": 1}
    assert decoder.status.skipped_bytes == len(bad)


def test_an_unknown_frame_is_named_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="no frame named NodeFrame7; there are AnchorFrame0"):
        NLinkDecoder(only=["NodeFrame7"])


def mutated(rng: np.random.Generator, size: int) -> bytes:
    """Real frames with bytes changed, dropped and doubled, and noise between them."""
    parts, made, frames = [], 0, list(v.BYTES.values())
    while made < size:
        frame = bytearray(frames[rng.integers(len(frames))])
        for _ in range(int(rng.integers(0, 4))):
            place, kind = int(rng.integers(len(frame))), int(rng.integers(3))
            if kind == 0:
                frame[place] = int(rng.integers(256))
            elif kind == 1:
                del frame[place:]
                frame += b"\x55"
            else:
                frame[place:place] = rng.bytes(int(rng.integers(1, 9)))
        if rng.random() < 0.3:
            frame[-1] = sum(frame[:-1]) & 0xFF  # hostile: the sum is right, the content is not
        parts.append(bytes(frame))
        made += len(frame)
    return b"".join(parts)[:size]


@pytest.mark.parametrize("name", [*v.BYTES, None], ids=lambda name: name or "all")
def test_ten_million_random_and_mutated_bytes_do_no_harm(name: str | None) -> None:
    """Half random with all heads over-represented, half mutated frames; every byte is accounted for."""
    rng = np.random.default_rng(20)
    decoder = NLinkDecoder(only=None if name is None else [name])
    sizes = {frame: len(data) for frame, data in v.BYTES.items()}
    heads = np.frombuffer(b"".join(data[:5] for data in v.BYTES.values()), dtype=np.uint8)
    ahead = mutated(rng, 500_000)
    decoded = 0
    for part in range(10):
        noise = rng.integers(0, 256, size=500_000, dtype=np.uint8)
        places = rng.integers(0, 500_000 - len(heads), size=2_000)
        for k, place in enumerate(places.tolist()):
            at = 5 * (k % (len(heads) // 5))
            noise[place : place + 5] = heads[at : at + 5]
        turned = ahead[part * 1000 :] + ahead[: part * 1000]
        for block in [*blocks(noise.tobytes(), rng, 3000), *blocks(turned, rng, 3000)]:
            for frame in decoder.feed(block):
                decoded += 1
                msgspec.to_builtins(frame)
            assert decoder.status.waiting_bytes <= MAX_FRAME_BYTES
    status = decoder.status
    assert status.total_bytes == 10_000_000
    assert sum(status.frames.values()) == decoded > 100
    assert set(status.frames) <= set(sizes)
    assert status.skipped_bytes + status.waiting_bytes < status.total_bytes


def test_a_line_that_is_cut_and_comes_back(tmp_path: Path) -> None:
    """A pseudo-terminal stands for the module; its end is closed and another takes its name."""
    link = tmp_path / "uwb"
    waits: list[float] = []
    port = SerialPort(str(link), 115200, timeout_s=0.02, clock_ns=iter(range(10**9)).__next__, sleep=waits.append)
    assert port.read()[1] == b""
    assert (port.connected, len(waits)) == (False, 1)
    decoder, found = NLinkDecoder(), []
    for _ in range(2):
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(theirs))
        port.read()
        assert port.connected
        os.write(ours, v.BYTES["NodeFrame2"])
        for _ in range(20):
            found += decoder.feed(port.read()[1])
        assert port.write(b"query")
        assert os.read(ours, 5) == b"query"
        os.close(ours)
        os.close(theirs)
        for _ in range(3):
            port.read()
        assert not port.connected
    assert [type(frame).__name__ for frame in found] == ["NodeFrame2"] * 2
    assert port.lost == 2


def test_a_raw_dump_gives_the_same_frames(tmp_path: Path) -> None:
    (tmp_path / "dump.bin").write_bytes(v.ALL * 5)
    decoder = NLinkDecoder()
    assert [f for block in dump_blocks(tmp_path / "dump.bin", 100) for f in decoder.feed(block)] == CLEAN * 5
