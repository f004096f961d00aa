"""When the node speaks and when it keeps silent, on a clock that the test moves."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
import pytest

from axialnav.fusion.live.attitude_check import PATIENCE_NS, AttitudeCheck
from axialnav.fusion.live.core import Snapshot
from axialnav.fusion.live.output import SENDING, Output
from axialnav.fusion.live.schedule import DELTA_SPACING_NS, SPACING_NS, Schedule
from axialnav.fusion.live.vehicle import Mavlink, Vehicle
from axialnav.fusion.outcome import AxialState, Health
from axialnav.models.rotations import quaternion_from_euler
from tests.fusion.live.streamed import streamed_flight

MS, S = 1_000_000, 1_000_000_000
VEHICLE = Vehicle(filter=streamed_flight().config)


def state(t_ns: int, **changes: Any) -> AxialState:
    """Flying along x with 1 m/s, level, sigma 0.05 m/s."""
    values: dict[str, Any] = {
        "t_ns": t_ns,
        "axial_position_m": t_ns * 1e-9,
        "axial_velocity_m_s": 1.0,
        "sigma_axial_position_m": 0.1,
        "sigma_axial_velocity_m_s": 0.05,
        "position_m": np.array([t_ns * 1e-9, 0.0, 1.0]),
        "velocity_m_s": np.array([1.0, 0.0, 0.0]),
        "quaternion_WB": np.array([1.0, 0.0, 0.0, 0.0]),
        "gyro_bias_rad_s": np.zeros(3),
        "accel_bias_m_s2": np.zeros(3),
        "blur_scale": 0.0,
        "uwb_bias_m": 0.0,
        "wall_offset_m": 0.0,
        "covariance": np.diag([0.01] * 3 + [0.0025] * 3 + [1e-4] * 12),
        "flags": Health.GOOD,
        "resets": 0,
        "last_reset_delta_m": np.zeros(3),
    }
    return AxialState(**(values | changes))


@dataclass
class Bench:
    """An output with its clock, the filter it asks and the messages it sent."""

    vehicle: Vehicle = VEHICLE
    now_ns: int = 100 * S
    changes: dict[str, Any] = field(default_factory=dict)
    imu_age_ns: int = 3 * MS
    aid_age_ns: int = 10 * MS
    axial_age_ns: int = 0
    restarts: int = 0
    sent: list[tuple[int, Any]] = field(default_factory=list)
    hold_imu_ns: int | None = None

    def __post_init__(self) -> None:
        self.check = AttitudeCheck(10.0, None)
        self.check.passed = True
        self.output = Output(self.vehicle, self.snapshot, self.send, lambda: self.now_ns, self.check)

    def snapshot(self, now_ns: int) -> Snapshot | None:
        imu_ns = self.hold_imu_ns or now_ns - self.imu_age_ns
        aid_ns, axial_ns = now_ns - self.aid_age_ns, now_ns - max(self.aid_age_ns, self.axial_age_ns)
        return Snapshot(state(now_ns, **self.changes), np.zeros(3), imu_ns, aid_ns, axial_ns, self.restarts)

    def send(self, message: Any) -> bool:
        self.sent.append((self.now_ns, message))
        return True

    def step(self, after_ms: float = 33.3) -> Any:
        self.now_ns += round(after_ms * MS)
        return self.output.step()


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        ({"imu_age_ns": 201 * MS}, "no fresh inertial samples"),
        ({"aid_age_ns": 201 * MS}, "no reading has been fused of late: camera, range and UWB are silent or refused"),
        ({"changes": {"flags": Health.VELOCITY_INVALID}}, "the velocity is not valid: no axial aid for too long"),
        ({"changes": {"flags": Health.ALIGNING}}, "the velocity is not valid: no axial aid for too long"),
        ({"changes": {"covariance": np.diag([0.01] * 3 + [0.3] * 3 + [1e-4] * 12)}}, "the velocity is too uncertain"),
    ],
)
def test_it_stops_and_says_why_and_goes_on_by_itself(spoil: dict[str, Any], reason: str) -> None:
    bench = Bench()
    assert bench.step() is not None
    healthy = {name: getattr(bench, name) for name in spoil}
    for name, value in spoil.items():
        setattr(bench, name, value)
    assert bench.step() is None
    assert bench.output.reason == reason
    assert bench.output.withheld == {reason: 1}
    for name, value in healthy.items():
        setattr(bench, name, value)
    assert bench.step() is not None
    assert bench.output.reason == SENDING


@pytest.mark.parametrize("silent", ["imu", "aids"])
def test_the_last_message_leaves_within_250_ms_of_the_last_reading(silent: str) -> None:
    bench = Bench()
    stopped_ns = 0
    for k in range(40):
        if k == 10:
            stopped_ns = bench.now_ns
        if k >= 10:
            bench.hold_imu_ns = None if silent == "aids" else stopped_ns - 3 * MS
            bench.aid_age_ns = bench.now_ns - stopped_ns if silent == "aids" else bench.aid_age_ns
        bench.step()
    assert bench.sent[-1][0] - stopped_ns <= 250 * MS
    assert len(bench.sent) < 20


def test_a_packet_is_never_repeated() -> None:
    bench = Bench()
    bench.hold_imu_ns = bench.now_ns + 30 * MS
    assert [bench.step() is not None for _ in range(4)] == [True, False, False, False]
    assert bench.output.reason == "nothing new since the last message"


@pytest.mark.parametrize(
    ("changes", "counted"),
    [
        ({}, 0),
        ({"velocity_m_s": np.array([1.2, 0.0, 0.0])}, 0),  # what a vehicle can do in 33 ms
        ({"velocity_m_s": np.array([2.6, 0.0, 0.0])}, 1),
        ({"resets": 1}, 1),
    ],
)
def test_the_reset_counter_goes_up_on_a_discontinuity_and_only_then(changes: dict[str, Any], counted: int) -> None:
    bench = Bench()
    bench.step()
    bench.changes = changes
    for _ in range(5):
        bench.step()
    assert bench.output.reset_counter == counted
    assert bench.sent[-1][1].reset_counter == counted


def test_a_jump_of_position_and_a_new_filter_count_too() -> None:
    bench = Bench()
    bench.step()
    bench.changes = {"position_m": np.array([bench.now_ns * 1e-9 + 0.6, 0.0, 1.0])}
    bench.step()
    assert bench.output.reset_counter == 1
    bench.restarts = 1
    bench.changes = {}
    bench.step(400.0)
    assert bench.output.reset_counter == 2


def test_the_reset_counter_wraps() -> None:
    bench = Bench()
    for k in range(300):
        bench.restarts = k
        bench.step()
    assert bench.output.reset_counter == 299 % 256
    assert all(0 <= m.reset_counter <= 255 for _, m in bench.sent)


def test_quality_is_the_lowest_while_nothing_that_sees_the_corridor_is_fused() -> None:
    """A range finder alone keeps messages going, but nobody measures the velocity: to be seen in every message."""
    bench = Bench(axial_age_ns=150 * MS)
    assert bench.step().quality > 50
    bench.axial_age_ns = 210 * MS
    assert bench.step().quality == 1
    bench.axial_age_ns = 20 * MS
    assert bench.step().quality > 50


def test_quality_says_how_good_the_velocity_is_and_is_never_zero() -> None:
    """Zero would be read as "unknown", and taken."""
    bench, qualities = Bench(), []
    for sigma in (0.01, 0.1, 0.25, 0.4999):
        bench.changes = {"covariance": np.diag([0.01] * 3 + [sigma**2] * 3 + [1e-4] * 12)}
        qualities.append(bench.step().quality)
    assert qualities == [98, 80, 50, 1]


def test_ardupilot_gets_deltas_where_only_the_velocity_is_known_and_none_across_a_break() -> None:
    filter_ = msgspec.structs.replace(VEHICLE.filter, disabled=("uwb0",))
    bench = Bench(vehicle=Vehicle(filter=filter_))
    kinds = [bench.step(55.0) for _ in range(4)]
    assert kinds[0] is None
    assert {m.get_type() for m in kinds[1:]} == {"VISION_POSITION_DELTA"}
    assert kinds[1].position_delta[0] == pytest.approx(0.055)
    assert kinds[1].time_delta_usec == 55_000
    bench.restarts = 1
    assert bench.step(55.0) is None
    assert bench.step(55.0) is not None
    px4 = Bench(vehicle=Vehicle(filter=filter_, mavlink=Mavlink(profile="px4")))
    assert np.isnan(px4.step().x)


def test_stamps_are_those_of_one_clock_and_in_order() -> None:
    bench = Bench()
    for _ in range(50):
        bench.step()
    stamps = [m.time_usec for _, m in bench.sent]
    assert stamps == [at // 1000 for at, _ in bench.sent]
    assert (np.diff(stamps) > 0).all()


# the schedule -------------------------------------------------------------------------------------------------------


def run_schedule(schedule: Schedule, frames_ns: list[int], until_ns: int) -> list[int]:
    """Instants of sending on a clock of 0.5 ms ticks."""
    sent, frames = [], list(frames_ns)
    for tick in range(0, until_ns, MS // 2):
        while frames and frames[0] <= tick:
            schedule.frame_done(frames.pop(0))
        if schedule.wait_ns(tick) == 0:
            schedule.taken()
            schedule.sent(tick)
            sent.append(tick)
    return sent


def test_without_a_camera_the_rate_is_steady() -> None:
    sent = run_schedule(Schedule(30.0), [], 10 * S)
    assert len(sent) == pytest.approx(300, abs=5)
    assert np.diff(sent).min() >= SPACING_NS


def test_with_a_camera_messages_follow_frames_at_once() -> None:
    rng = np.random.default_rng(1)
    frames = [k * 33_333_333 + round(rng.uniform(0, 4e6)) for k in range(300) if k % 20]  # every twentieth is missing
    sent = np.array(run_schedule(Schedule(30.0), frames, 10 * S))
    waits = np.array([sent[sent >= f][0] - f for f in frames[1:-2]])
    assert np.percentile(waits, 90) < 2 * MS
    assert waits.max() < SPACING_NS
    assert np.diff(sent).min() >= SPACING_NS
    assert 25.0 <= len(sent) / 10.0 <= 40.0


def test_a_fast_camera_does_not_break_the_spacing() -> None:
    sent = run_schedule(Schedule(40.0), [k * 5 * MS for k in range(2000)], 10 * S)
    assert np.diff(sent).min() >= SPACING_NS
    deltas = run_schedule(Schedule(30.0, DELTA_SPACING_NS), [k * 5 * MS for k in range(2000)], 10 * S)
    assert np.diff(deltas).min() >= 50 * MS


# the attitude -------------------------------------------------------------------------------------------------------


def theirs(roll: float, pitch: float, yaw: float, at_ns: int = 0) -> tuple[int, tuple[float, float, float, float]]:
    """Autopilot's attitude from angles in degrees, FRD to NED."""
    w, x, y, z = quaternion_from_euler(*np.radians([roll, pitch, yaw])).tolist()
    return at_ns, (w, x, y, z)


