"""Two autopilots as far as their rules for external odometry go, as measured on ArduCopter 4.7-dev and PX4 main (2026).

Each takes the bytes that a companion sends and says of every message what became of it: ``""`` for used, else the rule
that it broke.  The real ones drop in silence.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink

DIAGONAL = (0, 6, 11, 15, 18, 20)
USED = ""


def parser(key: bytes | None = None) -> Any:
    """Parser of the autopilot's end."""
    made = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    made.robust_parsing = True
    made.signing.secret_key = key
    return made


def length(values: list[float]) -> float:
    return math.sqrt(sum(v * v for v in values))


@dataclass
class Contract:
    """What both share: the parser, the heartbeat, the one clock, and the list of verdicts."""

    key: bytes | None = None
    system: int = 1
    verdicts: list[tuple[str, str]] = field(default_factory=list)
    beats: list[int] = field(default_factory=list)
    messages: list[tuple[int, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.parser = parser(self.key)
        self.last_stamp_us = -1

    def take(self, data: bytes, now_ns: int) -> list[Any]:
        """Take bytes that arrive at ``now_ns`` of the autopilot's clock; the messages in them."""
        messages = self.parser.parse_buffer(data) or []
        for message in messages:
            name = message.get_type()
            self.messages.append((now_ns, message))
            if name in ("BAD_DATA", "HEARTBEAT", "ODOMETRY", "VISION_POSITION_DELTA"):
                self.verdicts.append((name, self.judge(message, now_ns)))
        return messages

    def refused(self) -> Counter[str]:
        """Rules that were broken and how often."""
        return Counter(f"{name}: {rule}" for name, rule in self.verdicts if rule)

    def used(self, name: str) -> int:
        """Messages of a name that were used."""
        return sum(1 for found, rule in self.verdicts if found == name and not rule)

    def judge(self, m: Any, now_ns: int) -> str:
        name = m.get_type()
        if name == "BAD_DATA":
            return "signature" if "signature" in m.reason else "damaged"
        if name == "HEARTBEAT":
            self.beats.append(now_ns)
            role = (m.type, m.autopilot, m.get_srcComponent())
            wanted = (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 197)
            return USED if role == wanted else "not an onboard controller"
        if m.get_srcSystem() != self.system:
            return "foreign system"
        rule = self.clock(m.time_usec, now_ns) or self.shape(m)
        return rule or self.consume(m, now_ns)

    def clock(self, stamp_us: int, now_ns: int) -> str:
        before, self.last_stamp_us = self.last_stamp_us, stamp_us
        if stamp_us == before:
            return "repeated stamp"
        return "stamp goes back" if stamp_us < before else USED

    def shape(self, m: Any) -> str:
        """What neither checks and both suffer from."""
        if m.get_type() != "ODOMETRY":
            return USED
        for name, covariance in (("pose", m.pose_covariance), ("velocity", m.velocity_covariance)):
            wanted = [0, 6, 11] if name == "velocity" else DIAGONAL
            values = [covariance[i] for i in wanted]
            unknown = name == "pose" and all(math.isnan(v) for v in values)
            floor = 0.05 if name == "velocity" else 0.1
            if not unknown and not all(v >= floor**2 * (1 - 1e-6) for v in values[:3]):
                return f"{name} covariance smaller than can be true, or not a number"
        if not all(math.isfinite(v) for v in (m.vx, m.vy, m.vz, m.rollspeed, m.pitchspeed, m.yawspeed)):
            return "velocity or rate not finite"
        return USED

    def consume(self, m: Any, now_ns: int) -> str:
        raise AssertionError


@dataclass
class ContractArduPilot(Contract):
    """EKF3: two frames only, 20 ms, one number for three axes, a clock that knows only the fastest packet."""

    qual_min: int = 0
    delay_ms: float = 20.0
    velocity_ned: Any = None  # own velocity at a time [ns] -> NED [m/s], for the gate

    def __post_init__(self) -> None:
        super().__post_init__()
        self.lags: deque[int] = deque(maxlen=100)
        self.corrected_ms: list[float] = []
        self.used_ns: int | None = None
        self.delta_ns: int | None = None
        self.position: np.ndarray | None = None
        self.counter: int | None = None

    def clock(self, stamp_us: int, now_ns: int) -> str:
        rule = super().clock(stamp_us, now_ns)
        self.lags.append(now_ns - stamp_us * 1000)
        self.corrected_ms.append(min((self.lags[-1] - min(self.lags)) * 1e-6, 500.0))
        return rule or ("late by its own clock" if self.corrected_ms[-1] > 200.0 else USED)

    def consume(self, m: Any, now_ns: int) -> str:
        return self.odometry(m, now_ns) if m.get_type() == "ODOMETRY" else self.delta(m, now_ns)

    def odometry(self, m: Any, now_ns: int) -> str:
        if (m.frame_id, m.child_frame_id) != (mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD):
            return "frames"
        if self.used_ns is not None and now_ns - self.used_ns < 20_000_000:
            return "within 20 ms"
        self.used_ns = now_ns
        if m.quality < self.qual_min:
            return "quality"
        if not abs(length(m.q) - 1.0) < 1e-6 + 1e-7:
            return "quaternion"
        if self.velocity_ned is not None and not self._gate(m, now_ns):
            return "velocity gate of all three axes"
        return self._position(m)

    def _gate(self, m: Any, now_ns: int) -> bool:
        """One joint test with 0.1 m/s on every axis: the covariance that was sent does not matter."""
        w, x, y, z = m.q
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        wrong = R @ [m.vx, m.vy, m.vz] - self.velocity_ned(now_ns)
        return float(wrong @ wrong) / (3.0 * 25.0 * (0.1**2 + 0.1**2)) < 1.0

    def _position(self, m: Any) -> str:
        position = np.array([m.x, m.y, m.z])
        if np.isnan(position).any():
            return USED
        before, self.position = self.position, position
        reset, self.counter = m.reset_counter != self.counter, m.reset_counter
        if before is not None and not reset and float(np.linalg.norm(position - before)) > 2.0:
            return "position jump without a new reset counter"
        return USED

    def delta(self, m: Any, now_ns: int) -> str:
        if self.delta_ns is not None and now_ns - self.delta_ns < 50_000_000:
            return "within 50 ms"
        if self.delta_ns is not None and now_ns - self.delta_ns > 300_000_000:
            self.delta_ns = now_ns
            return "gap of more than 300 ms"
        self.delta_ns = now_ns
        if not 0 < m.time_delta_usec < 500_000 or not 0.0 <= m.confidence <= 100.0:
            return "time or confidence out of range"
        return USED


@dataclass
class ContractPx4(Contract):
    """EKF2: more frames, one variance an axis, needs less than 200 ms from message to message."""

    quality_min: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.used_ns: int | None = None

    def consume(self, m: Any, now_ns: int) -> str:
        if m.get_type() != "ODOMETRY":
            return "not handled by this autopilot"
        before, self.used_ns = self.used_ns, now_ns
        if before is not None and now_ns - before > 200_000_000:
            return "more than 200 ms since the last"
        if m.child_frame_id not in (1, 4, 20, 21, 12) or m.frame_id not in (1, 4, 20, 21):
            return "frames"
        if m.estimator_type not in (0, 1, 2, 3):
            return "estimator type"
        norm = length(m.q)
        if not math.isnan(norm) and not abs(norm - 1.0) < 1e-5:
            return "quaternion"
        if m.estimator_type == 1:
            return "covariances dropped"
        return "quality" if m.quality < self.quality_min else USED
