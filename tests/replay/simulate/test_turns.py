"""Frames of a camera that flies and turns: the filter's prediction of what the estimator reads from them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.estimators.estimate import estimate_motion
from axialnav.fusion.config import Config
from axialnav.fusion.kernels.picture import motion_at_slope, motion_of_picture
from axialnav.fusion.memory import new_scratch
from axialnav.fusion.sources import build_sources
from axialnav.models.rig import Camera, Imu, Surface
from axialnav.models.state import zero_state
from axialnav.replay.simulate.posed import WallPlane, posed_light
from axialnav.replay.simulate.render import CameraModel, Wall

WALL_Y_M, SPEED_M_S = 2.0, 0.6
CAMERA = CameraModel(width=320, height=160, focal_px=160.0)  # 90 degrees
CONTRAST, MEAN_DN, NOISE_DN = 0.1, 110.0, 2.4  # as bright light makes of the simulator's usual wall
PERIOD_S = CAMERA.frame_period_s
LEFT = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
FACING_Y = np.array(LEFT).reshape(4, 4)[:3, :3]


def filmed(wall: Wall, rate_rad_s: float, place_m: float) -> NDArray[np.uint8]:
    """Five frames; in the middle of them the camera is at the origin and faces the wall."""
    plane = WallPlane(wall, 0.0125, (place_m, WALL_Y_M, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), CONTRAST)
    rng, frames = np.random.default_rng(8), []
    for k in range(-2, 3):

        def poses(delay: NDArray[np.float64], k: int = k) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            t = delay + k * PERIOD_S
            c, s = np.cos(rate_rad_s * t), np.sin(rate_rad_s * t)
            yaw = np.array([[c, -s, 0 * t], [s, c, 0 * t], [0 * t, 0 * t, 1 + 0 * t]]).transpose(2, 0, 1)
            return t[:, None] * np.array([SPEED_M_S, 0.0, 0.0]), yaw @ FACING_Y

        light = MEAN_DN * posed_light(plane, CAMERA, poses)
        frames.append(np.clip(np.rint(light + NOISE_DN * rng.normal(size=light.shape)), 0, 255).astype(np.uint8))
    return np.stack(frames)


def predicted(rate_rad_s: float, coherence_px: float) -> tuple[float, float, float]:
    """Prediction for the picture and its sigma, and that for the optical axis [px]."""
    camera = Camera(
        T_BS=LEFT, resolution=(CAMERA.width, CAMERA.height), intrinsics=(160.0, 160.0, 159.5, 79.5), surface="wall"
    )
    wall = Surface(normal=(0.0, -1.0, 0.0), offset_m=-WALL_Y_M)
    source = build_sources(Config(sensor={"cam0": camera, "imu0": Imu()}, surface={"wall": wall}))[1]
    w = new_scratch()[0]
    w["x"], w["R"], w["rate"] = zero_state(), np.eye(3), [0.0, 0.0, rate_rad_s]
    w["x"][3] = SPEED_M_S
    axis = motion_at_slope(source, PERIOD_S, np.int64(0), 0.0, w)
    motion = motion_of_picture(source, PERIOD_S, coherence_px, np.int64(0), w)
    return motion, float(np.sqrt(w["variance"][0])), axis


@pytest.mark.parametrize("rate_rad_s", [-0.9, -0.3, 0.1, 0.3, 0.6])
def test_a_turn_moves_the_picture_as_the_filter_predicts(wall: Wall, rate_rad_s: float) -> None:
    """Four pieces of wall: within 3 sigma each, and as a whole nearer to the prediction than to that for the axis."""
    off, off_axis = np.empty(4), np.empty(4)
    for k in range(4):
        estimate = estimate_motion(filmed(wall, rate_rad_s, 2.3 * k), frame_period_s=PERIOD_S, exposure_s=0.01)
        assert estimate.accepted
        motion, sigma, axis = predicted(rate_rad_s, estimate.coherence_px)
        off[k], off_axis[k] = estimate.displacement_px - motion, estimate.displacement_px - axis
        assert abs(off[k]) < 3.0 * sigma + 0.005
    assert np.square(off).mean() < 0.5 * np.square(off_axis).mean()
