"""One flight, one digest: whatever file it is read from, whichever process or worker replays it, however it arrived."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from axialnav.fusion.live.recorder.recorder import Recorder
from axialnav.replay import cli
from axialnav.replay.flight import load_flight
from axialnav.replay.flight_writer import write_flight
from tests.replay.made_recordings import flown

FORMATS = ("copy", "log.mcap", "log.tlog", "log.bin", "log.bag", "log.ros2")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(flown(9, 6.0), tmp_path_factory.mktemp("flown") / "flight")


@pytest.fixture(scope="module")
def digest(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    return replayed(folder, tmp_path_factory.mktemp("run"))


def replayed(log: Path, out: Path) -> str:
    """Digest of what the verb writes."""
    assert cli.main(["replay", str(log), "--out", str(out)]) == 0
    found: str = json.loads((out / "metrics.json").read_text())["digest"]
    return found


def test_a_second_replay_in_the_same_process(folder: Path, digest: str, tmp_path: Path) -> None:
    assert replayed(folder, tmp_path) == digest


def test_another_flight_has_another_digest(digest: str, tmp_path: Path) -> None:
    assert replayed(write_flight(flown(10, 6.0), tmp_path / "other"), tmp_path / "run") != digest


@pytest.mark.slow
def test_another_process(folder: Path, digest: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "axialnav", "replay", str(folder), "--out", str(tmp_path)]
    subprocess.run(words, check=True, capture_output=True)
    assert json.loads((tmp_path / "metrics.json").read_text())["digest"] == digest


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_workers_of_a_sweep(folder: Path, digest: str, tmp_path: Path, workers: int) -> None:
    grid = ["--param", "imu.accel_noise_scale=1.0,2.0"]
    assert cli.main(["sweep", str(folder), *grid, "--workers", str(workers), "--out", str(tmp_path)]) == 0
    rows = parquet.read_table(tmp_path / "results.parquet").to_pylist()
    assert rows[0]["digest"] != rows[1]["digest"]
    assert digest in {row["digest"] for row in rows}


@pytest.mark.parametrize("form", FORMATS)
def test_a_converted_log(folder: Path, digest: str, tmp_path: Path, form: str) -> None:
    assert cli.main(["convert", str(folder), str(tmp_path / form)]) == 0
    assert replayed(tmp_path / form, tmp_path / "run") == digest


def test_a_recording_of_shuffled_arrivals(folder: Path, digest: str, tmp_path: Path) -> None:
    """Every reading up to 0.3 s after its stamp, each sensor in an order of its own."""
    flight = load_flight(folder)
    readings = list(flight.readings())
    rng = np.random.default_rng(5)
    arrival = [r.t_ns + int(rng.integers(0, 300_000_000)) for r in readings]
    with Recorder(tmp_path / "log.mcap", config=flight.config, about={"name": "shuffled"}) as recorder:
        for index in np.argsort(arrival, kind="stable").tolist():
            recorder.write(readings[index].sensor, arrival[index], readings[index])
    assert replayed(tmp_path / "log.mcap", tmp_path / "run") == digest
