"""The thread that speaks to the autopilot, and the rules for keeping silent.

Nothing is sent unless the estimate is fresh and good enough: both autopilots would go on trusting whatever comes.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable

import numpy as np

from axialnav.fusion.live.attitude_check import AttitudeCheck
from axialnav.fusion.live.core import Snapshot
from axialnav.fusion.live.dialect import Message
from axialnav.fusion.live.latency import Latency
from axialnav.fusion.live.mavlink_out import Content, odometry, position_delta
from axialnav.fusion.live.schedule import DELTA_SPACING_NS, SPACING_NS, Schedule
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.outcome import AxialState
from axialnav.models.state import E_VEL

MAX_DELTA_NS = 200_000_000
JUMP_ACCEL_M_S2 = 10.0
SENDING = "sending"


class Output:
    """Builds and sends the estimate; knows why it does not.

    Attributes
    ----------
    reason
        ``"sending"``, or in plain words why not.
    withheld
        Reason -> how many messages were not sent.
    sent
        Number of messages sent.
    reset_counter
        Discontinuities so far, modulo 256.
    sent_ns
        When the latest message went out; None before the first.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        snapshot: Callable[[int], Snapshot | None],
        send: Callable[[Message], bool],
        clock: Callable[[], int],
        check: AttitudeCheck,
        tell: Callable[[AxialState], None] | None = None,
    ) -> None:
        self.reason = "the filter has not started"
        self.withheld: Counter[str] = Counter()
        self.sent = 0
        self.reset_counter = 0
        self.sent_ns: int | None = None
        self.latency = {"output": Latency(), "frame_to_message": Latency()}
        self._rules, self._content = vehicle.output, vehicle.content
        self._deltas = vehicle.mavlink.profile == "ardupilot" and self._content == "velocity"
        self._heading_rad = vehicle.heading_rad
        self._axis = np.array(vehicle.filter.axis)
        self._snapshot, self._send, self._clock, self._check = snapshot, send, clock, check
        self._tell = tell
        self._schedule = Schedule(self._rules.rate_hz, DELTA_SPACING_NS if self._deltas else SPACING_NS)
        self._wake = threading.Condition()
        self._frame_ns: int | None = None
        self._before: Snapshot | None = None

    def frame_done(self, fused_ns: int | None = None) -> None:
        """A picture taken at ``fused_ns`` has been fused, or one told nothing: do not wait for the next period."""
        with self._wake:
            if fused_ns is not None:
                self._frame_ns = fused_ns
            self._schedule.frame_done(self._clock())
            self._wake.notify()

    def run(self, stop: threading.Event) -> None:
        """Send until told to stop; the body of the output thread."""
        while not stop.is_set():
            with self._wake:
                wait_ns = self.wait_ns()
                if wait_ns > 0:
                    self._wake.wait(min(wait_ns * 1e-9, 0.1))
                    continue
            self.step()

    def wait_ns(self) -> int:
        """Time until the next opportunity to send; 0 if it is due."""
        return self._schedule.wait_ns(self._clock())

    def step(self) -> Message | None:
        """One opportunity to send: the message that went out, or None with the reason counted."""
        with self._wake:
            frame_ns, self._frame_ns = self._frame_ns, None
            self._schedule.taken()
        message = self._try(frame_ns)
        with self._wake:
            self._schedule.sent(self._clock())  # only now: the distance counts from when a message left
        return message

    def _try(self, frame_ns: int | None) -> Message | None:
        began_ns = self._clock()
        now = self._snapshot(began_ns)
        sigma = self._sigma(now) if now is not None else math.inf
        self.reason = self._why_not(now, sigma, began_ns)
        if now is None or self.reason != SENDING:
            self.withheld[self.reason] += 1
            return None
        message = self._message(now, sigma)
        if message is None or not self._send(message):
            self.withheld["no way out yet" if message is not None else "first of a series of deltas"] += 1
            return None
        self.sent += 1
        self.sent_ns = self._clock()
        self.latency["output"].add((self.sent_ns - began_ns) * 1e-9)
        if self._tell is not None:
            self._tell(now.state)
        if frame_ns is not None:
            self.latency["frame_to_message"].add((self.sent_ns - frame_ns) * 1e-9)
        return message

    def _why_not(self, now: Snapshot | None, sigma_m_s: float, t_ns: int) -> str:
        rules = self._rules
        if now is None:
            return "the filter has not started"
        if t_ns - now.imu_ns > rules.stale_s * 1e9:
            return "no fresh inertial samples"
        if self._before is not None and now.imu_ns == self._before.imu_ns:
            return "nothing new since the last message"
        if t_ns - now.aid_ns > rules.aid_stale_s * 1e9:
            return "no reading has been fused of late: camera, range and UWB are silent or refused"
        if not now.state.velocity_valid:
            return "the velocity is not valid: no axial aid for too long"
        if sigma_m_s > rules.max_sigma_velocity_m_s:
            return "the velocity is too uncertain"
        return self._check.verdict(now.state, t_ns) or SENDING

    def _sigma(self, now: Snapshot) -> float:
        """Standard deviation of what the autopilot will take for known [m/s]: it weighs the worst axis, or one."""
        if self._content == "axial":
            return now.state.sigma_axial_velocity_m_s
        return float(np.sqrt(np.linalg.eigvalsh(now.state.covariance[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3]).max()))

    def _message(self, now: Snapshot, sigma_m_s: float) -> Message | None:
        before, self._before = self._before, now
        if self._jumped(before, now):
            self.reset_counter = (self.reset_counter + 1) % 256
        if not self._deltas:
            content: Content = self._content
            quality = self._quality(now, sigma_m_s)
            return odometry(now, self._axis, self._heading_rad, content, quality, self.reset_counter)
        if before is None or before.restarts != now.restarts or now.state.t_ns - before.state.t_ns > MAX_DELTA_NS:
            return None
        return position_delta(before, now)

    def _quality(self, now: Snapshot, sigma_m_s: float) -> int:
        """Per cent, 100 for a sigma of zero; 1 at the limit, or while nothing that sees the axis is fused.

        0 would read as "unknown".
        """
        if now.state.t_ns - now.axial_ns > self._rules.aid_stale_s * 1e9:
            return 1
        share = 1.0 - sigma_m_s / self._rules.max_sigma_velocity_m_s
        return max(round(100.0 * share), 1)

    def _jumped(self, before: Snapshot | None, now: Snapshot) -> bool:
        """Whether the state is not a continuation of the one sent before."""
        if before is None:
            return False
        if before.restarts != now.restarts or before.state.resets != now.state.resets:
            return True
        dt = (now.state.t_ns - before.state.t_ns) * 1e-9
        mean = 0.5 * (before.state.velocity_m_s + now.state.velocity_m_s)
        moved = now.state.position_m - before.state.position_m - mean * dt
        faster = now.state.velocity_m_s - before.state.velocity_m_s
        free = JUMP_ACCEL_M_S2 * dt
        if float(np.linalg.norm(faster)) > self._rules.jump_velocity_m_s + free:
            return True
        located = self._content == "full"
        return located and float(np.linalg.norm(moved)) > self._rules.jump_position_m + 0.25 * free * dt
