"""What is sent, against the rules of both autopilots; and every rule, broken on purpose, is noticed by them."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest
from scipy.spatial.transform import Rotation

from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.live.axes import euler_of, quaternion_local_frd
from axialnav.fusion.live.core import FilterCore, Snapshot
from axialnav.fusion.live.mavlink_out import (
    LATERAL_VARIANCE,
    delta_confidence,
    heartbeat,
    odometry,
    pose_covariance,
    position_delta,
    velocity_covariance,
)
from axialnav.models.rotations import rotation_matrix
from tests.fusion.live.contract import DIAGONAL, Contract, ContractArduPilot, ContractPx4
from tests.fusion.made_flights import MadeFlight, Scene, fly
from tests.fusion.made_readings import readings

MS = 1_000_000
AXIS = np.array([1.0, 0.0, 0.0])
FLIP = np.diag([1.0, -1.0, -1.0])
PERIOD_NS = 33_333_333


@pytest.fixture(scope="module")
def flight() -> MadeFlight:
    return fly(Scene(seed=5, duration_s=6.0, sensors=("range0", "flow0", "uwb0")))


@pytest.fixture(scope="module")
def snapshots(flight: MadeFlight) -> list[Snapshot]:
    """The estimate every 33 ms of a flight."""
    core, due, taken = FilterCore(lambda: flight.config), 0, []
    for reading in readings(flight):
        core.push(reading, reading.t_ns)
        if reading.t_ns >= due and (snapshot := core.snapshot(reading.t_ns)) is not None:
            taken.append(snapshot)
            due = reading.t_ns + PERIOD_NS
    assert len(taken) > 120
    return taken


def packed(message: Any, packer: Any) -> bytes:
    data = message.pack(packer)
    packer.seq = (packer.seq + 1) % 256
    return bytes(data)


def ours() -> Any:
    return mavlink.MAVLink(None, srcSystem=1, srcComponent=197)


@pytest.mark.parametrize(
    ("contract", "content"),
    [(ContractArduPilot, "full"), (ContractPx4, "full"), (ContractPx4, "velocity"), (ContractPx4, "axial")],
)
def test_every_odometry_is_accepted(snapshots: list[Snapshot], contract: type[Contract], content: Any) -> None:
    autopilot, packer = contract(), ours()
    for k, snapshot in enumerate(snapshots):
        message = odometry(snapshot, AXIS, 0.4, content, 80, 7)
        autopilot.take(packed(message, packer), k * PERIOD_NS + snapshots[0].state.t_ns)
        if k % 30 == 0:
            autopilot.take(packed(heartbeat(), packer), k * PERIOD_NS + snapshots[0].state.t_ns)
    assert autopilot.refused() == {}
    assert autopilot.used("ODOMETRY") == len(snapshots)
    assert autopilot.used("HEARTBEAT") >= 4


def test_every_delta_is_accepted_and_they_add_up_to_the_way_flown(snapshots: list[Snapshot]) -> None:
    autopilot, packer = ContractArduPilot(), ours()
    used = snapshots[::2]
    walked = np.zeros(3)
    for before, now in pairwise(used):
        message = position_delta(before, now)
        autopilot.take(packed(message, packer), now.state.t_ns)
        walked += rotation_matrix(before.state.quaternion_WB) @ FLIP @ message.position_delta
    assert autopilot.refused() == {}
    velocity = np.array([s.state.velocity_m_s for s in snapshots])
    t = np.array([s.state.t_ns for s in snapshots]) * 1e-9
    integral = np.trapezoid(velocity[: 2 * len(used) - 1], t[: 2 * len(used) - 1], axis=0)
    assert walked == pytest.approx(integral, abs=0.01)
    turns = [np.linalg.norm(position_delta(a, b).angle_delta) for a, b in pairwise(used)]
    attitudes = Rotation.from_quat(np.roll([s.state.quaternion_WB for s in used], -1, axis=1))
    wanted = (attitudes[:-1].inv() * attitudes[1:]).magnitude()
    assert turns == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_frames_are_those_of_a_rotation_library(snapshots: list[Snapshot], heading: float) -> None:
    """Pose in the local frame and velocity in body FRD, by scipy from the corridor's axes."""
    for snapshot in snapshots[::20]:
        state = snapshot.state
        m = odometry(snapshot, AXIS, heading, "full", 50, 0)
        body = Rotation.from_quat(np.roll(state.quaternion_WB, -1))  # FLU to corridor
        local = Rotation.from_euler("z", heading) * Rotation.from_matrix(FLIP)  # corridor to local FRD
        attitude = local * body * Rotation.from_matrix(FLIP)
        theirs = Rotation.from_quat(np.roll(m.q, -1))
        assert (attitude.inv() * theirs).magnitude() < 1e-9
        assert np.linalg.norm(m.q) == pytest.approx(1.0, abs=1e-12)
        assert (m.x, m.y, m.z) == pytest.approx(local.apply(state.position_m))
        assert theirs.apply([m.vx, m.vy, m.vz]) == pytest.approx(local.apply(state.velocity_m_s), abs=1e-9)
        yaw, pitch, roll = attitude.as_euler("ZYX")
        assert euler_of(np.array(m.q)) == pytest.approx((roll, pitch, yaw))


