"""Unsigned blur lengths: used only while the direction of motion is known, and then with its sign."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from axialnav.fusion.config import Config, Initial
from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.outcome import Outcome, Reason, Verdict
from axialnav.fusion.readings import BlurLength, ImuSample
from axialnav.models.rig import BlurMeter, Imu, Surface
from tests.fusion.made_flights import GRAVITY, transform

FOCAL_PX, WINDOW_S, WALL_M = 600.0, 0.1, 2.0
PX_PER_M_S = FOCAL_PX * WINDOW_S / WALL_M
LEFT_BS = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))  # looks left, image x forward
T_BLUR_NS = 1_100_000_000


def config(speed_m_s: float, sigma_m_s: float = 0.1) -> Config:
    blur = BlurMeter(T_BS=transform(LEFT_BS), focal_px=(FOCAL_PX, FOCAL_PX), surface="wall", law="exposure")
    return Config(
        initial=Initial(position_m=(0, 0, 1), velocity_m_s=(speed_m_s, 0, 0), sigma_velocity_m_s=sigma_m_s),
        surface={"wall": Surface(normal=(0.0, -1.0, 0.0), offset_m=-WALL_M)},
        sensor={"imu0": Imu(), "blur0": blur},
    )


def after(c: Config, length_px: float, sigma_px: float = 0.5) -> tuple[Outcome, CorridorEstimator]:
    """Fly straight for a good second, then read one blur length."""
    estimator = CorridorEstimator(c)
    for k in range(221):
        estimator.push(ImuSample(t_ns=k * 5_000_000, sensor="imu0", gyro_rad_s=(0, 0, 0), accel_m_s2=(0, 0, GRAVITY)))
    reading = BlurLength(t_ns=T_BLUR_NS, sensor="blur0", window_s=WINDOW_S, length_px=length_px, sigma_px=sigma_px)
    return estimator.push(reading), estimator


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_length_corrects_the_speed_in_the_direction_of_motion(direction: float) -> None:
    """Flying at 2 m/s, the blur says 2.1: forwards the velocity rises, backwards it falls."""
    outcome, estimator = after(config(2.0 * direction), 2.1 * PX_PER_M_S)
    assert outcome.verdict is Verdict.FUSED
    assert outcome.innovation[0] == pytest.approx(0.1 * PX_PER_M_S, rel=1e-6)
    assert estimator.state().axial_velocity_m_s == pytest.approx(2.1 * direction, abs=0.06)
    assert abs(estimator.state().axial_velocity_m_s) > 2.02


def test_while_the_direction_is_not_known_a_length_says_nothing_and_is_not_called_wrong() -> None:
    outcome, estimator = after(config(0.1, sigma_m_s=0.2), 0.3 * PX_PER_M_S)
    assert (outcome.verdict, outcome.reason) == (Verdict.BLIND, Reason.SIGN_UNCERTAIN)
    assert estimator.state().axial_velocity_m_s == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize(("factor", "reason"), [(0.9, Reason.SIGN_UNCERTAIN), (1.1, Reason.NONE)])
def test_known_means_two_sigma_of_velocity(factor: float, reason: Reason) -> None:
    """Read the sigma at the moment of the blur from the filter itself, then start just below and just above."""
    _, probe = after(config(1.0, 0.2), 1.0 * PX_PER_M_S, sigma_px=1e4)
    sigma = probe.state().sigma_axial_velocity_m_s
    speed = 2.0 * factor * sigma
    outcome, _ = after(config(speed, 0.2), max(speed, 0.3) * PX_PER_M_S)
    assert outcome.reason is reason


def test_a_blur_shorter_than_its_noise_is_blind_not_gated() -> None:
    outcome, _ = after(config(1.0), 0.9, sigma_px=0.5)
    assert (outcome.verdict, outcome.reason) == (Verdict.BLIND, Reason.TOO_SHORT)


def test_a_length_that_cannot_be_is_gated() -> None:
    outcome, estimator = after(config(2.0), 4.0 * PX_PER_M_S)
    assert (outcome.verdict, outcome.reason) == (Verdict.GATED, Reason.INNOVATION)
    assert outcome.nis > outcome.gate
    assert estimator.state().axial_velocity_m_s == pytest.approx(2.0, abs=1e-9)


def test_a_camera_that_does_not_see_the_wall_is_blind() -> None:
    c = config(2.0)
    right = msgspec.structs.replace(
        c.sensor["blur0"], T_BS=transform(((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, -1.0, 0.0)))
    )
    outcome, _ = after(msgspec.structs.replace(c, sensor={**c.sensor, "blur0": right}), 30.0)
    assert (outcome.verdict, outcome.reason) == (Verdict.BLIND, Reason.NO_GEOMETRY)


def test_many_lengths_find_the_speed() -> None:
    """Started at 1.5 m/s while 2.0 is true: half a second of blur lengths brings the velocity to the truth."""
    rng = np.random.default_rng(1)
    for sign in (1.0, -1.0):
        _, estimator = after(config(1.5 * sign, 0.3), 2.0 * PX_PER_M_S)
        for k in range(221, 321):
            t_ns = k * 5_000_000
            estimator.push(ImuSample(t_ns=t_ns, sensor="imu0", gyro_rad_s=(0, 0, 0), accel_m_s2=(0, 0, GRAVITY)))
            if k % 7 == 0:
                length = 2.0 * PX_PER_M_S + rng.normal(0, 0.5)
                blur = BlurLength(t_ns=t_ns, sensor="blur0", window_s=WINDOW_S, length_px=length, sigma_px=0.5)
                assert estimator.push(blur).verdict is Verdict.FUSED
        state = estimator.state()
        assert state.axial_velocity_m_s == pytest.approx(2.0 * sign, abs=3.0 * state.sigma_axial_velocity_m_s)
        assert state.sigma_axial_velocity_m_s < 0.17  # it was 0.3; the distance to the wall is not measured here
