"""The whole node on loopback: flights over a bad link, every packet accounted for; its threads; its process."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.warm_up import warm_up
from axialnav.fusion.strict_toml import dump
from tests.fusion.live.accounts import (
    PATIENCE_S,
    TAIL,
    account_for_every_message,
    account_for_every_serial_frame,
    recorded_is_what_was_pushed,
    the_recording_replays_to_the_last_bit,
    wait_for,
)
from tests.fusion.live.contract import ContractPx4
from tests.fusion.live.flown import Flown, fly
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
# half the samples and as long as it takes: a slow machine with other work keeps up
SLOW_SCENE = replace(SCENE, duration_s=90.0, still_s=3.0, imu_rate_hz=100.0)


def ask(port: int) -> dict[str, Any]:
    with (
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as connection,
        connection.makefile("rb") as file,
    ):
        status: dict[str, Any] = json.loads(file.read())
    return status


@pytest.mark.slow
def test_flights_over_a_bad_link_are_as_good_and_nothing_is_lost_uncounted(tmp_path: Path) -> None:
    """Six flights, on the clock of the node: one alone scatters by a third either way."""
    clean, fused = [], []
    for seed in range(1, 7):
        course = tmp_path / f"{seed}"
        flown = fly(replace(SCENE, seed=seed), air=replace(BAD, seed=seed), records=course)
        streamed, status = flown.streamed, flown.status
        assert flown.node.failure == ""
        account_for_every_message(streamed, status)
        account_for_every_serial_frame(streamed, status)
        assert streamed.contract.refused() == {}
        assert streamed.contract.used("ODOMETRY") > 150
        assert np.diff([m.time_usec for m in flown.sent]).min() >= 21_000
        (path,) = course.glob("*.mcap")
        recorded_is_what_was_pushed(path, status)
        the_recording_replays_to_the_last_bit(path, flown.node)
        from_s = (status["filter"]["began_ns"] - streamed.t0_ns) * 1e-9 - 1e-3
        clean.append(rms(clean_axial_errors(flown.course, from_s, 3.0, 7.8)))
        fused.append(rms(streamed.axial_errors(3.0, 7.8)))
    assert rms(np.array(fused)) < 1.1 * rms(np.array(clean))


@pytest.mark.slow
def test_a_node_with_all_its_threads_in_real_time(tmp_path: Path) -> None:
    """However late they run on a busy machine: every packet is accounted for, the recording is what was flown."""
    course = streamed_flight(SLOW_SCENE)
    streamed = StreamedVehicle(course, BAD)
    vehicle = vehicle_of(ahead(course.config), streamed.port, streamed.ttys)
    warm_up(vehicle.filter, vehicle.estimator)
    node = Node(vehicle, recording=FlightRecording(tmp_path, True, time.monotonic_ns))
    node.start()
    streamed.start()
    try:
        assert wait_for(lambda: node.output.sent > 30)
        assert wait_for(lambda: streamed.now_s() > 5.0)
        streamed.quiet()
        assert wait_for(lambda: all_has_arrived(node, streamed))
    finally:
        node.close()
        streamed.close()
    status = node.status()
    assert node.failure == ""
    assert set(status["processor_s"]) == {"wires", "plugs", "output", "tick"}
    account_for_every_message(streamed, status)
    account_for_every_serial_frame(streamed, status)
    (path,) = tmp_path.glob("*.mcap")
    recorded_is_what_was_pushed(path, status)
    the_recording_replays_to_the_last_bit(path, node)


def all_has_arrived(node: Node, streamed: StreamedVehicle) -> bool:
    """Whether the node has taken every byte that was sent."""
    status = node.status()
    link, lines = status["link"], status["nooploop"]
    taken = link["counts"]["accepted"] + link["lost"]["1/1"] + TAIL
    missing = {n: streamed.serial_bytes[n] - lines[streamed.ttys[n]]["total_bytes"] for n in streamed.serial}
    over_udp = sum(streamed.sent.values()) - sum(streamed.sent[n] for n in streamed.serial)
    return not any(missing.values()) and taken >= over_udp and not select.select([node.wires.all[0]], [], [], 0.0)[0]


@pytest.mark.slow
def test_px4_takes_the_axial_estimate() -> None:
    """The axial estimator (attitude of the autopilot, no UWB) with the profile for PX4."""
    course = streamed_flight(Scene(seed=6, duration_s=8.0, still_s=1.5, sensors=("range0", "flow0")))
    config = ahead(course.config).to_dict()
    config["sensor"]["att0"] = {"kind": "attitude"}
    config["axial"]["heading_rad"] = 0.0

    def vehicle_for(port: int, ttys: dict[str, str]) -> Vehicle:
        vehicle = vehicle_of(type(course.config).from_dict(config), port, ttys, profile="px4")
        inputs = msgspec.structs.replace(vehicle.input, attitude="att0")
        return msgspec.structs.replace(vehicle, estimator="axial", input=inputs)

    flown = Flown(course, vehicle_for, 8.0, contract=ContractPx4())
    assert flown.told.content == "axial"
    assert flown.streamed.contract.used("ODOMETRY") > 100
    assert set(flown.streamed.contract.refused()) <= {"ODOMETRY: more than 200 ms since the last"}
    assert all(np.isnan(m.x) for m in flown.sent)
    assert all(sum(m.velocity_covariance[i] for i in (0, 6, 11)) >= 50.0 for m in flown.sent)  # two axes of 25 each


@pytest.mark.slow
def test_the_verb_runs_with_the_core_alone_and_ends_cleanly_on_sigterm(tmp_path: Path) -> None:
    """Every library of the extras is made unimportable; the process answers on its status port and stops when told."""
    for library in ("cyclopts", "rich", "plotly", "jinja2", "pyarrow", "matplotlib"):
        (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError('no {library}', name='{library}')\n")
    course = streamed_flight(SLOW_SCENE)
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
        assert wait_for(lambda: ask(port)["autopilot"]["using"] is True)
        assert wait_for(lambda: streamed.contract.used("ODOMETRY") > 20)
        status = ask(port)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        streamed.close()
    assert process.returncode == 0, err
    assert err == ""
    assert out.endswith("stopped\n")
    assert "set VISO_DELAY_MS to" in out
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
        (["camera", "--config", "vehicle.toml", "--seconds", "-1"], 2, "more than 0"),
        (["camera", "--config", "nothing_there.toml"], 2, "camera.source nothing.avi: No such file or directory"),
        (["live", "--config", "nothing_there.toml"], 2, "camera.source nothing.avi: No such file or directory"),
        (["live", "--config", "backwards.toml"], 2, "filter.sensor.imu0`"),
        (["live", "--config", "no_link.toml"], 2, "mavlink.link must be udpin:"),
        (["live", "--config", "no_key.toml"], 2, "mavlink.key_file nowhere: cannot be read: No such file"),
    ],
)
def test_what_is_wrong_is_one_line(words: list[str], code: int, text: str, tmp_path: Path) -> None:
    imu = '[filter.sensor.imu0]\nkind = "imu"\n'
    cam = '[filter.sensor.cam0]\nkind = "camera"\nresolution = [64, 48]\nintrinsics = [60.0, 60.0, 32.0, 24.0]\n'
    wall = 'surface = "wall"\n[filter.surface.wall]\nnormal = [0.0, -1.0, 0.0]\n'
    for name, content in {
        "vehicle": imu,
        "nothing_there": f'[camera]\nsource = "nothing.avi"\n{imu}{cam}{wall}',
        "backwards": f"{imu}rate_hz = -3\n",
        "no_link": f'[mavlink]\nlink = "tcp:1.2.3.4:5"\n{imu}',
        "no_key": f'[mavlink]\nlink = "udpin:127.0.0.1:0"\nkey_file = "nowhere"\n{imu}',
    }.items():
        (tmp_path / f"{name}.toml").write_text(content)
    command = [sys.executable, "-m", "axialnav", *words]
    ended = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False
    )
    assert ended.returncode == code
    assert ended.stderr.count("\n") == 1
    assert text in ended.stderr