def test_covariances_are_those_of_a_cloud_of_states(snapshots: list[Snapshot]) -> None:
    """20 000 states drawn around the estimate, each turned into the fields of the message."""
    state, rng, n = snapshots[-1].state, np.random.default_rng(1), 20_000
    errors = rng.multivariate_normal(np.zeros(len(state.covariance)), state.covariance, n)
    body = Rotation.from_quat(np.roll(state.quaternion_WB, -1)) * Rotation.from_rotvec(errors[:, 6:9])
    velocity = (body.inv().apply(state.velocity_m_s + errors[:, 3:6])) @ FLIP
    local = Rotation.from_euler("z", 0.7) * Rotation.from_matrix(FLIP)
    euler = (local * body * Rotation.from_matrix(FLIP)).as_euler("ZYX")[:, ::-1]
    position = local.apply(state.position_m + errors[:, :3])
    euler = np.angle(np.exp(1j * (euler - euler[0]))) + euler[0]
    drawn = np.cov(np.hstack([position, euler]).T)
    q = quaternion_local_frd(state.quaternion_WB, 0.7)
    told = pose_covariance(state, 0.7, euler_of(q))
    off = ~np.eye(6, dtype=bool)
    scale = np.sqrt(np.outer(np.diag(drawn), np.diag(drawn)))
    assert np.abs((told - drawn) / scale)[off].max() < 0.05
    assert np.diag(told) == pytest.approx(
        np.maximum(np.diag(drawn), [0.01] * 3 + [math.radians(1.0) ** 2] * 3), rel=0.05
    )
    spread = velocity_covariance(state, rotation_matrix(state.quaternion_WB))
    drawn_v = np.cov(velocity.T)
    assert np.diag(spread) == pytest.approx(np.maximum(np.diag(drawn_v), 0.05**2), rel=0.05)
    assert spread[0, 1] == pytest.approx(drawn_v[0, 1], abs=0.05 * math.sqrt(drawn_v[0, 0] * drawn_v[1, 1]))


def test_axial_only_means_one_known_axis_and_25_across(snapshots: list[Snapshot]) -> None:
    m = odometry(snapshots[-1], AXIS, 0.0, "axial", 50, 0)
    assert math.isnan(m.x)
    assert math.isnan(m.pose_covariance[0])
    state = snapshots[-1].state
    covariance = np.zeros((3, 3))
    covariance[np.triu_indices(3)] = [m.velocity_covariance[i] for i in (0, 1, 2, 6, 7, 11)]
    covariance = covariance + np.triu(covariance, 1).T
    along = FLIP @ rotation_matrix(state.quaternion_WB).T @ AXIS
    across = np.linalg.svd(along[None])[2][1:]
    assert np.linalg.eigvalsh(across @ covariance @ across.T) == pytest.approx([LATERAL_VARIANCE] * 2)
    assert math.sqrt(along @ covariance @ along) == pytest.approx(state.sigma_axial_velocity_m_s, rel=0.3)


def test_variances_grow_where_only_inertial_samples_are_left(flight: MadeFlight) -> None:
    """Image motion stops at 3 s, UWB goes on; then UWB stops too."""
    core = FilterCore(lambda: flight.config)
    start = flight.tables["imu0"].t_ns[0]
    velocity, position = [], []
    for reading in readings(flight):
        t = (reading.t_ns - start) * 1e-9
        if t > 3.0 and reading.sensor != "imu0":
            continue
        core.push(reading, reading.t_ns)
        if reading.sensor == "imu0" and t > 2.9 and (snapshot := core.snapshot(reading.t_ns)) is not None:
            m = odometry(snapshot, AXIS, 0.0, "full", 50, 0)
            velocity.append(m.velocity_covariance[0])
            position.append(m.pose_covariance[0])
    assert velocity[-1] > 4.0 * velocity[0]
    assert position[-1] > 4.0 * position[0]
    assert min(velocity) >= 0.05**2 - 1e-12
    assert min(position) >= 0.1**2 - 1e-12


def test_confidence_makes_ardupilot_assume_our_worst_axis(snapshots: list[Snapshot]) -> None:
    state = copy.copy(snapshots[-1].state)
    for sigma, confidence in ((0.05, 100.0), (0.1, 100.0), (0.5, 50.0), (0.9, 0.0), (2.0, 0.0)):
        covariance = np.diag([1.0] * 3 + [0.01, sigma**2, 0.01] + [1.0] * 12)
        object.__setattr__(state, "covariance", covariance)
        if sigma >= 0.1:
            assert delta_confidence(state) == pytest.approx(confidence)
        else:
            assert delta_confidence(state) == pytest.approx(confidence, abs=1e-9)


# every rule broken on purpose ---------------------------------------------------------------------------------------


def good(snapshots: list[Snapshot]) -> Iterator[tuple[int, Any]]:
    for k, snapshot in enumerate(snapshots[:60]):
        yield snapshots[0].state.t_ns + k * PERIOD_NS, odometry(snapshot, AXIS, 0.0, "full", 80, 7)


