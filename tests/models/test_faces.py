"""Which plane of a surface a ray meets: against walking along the ray."""

from __future__ import annotations

import numpy as np

from axialnav.models.faces import nearest_face

# a corner that turns right, seen from inside: a wall along x, then one along -y, and one far behind the first
FACES = np.array(
    [
        [0.0, -1.0, 0.0, -1.5, -2.0, 1.5, 0.0, 11.5, 1.5, 0.0, 0.0],
        [-1.0, 0.0, 0.0, -11.5, 11.5, 1.5, 0.0, 11.5, -20.0, 0.0, 0.0],
        [0.0, -1.0, 0.0, -9.0, -2.0, 9.0, 0.0, 30.0, 9.0, 0.0, 0.0],
    ]
)


def walked(eye: np.ndarray, ray: np.ndarray) -> int:
    """Face behind whose plane a walker first finds himself while between its ends."""
    for distance in np.arange(0.002, 60.0, 0.002):
        point = eye + distance * ray
        for number, face in enumerate(FACES):
            along = face[7:10] - face[4:7]
            share = (point - face[4:7]) @ along / (along @ along)
            if face[:3] @ point < face[3] <= face[:3] @ (point - 0.002 * ray) and 0.0 <= share <= 1.0:
                return number
    return -1


def test_the_nearest_face_is_the_one_a_walker_meets_first() -> None:
    rng = np.random.default_rng(5)
    work, lever, ray_B = np.zeros(8), np.zeros(3), np.array([0.0, 1.0, 0.0])
    found = []
    for _ in range(60):
        eye = np.array([rng.uniform(0.0, 11.0), rng.uniform(-1.2, 1.2), 1.0])
        yaw = rng.uniform(-np.pi, np.pi)
        R = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        ray = R @ ray_B
        if np.abs(FACES[:, :3] @ ray).min() < 0.15:  # grazing rays are no one's
            continue
        found.append(nearest_face(FACES, np.int64(3), eye, R, lever, ray_B, work))
        assert found[-1] == walked(eye, ray)
    assert {0, 1, -1} <= set(found)


def test_only_the_first_rows_count() -> None:
    work = np.zeros(8)
    eye, forward = np.array([5.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    assert nearest_face(FACES, np.int64(3), eye, np.eye(3), np.zeros(3), forward, work) == 1
    assert nearest_face(FACES, np.int64(1), eye, np.eye(3), np.zeros(3), forward, work) == -1
