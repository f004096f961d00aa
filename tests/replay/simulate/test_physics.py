"""The simulator against physics: integration gives the truth, pictures move as a pinhole's, noise is as stated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift
from scipy.spatial.transform import Rotation

from axialnav.replay.simulate.corridor_view import CorridorView
from axialnav.replay.simulate.demo import demo_mission
from axialnav.replay.simulate.flight import GRAVITY_M_S2, fly_mission
from axialnav.replay.simulate.mission import CameraPlan, Mission, SectionPlan, VehiclePlan, WallLook
from axialnav.replay.simulate.scenarios import mission_of
from axialnav.replay.simulate.sensors.camera import CameraOnBoard
from axialnav.replay.simulate.sensors.imu import ImuSheet, read_imu
from axialnav.replay.simulate.sensors.uwb import episodes
from axialnav.replay.simulate.vehicle import Motion
from axialnav.replay.simulate.walls import Wall

Array = NDArray[np.float64]


@pytest.mark.parametrize("scenario", ["stairs", "mission"])
def test_integrating_the_ideal_imu_gives_back_the_velocity(scenario: str) -> None:
    """Textbook strapdown, nothing of ours in it: the error of the velocity grows by less than 1e-6 m/s per second."""
    trajectory = fly_mission(mission_of(scenario, duration_s=12.0), seed=2).trajectory
    step = 1e-3
    t = np.arange(0.0, trajectory.duration_s, step)
    at = trajectory.at(t)
    middle = trajectory.at(t[:-1] + 0.5 * step)
    turn, force = middle.rate_rad_s * step, middle.force(GRAVITY_M_S2)
    attitude = at.rotation_WB[0]
    velocity = at.velocity_m_s[0].copy()
    half = Rotation.from_rotvec(0.5 * turn)
    whole = Rotation.from_rotvec(turn)
    for k in range(len(turn)):
        velocity += step * ((attitude * half[k]).apply(force[k]) - [0.0, 0.0, GRAVITY_M_S2])
        attitude = attitude * whole[k]
    assert np.abs(velocity - at.velocity_m_s[-1]).max() < 1e-6 * trajectory.duration_s
    assert (attitude.inv() * at.rotation_WB[-1]).magnitude() < 1e-6 * trajectory.duration_s


def test_velocity_and_acceleration_are_derivatives_of_position() -> None:
    trajectory = fly_mission(mission_of("corner"), seed=1).trajectory
    t, h = np.linspace(1.0, trajectory.duration_s - 1.0, 300), 1e-3
    ahead, here, back = trajectory.at(t + h), trajectory.at(t), trajectory.at(t - h)
    np.testing.assert_allclose((ahead.position_m - back.position_m) / (2 * h), here.velocity_m_s, atol=2e-6)
    np.testing.assert_allclose((ahead.velocity_m_s - back.velocity_m_s) / (2 * h), here.accel_m_s2, atol=2e-5)


SQUARE = Mission(
    name="square",
    section=(SectionPlan(kind="straight", length_m=30.0, left=WallLook(texture="concrete", contrast=0.2)),),
    vehicle=VehiclePlan(vibration_m_s2=0.0, clearance_sigma_m=0.02),
    camera=CameraPlan(width_px=320, height_px=240, focal_px=160.0, flicker_depth=0.0),
)


def shift_px(first: NDArray[np.float32], second: NDArray[np.float32], guess: Array) -> Array:
    """Shift between two pictures near their middle by least squares [px], x and y."""
    rows, cols = first.shape
    part = np.s_[rows // 2 - 30 : rows // 2 + 30, cols // 2 - 30 : cols // 2 + 30]
    start, target = (gaussian_filter(p.astype(float), 2.5) for p in (first, second))
    found = guess.copy()
    for _ in range(8):
        moved = shift(start, found[::-1], order=5, mode="nearest")
        gy, gx = np.gradient(moved)
        slopes = np.stack([gx[part].ravel(), gy[part].ravel()], axis=1)
        found -= np.linalg.lstsq(slopes, (target - moved)[part].ravel(), rcond=None)[0]
    return found


def test_pictures_of_a_flight_move_by_f_v_t_over_z_and_f_w_t() -> None:
    """A point of the wall, projected with the true poses, moves as the rendered content does."""
    flown = fly_mission(SQUARE, seed=4)
    board = CameraOnBoard(SQUARE, flown.world, flown.trajectory, flown.streams)
    period = board.model.frame_period_s
    errors = []
    for t in (6.0, 9.3, 14.1):
        first, second = (board.light(t + dt) for dt in (-0.5 * period, 0.5 * period))
        at = flown.trajectory.at(np.array([t]))
        camera = board.poses(t)(np.zeros(1))
        axes = camera[1][0]
        v_S = axes.T @ (at.velocity_m_s[0] + at.rotation_WB[0].apply(np.cross(at.rate_rad_s[0], [0.05, 0.06, 0.0])))
        w_S = axes.T @ at.rotation_WB[0].apply(at.rate_rad_s[0])
        depth = (1.5 - camera[0][0, 1]) / axes[1, 2]
        gain = 160.0 * period
        wanted = np.array([-gain * (v_S[0] / depth + w_S[1]), -gain * (v_S[1] / depth - w_S[0])])
        errors.append(shift_px(first, second, wanted) - wanted)
    assert np.abs(errors).max() < 0.01


def still(seconds: float, rate_hz: float) -> Motion:
    t = np.arange(int(seconds * rate_hz)) / rate_hz
    zero = np.zeros((len(t), 3))
    return Motion(t, zero, zero, zero, Rotation.identity(len(t)), zero)


def allan_deviation(values: Array, rate_hz: float, tau_s: float) -> float:
    """Overlapping Allan deviation of one column."""
    m = round(tau_s * rate_hz)
    total = np.concatenate([[0.0], np.cumsum(values)]) / rate_hz
    second = total[2 * m :] - 2 * total[m:-m] + total[: -2 * m]
    return float(np.sqrt(0.5 * np.mean(second**2)) / (m / rate_hz))


def test_noise_has_the_densities_of_the_data_sheet() -> None:
    sheet = ImuSheet(gyro_step=1e-9, accel_step=1e-9, gyro_walk=2e-4, accel_walk=2e-3)
    motion = still(2000.0, sheet.rate_hz)
    force = motion.force(GRAVITY_M_S2)
    quiet = np.zeros(len(motion.t_s))
    readings = read_imu(sheet, motion, force, quiet, quiet, np.random.default_rng(6)).table.columns
    for name, density, walk in (
        ("gyro_rad_s", sheet.gyro_density, sheet.gyro_walk),
        ("accel_m_s2", sheet.accel_density, sheet.accel_walk),
    ):
        short = np.mean([allan_deviation(readings[name][:, i], sheet.rate_hz, 0.05) for i in range(3)])
        assert short == pytest.approx(density / math.sqrt(0.05), rel=0.02)
        long = np.sqrt(np.mean([allan_deviation(readings[name][:, i], sheet.rate_hz, 60.0) ** 2 for i in range(3)]))
        stated = math.sqrt(density**2 / 60.0 + walk**2 * 60.0 / 3.0)  # IEEE 952: N / sqrt(tau), K sqrt(tau / 3)
        assert long == pytest.approx(stated, rel=0.35)  # 2000 s hold about 30 independent pairs per axis


def test_vibration_adds_noise_and_rectification() -> None:
    sheet = ImuSheet(accel_walk=0.0)
    motion = still(60.0, sheet.rate_hz)
    force, none = motion.force(GRAVITY_M_S2), np.zeros(len(motion.t_s))
    shaken = read_imu(sheet, motion, force, np.full(len(none), 2.0), none, np.random.default_rng(7))
    calm = read_imu(sheet, motion, force, none, none, np.random.default_rng(7))
    shift = shaken.accel_bias - calm.accel_bias
    np.testing.assert_allclose(np.abs(shift), sheet.rectification * 4.0, rtol=1e-9)
    assert shaken.table.columns["accel_m_s2"].std(axis=0) == pytest.approx(2.0, rel=0.03)


def test_reflections_are_long_one_sided_and_come_in_episodes() -> None:
    t = np.arange(0.0, 4000.0, 0.1)
    bias = episodes(t, np.ones(len(t), dtype=np.bool_), np.random.default_rng(8))
    change = np.flatnonzero(np.diff(bias)) + 1
    held, lasted = bias[change[:-1]], np.diff(t[change])
    reflected = held > np.median(held)
    assert (bias > 0.0).all()
    assert 1.3 < np.median(held[0::2] if held[0::2].mean() > held[1::2].mean() else held[1::2]) < 2.3
    assert np.quantile(held[reflected], 0.90) < 4.8
    assert lasted.max() <= 8.2
    assert np.quantile(lasted, 0.05) >= 0.15


@pytest.mark.parametrize("metres", [5.5, 6.4, 7.6, 11.5, 12.5])
def test_no_part_of_a_picture_stays_black(metres: float) -> None:
    """On stairs and in corners small pieces of ceiling and floor come into the picture's corners."""
    mission = demo_mission()
    flown = fly_mission(mission, seed=0)
    t = np.arange(0.0, flown.trajectory.duration_s, 0.02)
    way = np.linalg.norm(np.diff(flown.trajectory.at(t).position_m, axis=0), axis=1).cumsum()
    board = CameraOnBoard(mission, flown.world, flown.trajectory, flown.streams)
    plain = Wall("plain", np.random.default_rng(1).standard_normal((96, 192)).astype(np.float32))
    board.view = CorridorView(flown.world, board.model, 0.01, lambda _: plain)
    light = board.light(float(np.interp(metres, way, t[1:])))
    assert light.min() > 0.05
    assert light.max() < 2.0
