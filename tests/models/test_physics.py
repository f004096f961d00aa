"""What sensors must read in situations a person can check in the head, and against moving points in an image."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.models.aiding import height, tilt
from axialnav.models.pixel_motion import pixel_motion
from axialnav.models.rotations import quaternion_from_euler, rotation_matrix
from axialnav.models.state import N_ERROR, UWB_BIAS, zero_state
from axialnav.models.uwb import MIN_RANGE_M, uwb_position, uwb_range, uwb_tdoa
from tests.models.states import random_state, rotation_of

# camera axes in body axes: optical axis to the left wall (+y), image x forward, image y down
LEFT_BS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
WALL_W = np.array([0.0, -1.0, 0.0])  # wall at y = 2: normal into the room
NONE = np.zeros(3)
FOCAL_PX, WINDOW_S, WALL_Y_M = 600.0, 0.01, 2.0


def flow(x, gyro=(0.0, 0.0, 0.0), lever=NONE, axis=0, R_BS=LEFT_BS, slope=0.0):
    return pixel_motion(
        x, x[:3], rotation_of(x).as_matrix(), np.array(gyro), R_BS, np.array(lever), WALL_W, -WALL_Y_M,
        False, np.full(2, FOCAL_PX * WINDOW_S), axis, slope, np.zeros(N_ERROR), np.empty(11),
    )  # fmt: skip


def along_the_wall(speed_m_s):
    x = zero_state()
    x[3] = speed_m_s
    return x


def test_flying_forward_past_a_wall_moves_its_image_by_f_v_t_over_z() -> None:
    """Forward is +x of the image, so the content moves towards -x."""
    assert flow(along_the_wall(1.5)) == pytest.approx(-FOCAL_PX * 1.5 * WINDOW_S / WALL_Y_M)
    assert flow(along_the_wall(-1.5)) == pytest.approx(FOCAL_PX * 1.5 * WINDOW_S / WALL_Y_M)
    assert flow(along_the_wall(1.5), axis=1) == pytest.approx(0.0, abs=1e-12)


def test_twice_as_far_from_the_wall_half_the_motion() -> None:
    near, far = along_the_wall(1.0), along_the_wall(1.0)
    near[1], far[1] = 1.0, 0.0
    assert flow(near) == pytest.approx(2.0 * flow(far))


def test_hovering_and_turning_moves_the_image_by_f_w_t_whatever_the_distance() -> None:
    """Yaw to the left turns the camera about its -y axis; the content moves by f w T towards +x."""
    for y in (0.0, 1.0):
        x = zero_state()
        x[1] = y
        assert flow(x, gyro=(0.0, 0.0, 0.7)) == pytest.approx(FOCAL_PX * 0.7 * WINDOW_S)


def test_the_blur_scale_stretches_every_motion() -> None:
    x = along_the_wall(1.0)
    plain = flow(x, gyro=(0.1, 0.2, 0.3))
    x[16] = 0.05
    assert flow(x, gyro=(0.1, 0.2, 0.3)) == pytest.approx(1.05 * plain)


def test_predicted_motion_is_that_of_a_wall_point_in_a_pinhole_image() -> None:
    """Brute force: project the wall point on the optical axis before and after a very short flight."""
    rng, dt = np.random.default_rng(31), 1e-6
    for _ in range(50):
        x = random_state(rng, tilt_rad=0.2)
        x[1] = rng.uniform(-1, 1)
        attitude = Rotation.from_euler("ZYX", rng.uniform(-0.3, 0.3, 3))
        x[6:10] = attitude.as_quat(scalar_first=True)
        x[10:13], x[16] = 0.0, 0.0
        gyro, lever = rng.normal(0, 0.8, 3), rng.normal(0, 0.1, 3)
        centre = x[:3] + attitude.apply(lever)
        axis_W = attitude.apply(LEFT_BS[:, 2])
        point = centre + axis_W * (WALL_Y_M - centre[1]) / axis_W[1]
        turned = attitude * Rotation.from_rotvec(gyro * dt)
        later = LEFT_BS.T @ turned.inv().apply(point - x[:3] - x[3:6] * dt - turned.apply(lever))
        seen = later[:2] / later[2] * FOCAL_PX * WINDOW_S / dt
        for axis in (0, 1):
            assert flow(x, gyro, lever, axis) == pytest.approx(seen[axis], abs=1e-3)


@pytest.mark.parametrize("slope", [-0.6, 0.35])
def test_beside_the_optical_axis_too(slope: float) -> None:
    """The same with a point that is seen on the image's x axis, a slope away from its centre."""
    rng, dt = np.random.default_rng(32), 1e-6
    for _ in range(30):
        x = random_state(rng, tilt_rad=0.2)
        x[1] = rng.uniform(-1, 1)
        attitude = Rotation.from_euler("ZYX", rng.uniform(-0.3, 0.3, 3))
        x[6:10] = attitude.as_quat(scalar_first=True)
        x[10:13], x[16] = 0.0, 0.0
        gyro = rng.normal(0, 0.8, 3)
        ray_W = attitude.apply(LEFT_BS[:, 2] + slope * LEFT_BS[:, 0])
        point = x[:3] + ray_W * (WALL_Y_M - x[1]) / ray_W[1]
        turned = attitude * Rotation.from_rotvec(gyro * dt)
        later = LEFT_BS.T @ turned.inv().apply(point - x[:3] - x[3:6] * dt)
        seen = (later[:2] / later[2] - [slope, 0.0]) * FOCAL_PX * WINDOW_S / dt
        for axis in (0, 1):
            assert flow(x, gyro, axis=axis, slope=slope) == pytest.approx(seen[axis], abs=1e-3)


