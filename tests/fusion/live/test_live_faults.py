"""Faults in flight: silence within 250 ms of the node's own clock, a bounded state, and recovery by itself."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.vehicle import Status
from axialnav.fusion.live.warm_up import warm_up
from axialnav.replay.flight import load_flight
from tests.fusion.live.accounts import wait_for
from tests.fusion.live.flown import Flown, fly
from tests.fusion.live.sender_process import SenderProcess
from tests.fusion.live.streamed import ahead, streamed_flight, vehicle_of
from tests.fusion.live.test_output import VEHICLE
from tests.fusion.made_flights import Scene

pytestmark = pytest.mark.slow
SILENCE_S = 0.25
ALL = ("flow0", "range0", "uwb0")


def scene(seconds: float, seed: int, still_s: float = 1.5) -> Scene:
    return Scene(seed=seed, duration_s=seconds, still_s=still_s, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)


def test_the_autopilot_falls_silent_for_a_while() -> None:
    """Inertial samples and everything else on the link stop at 3 s for 0.8 s: bridged by the filter, not by us."""
    flown = fly(scene(6.0, 11), silent=lambda _, t: 3.0 <= t < 3.8)
    assert flown.node.failure == ""
    assert flown.spoke(2.9, 3.0)
    assert flown.silent(3.0 + SILENCE_S, 3.8)
    assert flown.spoke(4.0, 4.1)
    assert flown.status["output"]["withheld"]["no fresh inertial samples"] > 15
    assert max(flown.speeds) < 4.0
    assert np.abs(flown.streamed.axial_errors(4.3, 5.9)).max() < 0.5


def test_the_autopilot_reboots() -> None:
    """On the ground, silent from 2.2 s to 3 s, then its clock begins at zero: the filter starts anew and says so."""
    flown = fly(
        scene(8.0, 12, still_s=6.0),
        silent=lambda _, t: 2.2 <= t < 3.0,
        boot_at=lambda t, boot: boot if t < 2.8 else round((t - 2.8) * 1e9),
    )
    assert flown.node.failure == ""
    assert flown.silent(2.2 + SILENCE_S, 3.0)
    assert flown.spoke(6.0, 8.0)
    assert flown.status["autopilot"]["clock"]["restarts"] == 1
    assert flown.sent[0].reset_counter == 0
    assert flown.sent[-1].reset_counter == 1
    assert max(flown.speeds) < 6.0
    assert np.abs(flown.streamed.axial_errors(6.0, 7.9)).max() < 1.0


@pytest.mark.parametrize("step_ns", [2_000_000_000, -2_000_000_000], ids=["forward", "backward"])
def test_the_autopilot_s_clock_steps(step_ns: int) -> None:
    """By two seconds at 3 s, without a reboot: nothing with a wrong stamp reaches the filter."""
    flown = fly(scene(7.0, 13, still_s=5.0), boot_at=lambda t, boot: boot + (step_ns if t >= 3.0 else 0))
    assert flown.node.failure == ""
    assert flown.silent(3.0 + SILENCE_S, 3.4)
    assert flown.status["autopilot"]["refused"]["stamp far from arrival"] > 20
    assert flown.status["autopilot"]["clock"]["restarts"] == 1
    assert flown.spoke(5.0, 7.0)
    assert max(flown.speeds) < 6.0


def test_uwb_is_unplugged_and_comes_back(tmp_path: Path) -> None:
    """The plug is pulled at 2.8 s and put back at 3.6 s under another number."""
    plug = tmp_path / "uwb0"
    done: list[float] = []

    def meddle(flown: Flown) -> None:
        if flown.now_s > 2.8 and len(done) == 0:
            done.append(flown.now_s)
            plug.unlink()
            flown.streamed.pull("uwb0")
        if flown.now_s > 3.6 and len(done) == 1:
            done.append(flown.now_s)
            plug.symlink_to(flown.streamed.ttys["uwb0"])

    flown = fly(scene(6.5, 14), meddle=meddle, links=tmp_path)
    assert flown.node.failure == ""
    line = flown.status["nooploop"][str(plug)]
    assert line["lost"] == 1
    assert line["connected"]
    assert line["readings"] == pytest.approx(50 * (6.4 - 0.8), abs=60)  # reopened within a second of its return
    assert np.diff(flown.sent_s[flown.sent_s > 2.5]).max() < 0.05  # image motion and range finder go on
    assert {m.reset_counter for m in flown.sent} == {0}
    assert np.abs(flown.streamed.axial_errors(3.0, 6.4)).max() < 0.5


def test_the_sender_is_killed_and_another_comes(tmp_path: Path) -> None:
    """Autopilot and sensors vanish at once (SIGKILL); later others stand at the same place, clocks at zero."""
    make = partial(streamed_flight, replace(scene(60.0, 15, still_s=60.0), imu_rate_hz=100.0))
    first = SenderProcess(make)
    links = {sensor: tmp_path / sensor for sensor in first.ttys}
    for sensor, device in first.ttys.items():
        links[sensor].symlink_to(device)
    vehicle = vehicle_of(ahead(make().config), first.port, {sensor: str(link) for sensor, link in links.items()})
    warm_up(vehicle.filter, vehicle.estimator)
    node = Node(vehicle)
    node.start()
    try:
        first.wait_for_start()
        assert wait_for(lambda: node.output.sent > 5)
        first.kill()
        assert wait_for(lambda: has_nothing_to_read(node) and node.status()["filter"]["silent"] == list(ALL))
        assert wait_for(lambda: node.output.reason == "no fresh inertial samples")
        sent = node.output.sent
        second = SenderProcess(make, udp_port=first.port)
        assert node.output.sent == sent  # it took longer than a second to begin
        for sensor, device in second.ttys.items():
            links[sensor].unlink()
            links[sensor].symlink_to(device)
        second.wait_for_start()
        assert wait_for(lambda: node.output.sent > sent + 5)
        assert wait_for(lambda: {line["connected"] for line in node.status()["nooploop"].values()} == {True})
    finally:
        node.close()
    second.kill()
    assert node.failure == ""
    assert node.output.reset_counter >= 1  # another autopilot, another filter


def has_nothing_to_read(node: Node) -> bool:
    """Whether nothing that has arrived still waits on a wire."""
    files = [file for wire in node.wires.all if (file := wire.fileno()) is not None]
    try:
        return not select.select(files, [], [], 0.0)[0]
    except (OSError, ValueError):
        return False  # one was closed just now


def test_the_last_message_of_a_vanished_vehicle() -> None:
    """The same on the node's clock: everything vanishes at 3 s, the last message is younger than 250 ms."""

    def meddle(flown: Flown) -> None:
        if flown.now_s > 3.0:
            flown.streamed.quiet()

    flown = fly(scene(5.0, 15, still_s=5.0), meddle=meddle)
    assert flown.node.failure == ""
    assert flown.sent_s[-1] > 3.0
    assert flown.silent(3.0 + SILENCE_S, 6.0)
    assert flown.status["filter"]["silent"] == list(ALL)
    assert flown.status["output"]["reason"] == "no fresh inertial samples"