def spoil_at(k: int, **fields: Any) -> Any:
    def spoil(number: int, now_ns: int, m: Any) -> int:
        if number == k:
            for name, value in fields.items():
                setattr(m, name, value)
        return now_ns

    return spoil


def later(number: int, now_ns: int, m: Any) -> int:
    return now_ns + (300 * MS if number >= 30 else 0)


def closer(number: int, now_ns: int, m: Any) -> int:
    return now_ns - (16 * MS if number == 30 else 0)


def frozen(number: int, now_ns: int, m: Any) -> int:
    if number >= 30:
        m.time_usec = 4_000_000
    return now_ns


def stepped(number: int, now_ns: int, m: Any) -> int:
    m.time_usec -= 2_000_000 if number >= 30 else 0
    return now_ns


def small(values: list[float]) -> list[float]:
    return [1e-6 if i in DIAGONAL else v for i, v in enumerate(values)]


BOTH = (ContractArduPilot, ContractPx4)
BROKEN = [
    ("wrong frame", BOTH, spoil_at(30, frame_id=12), "frames"),
    ("child frame of old", (ContractArduPilot,), spoil_at(30, child_frame_id=8), "frames"),
    ("velocity in a local frame", (ContractArduPilot,), spoil_at(30, child_frame_id=20), "frames"),
    ("two within 20 ms", (ContractArduPilot,), closer, "within 20 ms"),
    ("a pause", (ContractPx4,), later, "more than 200 ms since the last"),
    ("quality -1", BOTH, spoil_at(30, quality=-1), "quality"),
    ("quaternion not of length 1", BOTH, spoil_at(30, q=[1.0, 0.01, 0.0, 0.0]), "quaternion"),
    ("jump without counter", (ContractArduPilot,), spoil_at(30, x=9.0), "position jump without a new reset counter"),
    ("estimator type 6", (ContractPx4,), spoil_at(30, estimator_type=6), "estimator type"),
    ("naive estimator", (ContractPx4,), spoil_at(30, estimator_type=1), "covariances dropped"),
    ("frozen stamp", BOTH, frozen, "repeated stamp"),
    ("clock 2 s back", BOTH, stepped, "stamp goes back"),
    ("latency grows", (ContractArduPilot,), later, "late by its own clock"),
    ("too sure", BOTH, spoil_at(30, velocity_covariance=[1e-6] * 21), "velocity covariance smaller"),
    ("velocity not a number", BOTH, spoil_at(30, vy=math.nan), "velocity or rate not finite"),
]


@pytest.mark.parametrize(
    ("contract", "spoil", "rule"),
    [pytest.param(c, spoil, rule, id=f"{c.__name__}: {name}") for name, which, spoil, rule in BROKEN for c in which],
)
def test_every_rule_broken_on_purpose_is_noticed(
    snapshots: list[Snapshot], contract: type[Contract], spoil: Any, rule: str
) -> None:
    autopilot, packer = contract(), ours()
    for number, (now_ns, message) in enumerate(good(snapshots)):
        at = spoil(number, now_ns, message)
        autopilot.take(packed(message, packer), at)
        assert number >= 30 or autopilot.refused() == {}
    assert any(rule in found for found in autopilot.refused()), autopilot.refused()


def test_a_wrong_lateral_velocity_makes_ardupilot_refuse_all_three_axes(snapshots: list[Snapshot]) -> None:
    """Why the axial-only message is for PX4: the covariance does not help, one axis takes the others with it."""
    truth = {s.state.t_ns: FLIP @ s.state.velocity_m_s for s in snapshots}
    autopilot, packer = ContractArduPilot(velocity_ned=lambda t: truth[t]), ours()
    for k, snapshot in enumerate(snapshots[:20]):
        m = odometry(snapshot, AXIS, 0.0, "axial", 80, 0)
        if k == 10:
            m.vy += 1.5
        autopilot.take(packed(m, packer), snapshot.state.t_ns)
    assert autopilot.refused() == {"ODOMETRY: velocity gate of all three axes": 1}


def test_another_component_or_a_foreign_system_is_noticed(snapshots: list[Snapshot]) -> None:
    autopilot = ContractArduPilot()
    stranger = mavlink.MAVLink(None, srcSystem=9, srcComponent=191)
    autopilot.take(packed(heartbeat(), stranger), 0)
    autopilot.take(packed(odometry(snapshots[0], AXIS, 0.0, "full", 80, 0), stranger), 0)
    assert set(autopilot.refused()) == {"HEARTBEAT: not an onboard controller", "ODOMETRY: foreign system"}


def test_the_estimator_is_the_one_that_replays(flight: MadeFlight, snapshots: list[Snapshot]) -> None:
    """The core adds nothing: the same readings give the same bits as an estimator of one's own."""
    estimator = CorridorEstimator(flight.config)
    for reading in readings(flight):
        estimator.push(reading)
        if reading.t_ns >= snapshots[-1].imu_ns and reading.sensor == "imu0":
            break
    mine = estimator.state(snapshots[-1].state.t_ns)
    assert mine.velocity_m_s.tobytes() == snapshots[-1].state.velocity_m_s.tobytes()