def test_a_camera_that_does_not_face_the_wall_sees_nothing() -> None:
    away = LEFT_BS @ np.diag([-1.0, 1.0, -1.0])
    assert np.isnan(flow(along_the_wall(1.0), R_BS=away))


def test_a_camera_behind_the_wall_sees_nothing() -> None:
    x = along_the_wall(1.0)
    x[1] = WALL_Y_M + 0.5
    assert np.isnan(flow(x))


def test_uwb_reads_the_antenna_not_the_centre() -> None:
    """Nose to the left, antenna 0.5 m ahead of the centre: it is at y = 0.5."""
    x, R, H = zero_state(), Rotation.from_euler("z", np.pi / 2).as_matrix(), np.zeros(N_ERROR)
    ahead, anchor = np.array([0.5, 0.0, 0.0]), np.array([0.0, 4.0, 0.0])
    assert uwb_range(x, NONE, R, ahead, anchor, -1, H) == pytest.approx(3.5)
    assert uwb_tdoa(x, NONE, R, ahead, anchor, -anchor, -1, -1, H) == pytest.approx(4.5 - 3.5)
    assert uwb_position(x, NONE, R, ahead, 1, -1, H) == pytest.approx(0.5)


def test_the_bias_of_a_uwb_path_lengthens_what_is_measured_over_it() -> None:
    """Path 2 is 0.4 m too long, path 5 by 0.1 m; -1 has no bias."""
    x, H = zero_state(), np.zeros(N_ERROR)
    x[UWB_BIAS + 2], x[UWB_BIAS + 5] = 0.4, 0.1
    anchor = np.array([3.0, 0.0, 0.0])
    assert [uwb_range(x, NONE, np.eye(3), NONE, anchor, path, H) for path in (2, 5, -1)] == pytest.approx([3.4, 3.1, 3])
    for a, b, expected in ((2, 5, 3.0 + 0.1 - 0.4), (5, 2, 3.0 + 0.4 - 0.1), (-1, 2, 3.4)):
        assert uwb_tdoa(x, NONE, np.eye(3), NONE, anchor, 2 * anchor, a, b, H) == pytest.approx(expected)
    assert [uwb_position(x, NONE, np.eye(3), NONE, 1, path, H) for path in (2, 5, -1)] == [0.4, 0.1, 0.0]


def test_at_the_anchor_itself_the_range_has_no_direction() -> None:
    near = np.array([0.5 * MIN_RANGE_M, 0.0, 0.0])
    assert np.isnan(uwb_range(zero_state(), NONE, np.eye(3), NONE, near, -1, np.zeros(N_ERROR)))
    assert np.isnan(uwb_tdoa(zero_state(), NONE, np.eye(3), NONE, near, 99 * near, -1, -1, np.zeros(N_ERROR)))


def test_height_is_above_its_datum() -> None:
    assert height(np.array([1.0, 2.0, 3.0]), 100.0, np.zeros(N_ERROR)) == 103.0


def test_the_autopilot_calls_right_wing_down_and_nose_up_positive() -> None:
    """Nose up is a negative turn about y, which points left here; right wing down a positive one about x."""
    nose_up = Rotation.from_rotvec([0.0, -0.2, 0.0]).as_matrix()
    right_down = Rotation.from_rotvec([0.3, 0.0, 0.0]).as_matrix()
    assert tilt(nose_up, 1, np.zeros(N_ERROR)) == pytest.approx(0.2)
    assert tilt(right_down, 0, np.zeros(N_ERROR)) == pytest.approx(0.3)


def test_tilt_does_not_depend_on_the_heading() -> None:
    for yaw in (-2.0, 0.0, 3.0):
        R = rotation_matrix(quaternion_from_euler(0.3, -0.2, yaw))
        assert tilt(R, 0, np.zeros(N_ERROR)) == pytest.approx(0.3)
        assert tilt(R, 1, np.zeros(N_ERROR)) == pytest.approx(0.2)