@pytest.mark.parametrize(
    ("angles", "heading_deg", "words"),
    [
        ((0.0, 0.0, 77.0), None, ""),  # yaw does not matter where no heading is stated
        ((5.0, -5.0, 41.0), 40.0, ""),
        ((12.0, 0.0, 0.0), None, "roll and pitch differ from the autopilot's by 12 deg"),
        ((180.0, 0.0, 0.0), None, "roll and pitch differ from the autopilot's by 180 deg"),
        ((0.0, 0.0, 0.0), 40.0, "yaw differs from the autopilot's by 40 deg"),
        ((0.0, 0.0, -175.0), 178.0, ""),
    ],
)
def test_attitudes_are_compared_before_the_first_message(angles, heading_deg, words: str) -> None:
    check = AttitudeCheck(10.0, None if heading_deg is None else float(np.radians(heading_deg)))
    check.autopilot(theirs(*angles))
    verdict = check.verdict(state(0), 0)
    assert verdict.startswith(words)
    assert bool(verdict) == bool(words)
    assert check.passed is not bool(words)


def test_an_autopilot_without_attitude_is_waited_for_and_then_noted() -> None:
    check = AttitudeCheck(10.0, None)
    assert "waiting" in check.verdict(state(0), S)
    assert check.verdict(state(0), S + PATIENCE_NS) == ""
    assert "not compared" in check.note
    check.again()
    assert "waiting" in check.verdict(state(0), S)


def test_it_follows_a_turned_vehicle() -> None:
    """Ours rolls by 20 degrees to the right (FRD), and so says the autopilot."""
    rolled = dataclasses.replace(state(0), quaternion_WB=quaternion_from_euler(np.radians(20.0), 0.0, 0.0))
    check = AttitudeCheck(10.0, 0.0)
    check.autopilot(theirs(20.0, 0.0, 0.0))
    assert check.verdict(rolled, 0) == ""
    assert check.tilt_deg == pytest.approx(0.0, abs=1e-5)
