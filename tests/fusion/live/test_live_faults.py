"""Faults in flight, on loopback and in real time: silence within 250 ms, a bounded state, and recovery by itself."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
import tty
from collections.abc import Iterator
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
from tests.fusion.live.sender_process import SenderProcess
from tests.fusion.live.streamed import StreamedVehicle, ahead, axial_errors, streamed_flight, vehicle_of
from tests.fusion.live.test_output import VEHICLE
from tests.fusion.made_flights import Scene

pytestmark = pytest.mark.slow
SILENCE_S = 0.25


class Flown:
    """A streamed flight with a fault: what the node sent and what it said in the end."""

    def __init__(
        self,
        scene: Scene,
        *,
        meddle: Any = None,
        tmp_path: Path | None = None,
        records: Path | None = None,
        **faults: Any,
    ) -> None:
        self.scene = scene
        self.course = streamed_flight(scene)
        self.streamed = StreamedVehicle(self.course, **faults)
        vehicle = vehicle_of(ahead(self.course.config), self.streamed.port, self._links(tmp_path))
        warm_up(vehicle.filter, vehicle.estimator)
        records = records or (tmp_path / "flights" if tmp_path else None)
        recording = FlightRecording(records, True, time.monotonic_ns) if records else None
        self.node = Node(vehicle, recording=recording)
        self.speeds: list[float] = []
        self.node.start()
        self.streamed.start()
        try:
            while self.streamed.now_s() < scene.duration_s:
                time.sleep(0.02)
                snapshot = self.node.core.snapshot(time.monotonic_ns())
                if snapshot is not None:
                    self.speeds.append(float(np.abs(snapshot.state.velocity_m_s).max()))
                if meddle is not None:
                    meddle(self)
            self.status = self.node.status()
        finally:
            self.node.close()
            self.streamed.close()
        sent = [m for _, m in self.streamed.contract.messages if m.get_type() == "ODOMETRY"]
        self.counters = [m.reset_counter for m in sent]
        self.sent_s = np.array([(m.time_usec * 1000 - self.streamed.t0_ns) * 1e-9 for m in sent])

    def _links(self, tmp_path: Path | None) -> dict[str, str]:
        """Serial devices behind links that can be pointed elsewhere, as udev does when a plug comes back."""
        if tmp_path is None:
            return self.streamed.ttys
        links = {}
        for sensor, device in self.streamed.ttys.items():
            os.symlink(device, tmp_path / sensor)
            links[sensor] = str(tmp_path / sensor)
        return links

    def silent(self, start_s: float, end_s: float) -> bool:
        """Whether nothing was sent between two instants; stamps are the node's own."""
        return not ((self.sent_s > start_s) & (self.sent_s < end_s)).any()

    def spoke(self, start_s: float, end_s: float) -> bool:
        return bool(((self.sent_s > start_s) & (self.sent_s < end_s)).any())


def scene(seconds: float, seed: int, still_s: float = 1.5) -> Scene:
    return Scene(seed=seed, duration_s=seconds, still_s=still_s, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)


def test_the_autopilot_falls_silent_for_a_while() -> None:
    """Inertial samples and everything else on the link stop at 3 s for 0.8 s: bridged by the filter, not by us."""
    flown = Flown(scene(6.0, 11), silent=lambda _, t: 3.0 <= t < 3.8)
    assert flown.node.failure == ""
    assert flown.spoke(2.0, 3.0)
    assert flown.silent(3.0 + SILENCE_S, 3.75)
    assert flown.spoke(4.3, 6.0)
    assert flown.status["output"]["withheld"]["no fresh inertial samples"] > 5
    assert max(flown.speeds) < 4.0
    assert np.abs(flown.streamed.axial_errors(4.8, 5.9)).max() < 0.5


def test_the_autopilot_reboots() -> None:
    """On the ground, silent from 2.2 s to 3 s, then its clock begins at zero: the filter starts anew and says so."""
    flown = Flown(
        scene(8.0, 12, still_s=6.0),
        silent=lambda _, t: 2.2 <= t < 3.0,
        boot_at=lambda t, boot: boot if t < 2.8 else round((t - 2.8) * 1e9),
    )
    assert flown.node.failure == ""
    assert flown.silent(2.2 + SILENCE_S, 3.0)
    assert flown.spoke(6.5, 8.0)
    assert flown.status["autopilot"]["clock"]["restarts"] == 1
    assert flown.counters[0] == 0
    assert flown.counters[-1] >= 1
    assert max(flown.speeds) < 6.0
    assert np.abs(flown.streamed.axial_errors(6.5, 7.9)).max() < 1.0


