"""Differences of attitudes and their Jacobians against scipy's rotations and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.models.tangent import inverse_right_jacobian, right_jacobian, rotation_between

SIZES = (0.0, 1e-9, 5e-5, 2e-4, 0.1, 1.5, 3.1)


def random_vector(rng: np.random.Generator, size: float) -> np.ndarray:
    direction = rng.normal(size=3)
    return size * direction / np.linalg.norm(direction)


@pytest.mark.parametrize("size", SIZES)
def test_the_difference_of_two_attitudes_is_the_rotation_between_them(size: float) -> None:
    rng = np.random.default_rng(1)
    for sign in (1.0, -1.0):  # q and -q are the same attitude
        before, r = Rotation.random(rng=rng), random_vector(rng, size)
        after, out = before * Rotation.from_rotvec(r), np.empty(3)
        rotation_between(before.as_quat(scalar_first=True), sign * after.as_quat(scalar_first=True), out)
        np.testing.assert_allclose(out, r, atol=1e-15 + 1e-13 * size)


@pytest.mark.parametrize("size", SIZES)
def test_the_right_jacobian_is_the_derivative_of_the_exponential(size: float) -> None:
    rng = np.random.default_rng(2)
    r, J, h = random_vector(rng, size), np.empty((3, 3)), 1e-5
    right_jacobian(r, J)
    base = Rotation.from_rotvec(r).inv()
    for k, e in enumerate(np.eye(3)):
        ahead, back = (base * Rotation.from_rotvec(r + s * h * e) for s in (1.0, -1.0))
        np.testing.assert_allclose(J[:, k], (ahead.as_rotvec() - back.as_rotvec()) / (2 * h), atol=1e-9)


@pytest.mark.parametrize("size", SIZES)
def test_the_inverse_jacobian_is_the_inverse(size: float) -> None:
    r, J, inverse = random_vector(np.random.default_rng(3), size), np.empty((3, 3)), np.empty((3, 3))
    right_jacobian(r, J)
    inverse_right_jacobian(r, inverse)
    np.testing.assert_allclose(inverse @ J, np.eye(3), atol=1e-11)
