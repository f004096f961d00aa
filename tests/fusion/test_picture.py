"""What a picture's columns say together: the mean of those that move alike, whatever the rest does."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.kernels.picture import SPREAD_SHARE, VIEW, motion_at_slope, motion_of_picture
from axialnav.fusion.memory import COLUMNS, new_scratch
from axialnav.fusion.sources import build_sources
from axialnav.models.rig import Camera, Face, Imu, Surface
from axialnav.models.state import E_VEL, zero_state

FOCAL_PX, WALL_Y_M = 160.0, 2.0
LEFT = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
WALL = Surface(normal=(0.0, -1.0, 0.0), offset_m=-WALL_Y_M)


def looking(surface: Surface = WALL, width_px: int = 320):
    """Source of a camera that looks to the left, and scratch with a vehicle at the origin, level, standing still."""
    camera = Camera(
        T_BS=LEFT, resolution=(width_px, 240), intrinsics=(FOCAL_PX, FOCAL_PX, 160.0, 120.0), surface="wall"
    )
    config = Config(sensor={"cam0": camera, "imu0": Imu()}, surface={"wall": surface})
    w = new_scratch()[0]
    w["x"], w["R"], w["p"], w["variance"], w["rate"] = zero_state(), np.eye(3), 0.0, 0.0, 0.0
    return build_sources(config)[1], w


def motion(source, w, window_s: float = 1 / 30, axis: int = 0) -> float:
    return motion_of_picture(source, window_s, float(source["coherence_px"]), np.int64(axis), w)


def columns(source, w, window_s: float = 1 / 30) -> NDArray[np.float64]:
    slopes = source["half_view"] * (2.0 * np.arange(COLUMNS) - COLUMNS + 1) / COLUMNS
    return np.array([motion_at_slope(source, window_s, np.int64(0), slope, w) for slope in slopes])


def test_past_a_flat_wall_every_column_moves_by_f_v_t_over_z() -> None:
    source, w = looking()
    w["x"][3] = 1.2
    assert motion(source, w) == pytest.approx(-FOCAL_PX * 1.2 / 30 / WALL_Y_M)
    assert w["variance"][0] == pytest.approx(0.0, abs=1e-20)


def test_a_slow_turn_moves_the_picture_by_the_mean_over_what_is_in_view() -> None:
    """The mean of 1 + a^2 over slopes up to 0.85 of a view of 90 degrees is 1.24."""
    source, w = looking()
    w["rate"][2] = 0.01
    assert motion(source, w) == pytest.approx(FOCAL_PX * 0.01 / 30 * (1 + VIEW**2 / 3), rel=0.01)


def test_the_rim_counts_less_the_faster_the_picture_moves() -> None:
    """What leaves the picture during the window is not in all of its frames: turn and speed, one by one, do not add."""
    source, w = looking()
    w["rate"][2] = 0.01
    turned = motion(source, w)
    w["x"][3] = 3.0
    both = motion(source, w)
    w["rate"][2] = 0.0
    assert both - motion(source, w) < turned - 0.001


def test_a_narrow_picture_and_a_flow_chip_are_compared_with_their_axis() -> None:
    source, w = looking(width_px=2)
    w["rate"][2], w["x"][3] = 1.0, 0.5
    centre = motion_at_slope(source, 1 / 30, np.int64(0), 0.0, w)
    assert motion(source, w) == pytest.approx(centre, rel=1e-4)
    source["half_view"] = 0.0
    assert motion(source, w) == centre
    assert source["coherence_px"] == pytest.approx(0.65)  # five frames


def test_a_fast_turn_is_read_off_the_columns_that_move_alike_and_trusted_less() -> None:
    source, w = looking()
    w["rate"][2] = 1.0
    moved = columns(source, w)
    read = motion(source, w)
    assert moved.min() < read < moved.min() + 0.2 * np.ptp(moved)
    inside = np.abs(moved - read) < 2 * source["coherence_px"]
    assert np.sqrt(w["variance"][0]) == pytest.approx(SPREAD_SHARE * moved[inside].std(), rel=0.3)


def test_of_two_walls_in_view_the_one_in_the_middle_counts() -> None:
    """A wall that ends 0.4 m ahead of the axis, and 8 m behind it another one: a fourth of the motion."""
    near = Face(normal=WALL.normal, offset_m=-WALL_Y_M, start=(-9.0, 2.0, 0.0), end=(0.4, 2.0, 0.0))
    far = Face(normal=WALL.normal, offset_m=-8.0, start=(-50.0, 8.0, 0.0), end=(50.0, 8.0, 0.0))
    source, w = looking(Surface(normal=WALL.normal, face=(near, far)))
    w["x"][3] = 1.5
    moved = columns(source, w)
    assert np.ptp(moved) > 2.5
    assert motion(source, w) == pytest.approx(-FOCAL_PX * 1.5 / 30 / WALL_Y_M, rel=0.01)


def test_a_column_that_meets_nothing_is_left_out() -> None:
    """A wall that ends 0.4 m ahead, and nothing behind it; the axis has to meet it."""
    half = Face(normal=WALL.normal, offset_m=-WALL_Y_M, start=(-9.0, 2.0, 0.0), end=(0.4, 2.0, 0.0))
    source, w = looking(Surface(normal=WALL.normal, face=(half,)))
    w["x"][3] = 1.5
    assert np.isnan(columns(source, w)).any()
    assert motion(source, w) == pytest.approx(-FOCAL_PX * 1.5 / 30 / WALL_Y_M)
    w["p"][0] = 1.0
    assert np.isnan(motion(source, w))


def test_the_jacobian_is_the_derivative_where_the_columns_agree() -> None:
    source, w = looking()
    w["x"][3], w["rate"][2] = 0.8, 0.02

    def read(speed_m_s: float) -> float:
        w["x"][3] = speed_m_s
        return motion(source, w)

    slope = (read(0.8 + 1e-4) - read(0.8 - 1e-4)) / 2e-4
    read(0.8)
    assert w["H"][0, E_VEL] == pytest.approx(slope, rel=1e-3)


def test_the_jacobian_is_that_of_the_columns_in_use_the_middle_one_included() -> None:
    """Of a wall that ends beside the middle column on both sides, the middle column is all that is seen."""
    strip = Face(normal=WALL.normal, offset_m=-WALL_Y_M, start=(-0.1, 2.0, 0.0), end=(0.1, 2.0, 0.0))
    source, w = looking(Surface(normal=WALL.normal, face=(strip,)))
    w["x"][3] = 0.8
    seen = np.isfinite(columns(source, w))
    assert seen.nonzero()[0].tolist() == [COLUMNS // 2]
    motion(source, w)
    assert w["H"][0, E_VEL : E_VEL + 2] == pytest.approx([-FOCAL_PX / 30 / WALL_Y_M, 0.0], abs=1e-12)


def test_climbing_past_a_wall_moves_the_picture_down_its_columns() -> None:
    """Up the stairs: f v T / Z along the rows by what is flown along, and across them by what is climbed."""
    source, w = looking()
    w["x"][3], w["x"][5] = 0.9, 0.5
    assert motion(source, w) == pytest.approx(-FOCAL_PX * 0.9 / 30 / WALL_Y_M)
    assert motion(source, w, axis=1) == pytest.approx(FOCAL_PX * 0.5 / 30 / WALL_Y_M)
    assert w["H"][1, E_VEL : E_VEL + 3] == pytest.approx([0.0, 0.0, FOCAL_PX / 30 / WALL_Y_M], abs=1e-12)


def test_what_goes_across_is_seen_in_the_columns_that_the_rows_follow() -> None:
    """Two walls, one four times as far: the columns of the far one are left out along, and so they are across."""
    near = Face(normal=WALL.normal, offset_m=-WALL_Y_M, start=(-9.0, 2.0, 0.0), end=(0.4, 2.0, 0.0))
    far = Face(normal=WALL.normal, offset_m=-8.0, start=(-50.0, 8.0, 0.0), end=(50.0, 8.0, 0.0))
    source, w = looking(Surface(normal=WALL.normal, face=(near, far)))
    w["x"][3], w["x"][5] = 1.5, 0.5
    motion(source, w)
    assert motion(source, w, axis=1) == pytest.approx(FOCAL_PX * 0.5 / 30 / WALL_Y_M, rel=0.01)


def test_rolling_about_the_axis_moves_both_sides_of_the_picture_apart_and_its_middle_not() -> None:
    source, w = looking()
    w["x"][3], w["rate"][1] = 0.5, 0.3  # the camera looks along the body's y axis
    motion(source, w)
    assert motion(source, w, axis=1) == pytest.approx(0.0, abs=1e-9)
    assert np.sqrt(w["variance"][1]) > 0.1
