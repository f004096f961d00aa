"""The whole node on loopback: a flight streamed in real time over a bad link, and every packet accounted for."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.warm_up import warm_up
from axialnav.fusion.strict_toml import dump
from tests.fusion.live.accounts import (
    account_for_every_message,
    account_for_every_serial_frame,
    recorded_is_what_was_pushed,
    the_recording_replays_to_the_last_bit,
    wait_for,
)
from tests.fusion.live.contract import ContractPx4
from tests.fusion.live.streamed import (
    Air,
    StreamedVehicle,
    ahead,
    clean_axial_errors,
    rms,
    streamed_flight,
    vehicle_of,
)
from tests.fusion.made_flights import Scene
from tests.house import ROOT

SCENE = Scene(seed=4, duration_s=8.0, still_s=2.5, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)
BAD = Air(jitter_s=0.002, lost=0.05, reordered=0.05, damaged=0.10, seed=4)
# what a busy machine does between the two ends is not ours: the stamps below show when messages were made
LATE = {"ODOMETRY: within 20 ms", "ODOMETRY: late by its own clock"}
SCATTER = 1.4  # one run of five seconds scatters by +-20 %; the bench pools several and stays within 10 %


def ask(port: int) -> dict[str, Any]:
    with socket.create_connection(("127.0.0.1", port), timeout=5.0) as connection, connection.makefile("rb") as file:
        status: dict[str, Any] = json.loads(file.read())
    return status


@pytest.mark.slow
def test_a_flight_over_a_bad_link_is_as_good_and_nothing_is_lost_uncounted(tmp_path: Path) -> None:
    course = streamed_flight(SCENE)
    streamed = StreamedVehicle(course, BAD)
    vehicle = vehicle_of(ahead(course.config), streamed.port, streamed.ttys)
    warm_up(vehicle.filter, vehicle.estimator)
    recording = FlightRecording(tmp_path / "flights", True, time.monotonic_ns)
    node = Node(vehicle, recording=recording)
    node.start()
    streamed.start()
    try:
        assert wait_for(lambda: streamed.now_s() > SCENE.duration_s + 0.3, 60.0)
        status = node.status()
    finally:
        node.close()
        streamed.close()
    assert node.failure == ""
    account_for_every_message(streamed, status)
    account_for_every_serial_frame(streamed, status)
    assert not set(streamed.contract.refused()) - LATE
    assert streamed.contract.used("ODOMETRY") > 100
    sent = np.diff([m.time_usec for _, m in streamed.contract.messages if m.get_type() == "ODOMETRY"])
    assert sent.min() >= 20_000
    clean = rms(clean_axial_errors(course, 0.5, 3.0, 7.8))
    assert rms(streamed.axial_errors(3.0, 7.8)) < SCATTER * clean
    (path,) = (tmp_path / "flights").glob("*.mcap")
    recorded_is_what_was_pushed(path, status)
    the_recording_replays_to_the_last_bit(path, node)


@pytest.mark.slow
def test_px4_takes_the_axial_estimate() -> None:
    """The axial estimator (attitude of the autopilot, no UWB) with the profile for PX4."""
    scene = Scene(seed=6, duration_s=20.0, still_s=1.5, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)
    course = streamed_flight(scene)
    config = ahead(course.config).to_dict()
    config["sensor"]["att0"] = {"kind": "attitude"}
    config["axial"]["heading_rad"] = 0.0
    del config["sensor"]["uwb0"]
    streamed = StreamedVehicle(course, contract=ContractPx4())
    ttys = {"range0": streamed.ttys["range0"]}
    vehicle = vehicle_of(type(course.config).from_dict(config), streamed.port, ttys, profile="px4")
    inputs = msgspec.structs.replace(vehicle.input, attitude="att0")
    vehicle = msgspec.structs.replace(vehicle, estimator="axial", input=inputs)
    warm_up(vehicle.filter, vehicle.estimator)
    node = Node(vehicle)
    node.start()
    streamed.start()
    try:
        enough = wait_for(lambda: streamed.contract.used("ODOMETRY") > 30, scene.duration_s)
    finally:
        node.close()
        streamed.close()
    sent = [m for _, m in streamed.contract.messages if m.get_type() == "ODOMETRY"]
    assert vehicle.content == "axial"
    assert enough, node.output.withheld
    assert all(np.isnan(m.x) for m in sent)
    assert all(sum(m.velocity_covariance[i] for i in (0, 6, 11)) >= 50.0 for m in sent)  # two axes of 25 each


@pytest.mark.slow
def test_the_verb_runs_with_the_core_alone_and_ends_cleanly_on_sigterm(tmp_path: Path) -> None:
    """Every library of the extras is made unimportable; the process answers on its status port and stops when told."""
    for library in ("cyclopts", "rich", "plotly", "jinja2", "pyarrow", "matplotlib"):
        (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError('no {library}', name='{library}')\n")
    course = streamed_flight(SCENE)
    streamed = StreamedVehicle(course)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    vehicle = vehicle_of(ahead(course.config), streamed.port, streamed.ttys)
    data = msgspec.to_builtins(vehicle)
    data["status"] = {"port": port, "line_s": 0.5}
    path = tmp_path / "vehicle.toml"
    path.write_text(dump(without_none(data)), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, "-m", "axialnav", "live", "--config", str(path)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert "compiling" in process.stdout.readline()
        assert "sending: full" in process.stdout.readline()
        streamed.start()
        assert wait_for(lambda: streamed.contract.used("ODOMETRY") > 20, 20.0)
        status = ask(port)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=20.0)
    finally:
        process.kill()
        streamed.close()
    assert process.returncode == 0, err
    assert err == ""
    assert out.endswith("stopped\n")
    assert "set VISO_DELAY_MS to" in out
    assert status["autopilot"]["using"] is True
    assert status["state"]["sigma_axial_velocity_m_s"] > 0.0
    assert status["latency"]["filter"]["count"] > 100


def without_none(data: Any) -> Any:
    """TOML has no null."""
    if isinstance(data, dict):
        return {key: without_none(value) for key, value in data.items() if value is not None}
    return [without_none(v) for v in data] if isinstance(data, list) else data


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        (["live"], 2, "--config"),
        (["live", "--config", "nowhere.toml"], 2, "nowhere.toml: cannot be read"),
        (["camera", "--conf", "x"], 2, "--config"),
        (["camera", "--config", "vehicle.toml"], 2, "the vehicle file has no [camera]"),
    ],
)
def test_what_is_wrong_is_one_line(words: list[str], code: int, text: str, tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text('[filter.sensor.imu0]\nkind = "imu"\n')
    command = [sys.executable, "-m", "axialnav", *words]
    ended = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == code
    assert ended.stderr.count("\n") == 1
    assert text in ended.stderr
