"""The autopilot at the other end of the link: its clock, its messages, what it is asked for and whether it follows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from axialnav.fusion.live.attitude_check import AttitudeCheck
from axialnav.fusion.live.clock import BootClock
from axialnav.fusion.live.dialect import Message, mavlink
from axialnav.fusion.live.mavlink_in import MavlinkInput
from axialnav.fusion.live.mavlink_out import heartbeat
from axialnav.fusion.live.streams import Streams, wanted_streams
from axialnav.fusion.live.timesync import Timesync
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.watch import Watch, delay_advice
from axialnav.fusion.readings import Reading

HEARTBEAT_NS = 1_000_000_000
HEARD_NS = 2_000_000_000
PROFILE_OF = {mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot", mavlink.MAV_AUTOPILOT_PX4: "px4"}


class Autopilot:
    """Everything that is known of the other end.

    Messages are taken by one thread and :meth:`tick` is called by another; both only replace single values.

    Attributes
    ----------
    messages
        Messages taken, by name.
    readings
        Readings made of them, by sensor.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        send: Callable[[Message], bool],
        now: Callable[[], int],
        restart: Callable[[str], None],
    ) -> None:
        heading = vehicle.heading_rad
        self.messages: Counter[str] = Counter()
        self.readings: Counter[str] = Counter()
        self.clock = BootClock()
        self.timesync = Timesync(self.clock, send, now)
        self.input = MavlinkInput(vehicle.input, vehicle.filter, self.clock, heading)
        self.streams = Streams(wanted_streams(vehicle), (vehicle.mavlink.system, 1), send)
        stated = heading if vehicle.output.heading_deg is not None else None
        self.check = AttitudeCheck(vehicle.output.check_attitude_deg, stated)
        self._profile = vehicle.mavlink.profile
        self.watch = Watch(self._profile, delay_advice(self._profile, None)[0])
        self._send, self._now, self._restart = send, now, restart
        self._heard_ns: int | None = None
        self._beat_ns: int | None = None
        self._kind = ""
        self._epoch = 0
        self._imu_source = ""

    def take(self, message: Message, arrival_ns: int) -> Reading | None:
        """Take one message of a listed sender; a reading if it contains one."""
        name = message.get_type()
        self.messages[name] += 1
        self._heard_ns = arrival_ns
        self.streams.seen(name, arrival_ns)
        if name == "TIMESYNC":
            self.timesync.take(message, arrival_ns)
        elif name == "HEARTBEAT":
            self._kind = PROFILE_OF.get(message.autopilot, self._kind)
        self.watch.take(message, arrival_ns)
        reading = self.input.reading(message, arrival_ns)
        self.check.autopilot(self.input.attitude)
        self._notice_restarts()
        if reading is not None:
            self.readings[reading.sensor] += 1
        return reading

    def tick(self, now_ns: int) -> None:
        """Say that we live, ask for the time and for what does not come; call it every few hundredths of a second."""
        if self._beat_ns is None or now_ns - self._beat_ns >= HEARTBEAT_NS:
            self._beat_ns = now_ns
            self._send(heartbeat())
        self.timesync.ask()
        self.streams.ask(now_ns)

    def heard(self, now_ns: int) -> bool:
        """Whether anything usable has come of late."""
        return self._heard_ns is not None and now_ns - self._heard_ns < HEARD_NS

    def sentence(self, now_ns: int, *, sending: bool, why_not: str, bad_signatures: int) -> str:
        """How things stand between us and the autopilot, for a person."""
        if self._kind and self._kind != self._profile:
            return f'the autopilot is {self._kind}, mavlink.profile says "{self._profile}"; correct the profile'
        return self.watch.sentence(
            now_ns, sending=sending, why_not=why_not, heard=self.heard(now_ns), bad_signatures=bad_signatures
        )

    @property
    def advice(self) -> tuple[str, int]:
        """Delay parameter to set on the autopilot and its value [ms]."""
        return delay_advice(self._profile, self.clock.round_trip_ns)

    def status(self, now_ns: int) -> dict[str, Any]:
        """What is known, as plain data."""
        trip = self.clock.round_trip_ns
        return {
            "kind": self._kind or None,
            "heard": self.heard(now_ns),
            "using": self.watch.using,
            "messages": dict(self.messages),
            "readings": dict(self.readings),
            "refused": dict(self.input.refused),
            "missing": self.streams.silent(now_ns),
            "imu_source": self.input.imu_source or None,
            "attitude": {"passed": self.check.passed, "tilt_deg": self.check.tilt_deg, "yaw_deg": self.check.yaw_deg},
            "clock": {
                "synchronised": self.clock.synchronised,
                "restarts": self.clock.epoch,
                "drift_ppm": round(self.clock.drift_ppm, 2),
                "round_trip_ms": None if trip is None else round(trip * 1e-6, 3),
                "asked": self.timesync.asked,
                "answered": self.timesync.answered,
                "served": self.timesync.served,
            },
        }

    def _notice_restarts(self) -> None:
        if self.clock.epoch != self._epoch:
            self._epoch = self.clock.epoch
            self.check.again()
            self._restart("the autopilot's clock started anew")
        if self.input.imu_source != self._imu_source:
            coarse = self.input.filter_config() is not self.input.config or self._imu_source != ""
            self._imu_source = self.input.imu_source
            if coarse:
                self._restart(f"inertial samples now come from {self._imu_source}")
