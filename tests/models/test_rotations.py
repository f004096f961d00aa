"""Quaternions against scipy, which was written by somebody else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.models.rotations import (
    SMALL_ANGLE_SQUARED,
    quaternion_from_euler,
    quaternion_from_vector,
    rotate_in_body,
    rotation_matrix,
)


def scipy_of(q) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


def test_matrix_of_any_unit_quaternion() -> None:
    for attitude in Rotation.random(200, rng=np.random.default_rng(1)):
        np.testing.assert_allclose(
            rotation_matrix(attitude.as_quat(scalar_first=True)), attitude.as_matrix(), atol=1e-14
        )


def test_euler_angles_mean_yaw_then_pitch_then_roll() -> None:
    rng = np.random.default_rng(2)
    for roll, pitch, yaw in rng.uniform([-3, -1.5, -3], [3, 1.5, 3], (200, 3)):
        expected = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        q = quaternion_from_euler(roll, pitch, yaw)
        assert (scipy_of(q).inv() * expected).magnitude() < 1e-14


def test_turning_in_body_axes_multiplies_from_the_right() -> None:
    rng = np.random.default_rng(3)
    for attitude in Rotation.random(200, rng=rng):
        turn = rng.normal(0, 1, 3)
        q = attitude.as_quat(scalar_first=True)
        rotate_in_body(q, *turn)
        assert (scipy_of(q).inv() * (attitude * Rotation.from_rotvec(turn))).magnitude() < 1e-14
        assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("factor", [0.0, 1e-6, 0.5, 1 - 1e-9, 1 + 1e-9, 2.0])
def test_series_of_small_angles_joins_the_closed_form_without_a_step(factor: float) -> None:
    angle = factor * np.sqrt(SMALL_ANGLE_SQUARED)
    q = quaternion_from_vector(np.array([0.6, 0.0, -0.8]) * angle)
    np.testing.assert_allclose(q, [np.cos(angle / 2), 0.6 * np.sin(angle / 2), 0, -0.8 * np.sin(angle / 2)], atol=1e-16)


def test_a_million_small_turns_stay_a_rotation_and_add_up() -> None:
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for _ in range(1_000_000 // 100):
        for _ in range(100):
            rotate_in_body(q, 0.0, 0.0, 1e-5)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    assert scipy_of(q).as_rotvec()[2] == pytest.approx((1e6 * 1e-5 + np.pi) % (2 * np.pi) - np.pi, abs=1e-9)