def test_a_recording_that_cannot_begin_is_said_and_the_flight_goes_on(tmp_path: Path) -> None:
    recording = FlightRecording(tmp_path / "disk", True, time.monotonic_ns)
    (tmp_path / "disk").rmdir()
    recording.restarted(VEHICLE.filter)
    assert "cannot be recorded to" in recording.problem
    recording.heard("mavlink_in", b"abc", 0)
    assert "cannot be recorded to" in recording.status()["problem"]
    recording.close()


def test_the_disk_is_full_for_a_while(tmp_path: Path, small_disk: Path) -> None:
    """Somebody fills the disk to the last byte at 3 s and clears it at 4 s: the flight does not notice."""
    big = small_disk / "somebody's"
    full: list[dict[str, Any]] = []

    def recording(flown: Flown) -> dict[str, Any]:
        told: dict[str, Any] = flown.node.status()["recording"]
        return told

    def settled(flown: Flown) -> bool:
        """Whether the recorder has done with all that it was given."""
        told = recording(flown)
        taken = sum(flown.node.status()["filter"]["verdicts"]["imu0"].values())
        return bool(told["written"].get("imu0", 0) + told["dropped"].get("imu0", 0) == taken)

    def meddle(flown: Flown) -> None:
        """Fill and clear; the flight goes on when the recorder, which lives in real time, has seen it."""
        if flown.now_s > 3.0 and not full and not big.exists():
            assert wait_for(lambda: settled(flown))
            with big.open("wb", buffering=0) as file, contextlib.suppress(OSError):
                while file.write(bytes(1 << 16)):
                    pass
            assert wait_for(lambda: not recording(flown)["recording"])
        if flown.now_s > 4.0 and not full:
            assert wait_for(lambda: settled(flown))
            full.append(recording(flown))
            big.unlink()
            assert wait_for(lambda: recording(flown)["recording"])

    flown = fly(scene(6.0, 16), meddle=meddle, records=small_disk)
    assert flown.node.failure == ""
    assert np.diff(flown.sent_s[flown.sent_s > 2.5]).max() < 0.05
    assert "No space left" in full[0]["problem"] or "are kept" in full[0]["problem"]
    assert flown.recorded["recording"]
    assert "resumed" in flown.recorded["problem"]
    assert flown.recorded["dropped"]["imu0"] == pytest.approx(200, abs=20)
    (path,) = small_disk.glob("*.mcap")
    inside = load_flight(path).tables["imu0"].t_ns - flown.streamed.t0_ns
    assert not ((inside > 3.05e9) & (inside < 3.95e9)).any()
    assert ((inside > 4.1e9) & (inside < 6.0e9)).sum() == 380
    taken = sum(flown.status["filter"]["verdicts"]["imu0"].values())
    assert len(inside) + flown.recorded["dropped"]["imu0"] == taken


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 24 MiB in memory."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", str(place)], capture_output=True, text=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted here: {mounted.stderr.strip()}")
    yield place
    subprocess.run(["umount", "--lazy", str(place)], check=True)


def test_a_thread_that_fails_takes_the_node_down() -> None:
    """Half a node must not look alive: systemd starts it again."""

    readable, other = os.pipe()
    os.write(other, b"!")

    class Broken:
        unsent = 0

        def fileno(self) -> int:
            return readable

        def receive(self) -> Any:
            raise RuntimeError("the driver has gone")

        def reopen(self) -> None: ...

        def send(self, data: bytes) -> bool:
            return False

        def confirm(self, address: Any) -> None: ...

        def close(self) -> None: ...

    node = Node(msgspec.structs.replace(VEHICLE, status=Status(port=0, line_s=0.0)), link=Broken())
    assert node.run() == "thread wires: RuntimeError: the driver has gone"
