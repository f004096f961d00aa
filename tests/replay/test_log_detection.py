"""The reader is chosen by content; what cannot be read is one clear line, quickly."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.errors import FlightError
from axialnav.replay import cli
from axialnav.replay.convert.convert import convert
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.readers.detect import Format, detect
from tests.fusion.live.nooploop_vectors import BYTES
from tests.replay.flight_texts import full_flight

WRITTEN = {"a.mcap": Format.MCAP, "a.tlog": Format.TLOG, "a.bin": Format.DATAFLASH, "a.bag": Format.ROS1}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    flight = load_flight(full_flight(folder / "flight"))
    for name in (*WRITTEN, "a.ros2"):
        convert(flight, folder / name)
    return folder


@pytest.mark.parametrize("name", WRITTEN)
def test_the_name_does_not_matter(made: Path, tmp_path: Path, name: str) -> None:
    disguised = tmp_path / "disguised.ulg"
    disguised.write_bytes((made / name).read_bytes())
    assert detect(disguised) is WRITTEN[name]
    assert isinstance(load_flight(disguised), Flight)


def test_folders_are_told_apart(made: Path) -> None:
    assert detect(made / "flight") is detect(made / "flight" / "mav0") is Format.FOLDER
    assert detect(made / "a.ros2") is Format.ROS2
    assert load_flight(next((made / "a.ros2").glob("*.db3"))).name == "everything"


def test_a_nooploop_dump_is_told_by_its_frames(tmp_path: Path) -> None:
    (tmp_path / "dump").write_bytes(b"\x13\x37" + BYTES["NodeFrame3"] * 4)
    assert detect(tmp_path / "dump") is Format.NOOPLOOP


def bad_files(folder: Path) -> dict[str, Path]:
    """One of every kind of file that is no log."""
    noise = np.random.default_rng(5).integers(0, 256, size=200_000, dtype=np.uint8).tobytes()
    files = {
        "empty": b"",
        "one byte": b"\x00",
        "text": b"hello\nworld\n" * 100,
        "noise": noise,
        "zeros": bytes(100_000),
        "gzip": b"\x1f\x8b\x08" + noise[:5000],
        "zip": b"PK\x03\x04" + noise[:5000],
        "half an mcap": b"\x89MCAP0\r\n",
        "mcap of noise": b"\x89MCAP0\r\n" + noise,
        "ulog head": b"ULog\x01\x12\x35\x01" + bytes(8),
        "ulog of noise": b"ULog\x01\x12\x35\x01" + bytes(8) + noise,
        "bin of noise": b"\xa3\x95\x80" + noise,
        "bag of noise": b"#ROSBAG V2.0\n" + noise,
        "sqlite of noise": b"SQLite format 3\0" + noise,
        "nooploop without numbers": BYTES["NodeFrame0"] * 10,
        "a video of noise.mp4": noise,
    }
    for name, data in files.items():
        (folder / name).write_bytes(data)
    with (folder / "sparse").open("wb") as file:
        file.truncate(2 << 30)
    with (folder / "sparse.mcap").open("wb") as file:
        file.write(b"\x89MCAP0\r\n")
        file.truncate(2 << 30)
    (folder / "empty folder").mkdir()
    (folder / "other folder").mkdir()
    (folder / "other folder" / "notes.txt").write_text("nothing")
    os.mkfifo(folder / "pipe")
    names = [*files, "sparse", "sparse.mcap", "empty folder", "other folder", "pipe", "absent"]
    return {name: folder / name for name in names}


BAD = [
    *("empty", "one byte", "text", "noise", "zeros", "gzip", "zip", "half an mcap", "mcap of noise", "ulog head"),
    *("ulog of noise", "bin of noise", "bag of noise", "sqlite of noise", "nooploop without numbers"),
    *("a video of noise.mp4", "sparse", "sparse.mcap", "empty folder", "other folder", "pipe", "absent"),
]


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return bad_files(tmp_path_factory.mktemp("bad"))


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_log_is_one_line_that_names_it(
    bad: dict[str, Path], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    began = time.process_time()
    assert cli.main(["replay", str(bad[name])]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert str(bad[name]) in captured.err
    assert "defect" not in captured.err
    assert len(captured.err) < 700
    assert time.process_time() - began < 20.0  # processor time: reading 2 GB of nothing would take far longer


@pytest.mark.parametrize("name", [*WRITTEN, "a.ros2"])
def test_a_log_cut_anywhere_is_read_up_to_there_or_refused_in_one_line(made: Path, tmp_path: Path, name: str) -> None:
    """Nothing but a FlightError comes out, and the longer the piece, the more rows there are."""
    source = made / name if name != "a.ros2" else next((made / name).glob("*.db3"))
    whole = source.read_bytes()
    rows: list[int] = []
    refused: list[str] = []
    for part in range(1, 13):
        path = tmp_path / f"cut{part}"
        path.write_bytes(whole[: len(whole) * part // 12])
        try:
            flight = load_flight(path)
        except FlightError as error:
            refused.append(str(error))
            rows.append(0)
        else:
            rows.append(sum(map(len, flight.tables.values())))
    assert "\n" not in "".join(refused)
    assert rows == sorted(rows)
    assert rows[-1] > 400
    if name in {"a.mcap", "a.tlog", "a.bin"}:
        assert rows[8] > 0.4 * rows[-1]


@pytest.mark.parametrize("name", WRITTEN)
def test_damaged_logs_are_read_or_refused(made: Path, tmp_path: Path, name: str) -> None:
    whole = (made / name).read_bytes()
    rng = np.random.default_rng(8)
    read = 0
    refused: list[str] = []
    for trial in range(30):
        data = bytearray(whole)
        for place in rng.integers(16, len(data), size=1 + 4 * trial).tolist():
            data[place] = int(rng.integers(256))
        path = tmp_path / f"damaged{trial}"
        path.write_bytes(data)
        try:
            load_flight(path)
            read += 1
        except FlightError as error:
            refused.append(str(error))
    assert "\n" not in "".join(refused)
    assert read >= (8 if name != "a.bag" else 0)


def test_the_line_stands_alone_in_a_pipe(bad: dict[str, Path]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "axialnav", "convert", str(bad["noise"]), "out.mcap"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert done.stdout == ""
    assert "no known format" in done.stderr
