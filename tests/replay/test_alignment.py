"""Rigid alignment against scipy, and the cases in which least squares is tempted to mirror."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.replay.alignment import rigid_alignment


def test_exact_motion_is_recovered() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(50, 3))
    rotation = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    motion = rigid_alignment(points, points @ rotation.T + [1.0, 2.0, 3.0])
    np.testing.assert_allclose(motion.rotation, rotation, atol=1e-12)
    np.testing.assert_allclose(motion.translation_m, [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(motion.points(points), points @ rotation.T + [1.0, 2.0, 3.0], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_noisy_rotation_is_that_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(200, 3))
    reference = Rotation.random(rng=rng).apply(points) + 0.3 * rng.normal(size=points.shape) + [5.0, 0.0, -1.0]
    expected, _ = Rotation.align_vectors(reference - reference.mean(0), points - points.mean(0))
    motion = rigid_alignment(points, reference)
    np.testing.assert_allclose(motion.rotation, expected.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(motion.points(points).mean(0), reference.mean(0), atol=1e-12)


def test_a_mirrored_cloud_is_not_mirrored_back() -> None:
    points = np.random.default_rng(2).normal(size=(40, 3))
    motion = rigid_alignment(points, points * [1.0, 1.0, -1.0])
    assert np.linalg.det(motion.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("dimensions", [0, 1, 2])
def test_degenerate_tracks_still_align(dimensions: int) -> None:
    points = np.random.default_rng(3).normal(size=(30, 3))
    points[:, dimensions:] = 0.0
    rotation = Rotation.from_rotvec([0.0, 0.4, 1.0]).as_matrix()
    reference = points @ rotation.T + [1.0, 1.0, 1.0]
    motion = rigid_alignment(points, reference)
    assert np.linalg.det(motion.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(motion.points(points), reference, atol=1e-12)


def test_covariances_turn_with_the_vectors() -> None:
    points = np.random.default_rng(4).normal(size=(30, 3))
    motion = rigid_alignment(points, Rotation.from_rotvec([0.0, 0.0, np.pi / 2]).apply(points))
    turned = motion.covariances(np.diag([1.0, 4.0, 9.0])[None])[0]
    np.testing.assert_allclose(turned, np.diag([4.0, 1.0, 9.0]), atol=1e-12)