@pytest.mark.parametrize("step_ns", [2_000_000_000, -2_000_000_000], ids=["forward", "backward"])
def test_the_autopilot_s_clock_steps(step_ns: int) -> None:
    """By two seconds at 3 s, without a reboot: nothing with a wrong stamp reaches the filter."""
    flown = Flown(scene(7.0, 13, still_s=5.0), boot_at=lambda t, boot: boot + (step_ns if t >= 3.0 else 0))
    assert flown.node.failure == ""
    assert flown.silent(3.0 + SILENCE_S, 3.3)
    assert flown.status["autopilot"]["refused"]["stamp far from arrival"] > 20
    assert flown.status["autopilot"]["clock"]["restarts"] >= 1
    assert flown.spoke(5.5, 7.0)
    assert max(flown.speeds) < 6.0


def test_uwb_is_unplugged_and_comes_back(tmp_path: Path) -> None:
    """The plug is pulled at 2.8 s and put back at 3.6 s under another number."""
    done: set[str] = set()

    def meddle(flown: Flown) -> None:
        t = flown.streamed.now_s()
        if t > 2.8 and "out" not in done:
            done.add("out")
            (tmp_path / "uwb0").unlink()
            os.close(flown.streamed.masters["uwb0"])
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            flown.streamed.masters["uwb0"] = master
            flown.streamed.slaves.append(slave)
            flown.streamed.ttys["uwb0"] = os.ttyname(slave)
        if t > 3.6 and "in" not in done:
            done.add("in")
            os.symlink(flown.streamed.ttys["uwb0"], tmp_path / "uwb0")

    flown = Flown(scene(6.5, 14), meddle=meddle, tmp_path=tmp_path)
    assert flown.node.failure == ""
    assert done == {"out", "in"}
    line = flown.status["nooploop"][str(tmp_path / "uwb0")]
    assert line["lost"] == 1
    assert line["connected"]
    assert flown.spoke(3.0, 3.6)  # image motion and range finder go on
    assert flown.spoke(5.0, 6.5)
    assert set(flown.counters) == {0}
    assert np.abs(flown.streamed.axial_errors(3.0, 6.4)).max() < 0.5


def test_the_sender_is_killed_and_another_comes(tmp_path: Path) -> None:
    """Autopilot and sensors vanish at once (SIGKILL); a second later others stand at the same place, clocks at zero."""
    make = partial(streamed_flight, scene(6.0, 15, still_s=6.0))
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
        assert wait_for(lambda: node.output.sent > 30, 10.0)
        first.kill()
        time.sleep(SILENCE_S)
        sent = node.output.sent
        second = SenderProcess(make, udp_port=first.port)
        assert node.output.sent == sent  # it took longer than a second to begin
        assert node.status()["filter"]["silent"] == ["flow0", "range0", "uwb0"]
        for sensor, device in second.ttys.items():
            links[sensor].unlink()
            links[sensor].symlink_to(device)
        second.wait_for_start()
        assert wait_for(lambda: node.output.sent > sent + 30, 30.0)
        status = node.status()
    finally:
        node.close()
    told = second.finish()
    assert node.failure == ""
    assert told.used > 20
    assert np.abs(axial_errors(make(), told.odometry, 0.0, 6.0)).max() < 0.5
    assert told.odometry[0, 2] >= 1  # reset counter: another autopilot, another filter
    assert {line["connected"] for line in status["nooploop"].values()} == {True}


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
    done: list[dict[str, Any]] = []

    def meddle(flown: Flown) -> None:
        t = flown.streamed.now_s()
        if 3.0 < t < 4.0 and not big.exists():
            with big.open("wb", buffering=0) as file, contextlib.suppress(OSError):
                while file.write(bytes(1 << 16)):
                    pass
        if t > 4.0 and big.exists():
            done.append(flown.node.status()["recording"])
            big.unlink()

    flown = Flown(scene(6.0, 16), meddle=meddle, tmp_path=tmp_path, records=small_disk)
    assert flown.node.failure == ""
    assert np.diff(flown.sent_s[flown.sent_s > 2.5]).max() < SILENCE_S
    assert not done[0]["recording"]
    assert "No space left" in done[0]["problem"] or "are kept" in done[0]["problem"]
    recording = flown.status["recording"]
    assert recording["recording"]
    assert "resumed" in recording["problem"]
    assert recording["dropped"]["imu0"] > 50
    (path,) = small_disk.glob("*.mcap")
    flight = load_flight(path)
    inside = flight.tables["imu0"].t_ns - flown.streamed.t0_ns
    assert not ((inside > 3.2e9) & (inside < 3.9e9)).any()
    assert ((inside > 4.5e9) & (inside < 5.5e9)).sum() > 150
    taken = sum(flown.status["filter"]["verdicts"]["imu0"].values())
    assert len(inside) + recording["dropped"]["imu0"] == taken


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
