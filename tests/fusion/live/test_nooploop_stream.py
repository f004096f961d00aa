"""The decoders on bad lines: cut, joined, damaged, foreign and hostile bytes."""

from __future__ import annotations

import os
import select
import tty
from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.nooploop.layouts import MAX_FRAME_BYTES
from axialnav.fusion.live.nooploop.serial_port import LONGEST_WAIT_NS, SerialPort, dump_blocks
from tests.fusion.live import nooploop_vectors as v
from tests.fusion.live.hostile import blocks, feed_nlink

CLEAN = NLinkDecoder().feed(v.ALL)


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


@pytest.mark.parametrize("name", [*v.BYTES, None], ids=lambda name: name or "all")
def test_a_million_random_and_mutated_bytes_do_no_harm(name: str | None) -> None:
    """Every byte is accounted for, and no more than one frame is ever kept; ten million in ``make bench-live``."""
    survived = feed_nlink(name, 1_000_000, seed=20)
    assert survived.taken == 1_000_000
    assert survived.came_out > 10
    assert survived.most_waiting <= MAX_FRAME_BYTES


def test_a_line_that_is_cut_and_comes_back(tmp_path: Path) -> None:
    """A pseudo-terminal stands for the module; its end is closed and another takes its name."""
    link = tmp_path / "uwb"
    now = [0]
    port = SerialPort(str(link), 115200, clock_ns=lambda: now[0])
    port.reopen()
    assert (port.connected, port.fileno(), port.read()) == (False, None, (0, b""))
    decoder, found = NLinkDecoder(), []
    for lap in range(2):
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(theirs))
        port.reopen()
        assert not port.connected  # not at once again after a failure
        now[0] += LONGEST_WAIT_NS
        port.reopen()
        assert port.connected
        os.write(ours, v.BYTES["NodeFrame2"])
        while len(found) <= lap:
            select.select([port.fileno()], [], [], 1.0)
            found += decoder.feed(port.read()[1])
        assert port.write(b"query")
        assert os.read(ours, 5) == b"query"
        os.close(ours)
        os.close(theirs)
        port.read()
        assert not port.connected
        port.reopen()
    assert [type(frame).__name__ for frame in found] == ["NodeFrame2"] * 2
    assert port.lost == 2


def test_a_raw_dump_gives_the_same_frames(tmp_path: Path) -> None:
    (tmp_path / "dump.bin").write_bytes(v.ALL * 5)
    decoder = NLinkDecoder()
    assert [f for block in dump_blocks(tmp_path / "dump.bin", 100) for f in decoder.feed(block)] == CLEAN * 5
