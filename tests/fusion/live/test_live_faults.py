"""Faults in flight, on loopback and in real time: silence within 250 ms, a bounded state, and recovery by itself."""

from __future__ import annotations

import os
import time
import tty
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.vehicle import Status
from axialnav.fusion.live.warm_up import warm_up
from tests.fusion.live.streamed import StreamedVehicle, ahead, streamed_flight, vehicle_of
from tests.fusion.live.test_output import VEHICLE
from tests.fusion.made_flights import Scene

pytestmark = pytest.mark.slow
SILENCE_S = 0.25


class Flown:
    """A streamed flight with a fault: what the node sent and what it said in the end."""

    def __init__(self, scene: Scene, *, meddle: Any = None, tmp_path: Path | None = None, **faults: Any) -> None:
        self.scene = scene
        self.flight = streamed_flight(scene)
        self.streamed = StreamedVehicle(self.flight, scene, **faults)
        vehicle = vehicle_of(ahead(self.flight.config), self.streamed.port, self._links(tmp_path))
        warm_up(vehicle.filter, vehicle.estimator)
        recording = FlightRecording(tmp_path / "flights", True, time.monotonic_ns) if tmp_path else None
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


def test_the_autopilot_s_clock_steps() -> None:
    """Two seconds forward at 3 s, without a reboot: nothing with a wrong stamp reaches the filter."""
    flown = Flown(scene(7.0, 13, still_s=5.0), boot_at=lambda t, boot: boot + (2_000_000_000 if t >= 3.0 else 0))
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


def test_a_recording_that_cannot_begin_is_said_and_the_flight_goes_on(tmp_path: Path) -> None:
    recording = FlightRecording(tmp_path / "disk", True, time.monotonic_ns)
    (tmp_path / "disk").rmdir()
    recording.restarted(VEHICLE.filter)
    assert "cannot be recorded to" in recording.problem
    recording.heard("mavlink_in", b"abc", 0)
    assert "cannot be recorded to" in recording.status()["problem"]
    recording.close()


def test_a_thread_that_fails_takes_the_node_down() -> None:
    """Half a node must not look alive: systemd starts it again."""

    class Broken:
        unsent = 0

        def receive(self, timeout_s: float) -> Any:
            raise RuntimeError("the driver has gone")

        def send(self, data: bytes) -> bool:
            return False

        def confirm(self, address: Any) -> None: ...

        def close(self) -> None: ...

    node = Node(msgspec.structs.replace(VEHICLE, status=Status(port=0, line_s=0.0)), link=Broken())
    assert node.run() == "thread receive: RuntimeError: the driver has gone"
