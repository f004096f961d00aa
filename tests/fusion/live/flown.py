"""Flights in lockstep, ready to be looked at: what the vehicle was told, what the node sent and what it counted."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from axialnav.fusion.live.recorder.limits import Limits
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.warm_up import warm_up
from tests.fusion.live.filmed import Shutter, filmed_course, with_camera
from tests.fusion.live.lockstep import Clock, Lockstep
from tests.fusion.live.streamed import Course, StreamedVehicle, ahead, streamed_flight, vehicle_of
from tests.fusion.made_flights import Scene


class Flown:
    """A flight from its first to its last instant, with whatever goes wrong in it.

    Parameters
    ----------
    course
        What is flown.
    vehicle_for
        Makes the node's configuration of a port and of serial devices by sensor.
    until_s
        When the flight is over.
    meddle
        Called with the flight every 20 ms.
    links
        Folder with a symbolic link for every serial sensor, as udev has them.
    records, limits
        Where the flight is recorded, and with what limits.
    film, frozen_s
        Folder of the pictures, and when the camera hangs.
    vehicle
        Of the streamed vehicle: ``air``, ``contract``, ``silent``, ``boot_at``.

    Attributes
    ----------
    told
        The node's configuration.
    status, recorded
        What the node said at the end, and what its recorder said when everything was written.
    sent, sent_s
        Odometry as it arrived, and its stamps in flight time.
    speeds
        Largest component of the velocity, every 20 ms.
    """

    def __init__(
        self,
        course: Course,
        vehicle_for: Callable[[int, dict[str, str]], Vehicle],
        until_s: float,
        *,
        meddle: Callable[[Flown], None] = lambda _: None,
        links: Path | None = None,
        records: Path | None = None,
        limits: Limits | None = None,
        film: Path | None = None,
        frozen_s: tuple[float, float] = (0.0, 0.0),
        **vehicle: Any,
    ) -> None:
        self.course, self.clock, self._meddle = course, Clock(), meddle
        self.streamed = StreamedVehicle(course, clock=self.clock, **vehicle)
        self.told = told = vehicle_for(self.streamed.port, self._devices(links))
        warm_up(told.filter, told.estimator)
        source = None
        if film is not None:
            camera_clock = Clock()  # its pictures come when the clock of the flight has come so far
            source = Shutter(film, told.filter, frozen_s, camera_clock, camera_clock.sleep)
        recording = FlightRecording(records, True, self.clock, limits) if records else None
        self.flight = Lockstep(self.streamed, told, self.clock, source=source, recording=recording, each=self._look)
        self.node = self.flight.node
        self.speeds: list[float] = []
        try:
            self.flight.begin()
            self.flight.until(until_s)
            self.status = self.node.status()  # nothing moves any more, except the recorder
        finally:
            self.flight.close()
        self.recorded = self.node.status()["recording"]
        messages = self.streamed.contract.messages
        self.sent = [m for _, m in messages if m.get_type() == "ODOMETRY"]
        self.sent_s = np.array([(m.time_usec * 1000 - self.streamed.t0_ns) * 1e-9 for m in self.sent])

    def _devices(self, links: Path | None) -> dict[str, str]:
        if links is None:
            return self.streamed.ttys
        for sensor, device in self.streamed.ttys.items():
            os.symlink(device, links / sensor)
        return {sensor: str(links / sensor) for sensor in self.streamed.ttys}

    def _look(self) -> None:
        snapshot = self.node.core.snapshot(self.clock())
        if snapshot is not None:
            self.speeds.append(float(np.abs(snapshot.state.velocity_m_s).max()))
        self._meddle(self)

    @property
    def now_s(self) -> float:
        """Present instant of the flight."""
        return self.streamed.now_s()

    def silent(self, start_s: float, end_s: float) -> bool:
        """Whether nothing was sent between two instants."""
        return not ((self.sent_s > start_s) & (self.sent_s < end_s)).any()

    def spoke(self, start_s: float, end_s: float) -> bool:
        return not self.silent(start_s, end_s)


def fly(scene: Scene, **how: Any) -> Flown:
    """A made flight with an image-flow sensor."""
    course = streamed_flight(scene)
    config = ahead(course.config)
    return Flown(course, lambda port, ttys: vehicle_of(config, port, ttys), scene.duration_s + 0.1, **how)


def fly_filmed(
    film: Path, until_s: float, *, without: tuple[str, ...] = (), profile: str = "ardupilot", **how: Any
) -> Flown:
    """A simulated flight with its pictures; ``without`` names sensors that the node does not know."""
    course = filmed_course(film)
    config = msgspec.structs.replace(course.config, disabled=without)

    def vehicle_for(port: int, ttys: dict[str, str]) -> Vehicle:
        known = {sensor: device for sensor, device in ttys.items() if sensor not in without}
        return with_camera(vehicle_of(config, port, known, profile=profile))

    return Flown(course, vehicle_for, until_s, film=film, **how)
