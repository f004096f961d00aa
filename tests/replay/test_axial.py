"""What axial means in a straight flight and in a corridor with sections."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.config import Corridor, Section
from axialnav.replay.axial import along, axial_frame, sigma_along

BENT = Corridor(
    section=(
        Section(kind="straight", start=(0.0, 0.0, 0.0), end=(10.0, 0.0, 0.0)),
        Section(kind="corner", start=(10.0, 0.0, 0.0), end=(11.0, 1.0, 0.0)),
        Section(kind="stairs", start=(11.0, 1.0, 0.0), end=(11.0, 5.0, 3.0)),
    )
)


def test_without_sections_axial_is_the_projection_on_one_axis() -> None:
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 0.0, 1.0]])
    frame = axial_frame(Corridor(axis=(0.0, 2.0, 0.0)), points)
    np.testing.assert_allclose(frame.position_m, [2.0, 0.0])
    np.testing.assert_allclose(frame.axis, [[0.0, 1.0, 0.0]] * 2)
    assert frame.names == ()


def test_without_a_corridor_axial_is_x() -> None:
    np.testing.assert_allclose(axial_frame(None, np.array([[7.0, 8.0, 9.0]])).position_m, [7.0])


def test_each_point_takes_the_axis_of_the_nearest_section() -> None:
    points = np.array([[5.0, 0.4, 1.0], [10.5, 0.5, 0.1], [11.0, 3.0, 1.5], [-2.0, 0.0, 0.0]])
    frame = axial_frame(BENT, points)
    assert frame.names == ("straight_1", "corner_2", "stairs_3")
    assert [frame.names[i] for i in frame.section] == ["straight_1", "corner_2", "stairs_3", "straight_1"]
    np.testing.assert_allclose(np.linalg.norm(frame.axis, axis=1), 1.0)
    np.testing.assert_allclose(frame.axis[2], [0.0, 0.8, 0.6])


def test_axial_position_is_the_way_travelled_and_has_no_step_between_sections() -> None:
    way = np.concatenate([np.linspace(s.start, s.end, 100) for s in BENT.section])
    position = axial_frame(BENT, way).position_m
    assert np.all(np.diff(position) > -1e-12)
    assert position[-1] == pytest.approx(10.0 + np.sqrt(2.0) + 5.0)


def test_sigma_along_an_axis_is_the_projected_covariance() -> None:
    axis = np.array([[0.6, 0.8, 0.0]])
    covariance = np.diag([4.0, 9.0, 1.0])[None]
    assert sigma_along(axis, covariance)[0] == pytest.approx(np.sqrt(0.36 * 4.0 + 0.64 * 9.0))
    assert along(axis, np.array([[1.0, 1.0, 5.0]]))[0] == pytest.approx(1.4)
