"""A camera moved in metres and radians past a wall sees what the pinhole equations say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.posed import WallPlane, posed_light
from axialnav.replay.simulate.render import CameraModel, Wall
from axialnav.replay.simulate.walls import OVERSAMPLING

CAMERA = CameraModel(width=320, height=160, focal_px=160.0)
PERIOD_S = CAMERA.frame_period_s
FACING_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # image right is world x, the axis is world y
Array = NDArray[np.float64]


def plane_of(wall: Wall, distance_m: float = 2.0, contrast: float = 0.2) -> WallPlane:
    return WallPlane(wall, 0.0125, (0.0, distance_m, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), contrast)


def turned(axis: str, angle: float) -> Array:
    """Rotation about an axis of the camera: x right, y down, z ahead."""
    c, s = math.cos(angle), math.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def moving(velocity_m_s: Array, axis: str = "y", rate_rad_s: float = 0.0, start_s: float = 0.0):
    def poses(delay: Array) -> tuple[Array, Array]:
        time = delay + start_s
        return time[:, None] * velocity_m_s, np.stack([FACING_Y @ turned(axis, rate_rad_s * t) for t in time])

    return poses


def flow_px(first: NDArray[np.float32], second: NDArray[np.float32], part: tuple[slice, slice]) -> tuple[float, float]:
    """Least-squares shift of a smooth picture [px], x and y."""
    mean = 0.5 * (first.astype(float) + second.astype(float))
    gy, gx = np.gradient(mean)
    change = (second.astype(float) - first.astype(float))[part].ravel()
    slopes = np.stack([gx[part].ravel(), gy[part].ravel()], axis=1)
    x, y = np.linalg.lstsq(slopes, -change, rcond=None)[0]
    return float(x), float(y)


CENTRE = (slice(70, 90), slice(150, 170))


@pytest.mark.parametrize(("velocity_m_s", "distance_m"), [(0.3, 2.0), (-0.2, 1.4), (0.25, 2.6)])
def test_translation_moves_the_picture_by_f_v_t_over_z(
    smooth_wall: Wall, velocity_m_s: float, distance_m: float
) -> None:
    plane, velocity = plane_of(smooth_wall, distance_m), np.array([velocity_m_s, 0.0, 0.0])
    pair = [posed_light(plane, CAMERA, moving(velocity, start_s=t)) for t in (-0.5 * PERIOD_S, 0.5 * PERIOD_S)]
    x, y = flow_px(pair[0], pair[1], (slice(10, 150), slice(10, 310)))
    assert x == pytest.approx(-CAMERA.focal_px * velocity_m_s * PERIOD_S / distance_m, abs=0.01)
    assert y == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("axis", "sign"), [("y", -1.0), ("x", 1.0)])
def test_rotation_moves_the_centre_by_f_w_t(smooth_wall: Wall, axis: str, sign: float) -> None:
    rate = 0.05
    pair = [
        posed_light(plane_of(smooth_wall), CAMERA, moving(np.zeros(3), axis, rate, t))
        for t in (-0.5 * PERIOD_S, 0.5 * PERIOD_S)
    ]
    x, y = flow_px(pair[0], pair[1], CENTRE)
    along, across = (x, y) if axis == "y" else (y, x)
    assert along == pytest.approx(sign * CAMERA.focal_px * rate * PERIOD_S, abs=0.01)
    assert across == pytest.approx(0.0, abs=0.01)


def test_fast_motion_blurs_as_a_sinc() -> None:
    wave = np.sin(2 * np.pi * np.arange(2 * 640) / (2 * 16.0)).astype(np.float32)  # 16 px long
    wall = Wall("wave", np.ascontiguousarray(np.broadcast_to(wave, (64, wave.size))))
    still, fast = (posed_light(plane_of(wall), CAMERA, moving(np.array([v, 0.0, 0.0]))) for v in (0.0, 8.0))
    blur_px = CAMERA.focal_px * 8.0 * CAMERA.exposure_s / 2.0
    assert fast.std() / still.std() == pytest.approx(np.sinc(blur_px / 16.0), rel=0.02)


def test_a_rolling_shutter_shears_the_picture(sine_wall) -> None:
    rolling = CameraModel(width=320, height=160, focal_px=160.0, readout_s=0.02)
    light = posed_light(plane_of(sine_wall(1 / 16)), rolling, moving(np.array([1.0, 0.0, 0.0])))
    phase = np.unwrap(np.angle((light - 1.0) @ (np.exp(-2j * np.pi * np.arange(320) / 16.0) * np.hanning(320))))
    shift_px = -(phase - phase[0]) * 16.0 / (2 * np.pi)
    wanted = -CAMERA.focal_px * 1.0 * 0.02 / 2.0  # over the whole readout
    assert np.polyfit(np.arange(160), shift_px, 1)[0] * 160 == pytest.approx(wanted, rel=0.05)


def test_homography_agrees_with_a_ray_cut_with_the_plane(smooth_wall: Wall) -> None:
    rng = np.random.default_rng(3)
    plane = plane_of(smooth_wall)
    for _ in range(20):
        position = rng.uniform(-0.5, 0.5, 3)
        rotation = FACING_Y @ turned("x", rng.uniform(-0.2, 0.2)) @ turned("y", rng.uniform(-0.2, 0.2))
        u, v = rng.uniform(0, 320), rng.uniform(0, 160)
        ray = rotation @ np.array([(u - 159.5) / 160.0, (v - 79.5) / 160.0, 1.0])
        hit = position + ray * (2.0 - position[1]) / ray[1]
        seen = plane.homography(position, rotation, CAMERA) @ np.array([u, v, 1.0])
        np.testing.assert_allclose(seen[:2] / seen[2], [hit[0] / 0.0125, -hit[2] / 0.0125], atol=1e-9)


def test_the_picture_has_the_walls_mean_and_contrast(sine_wall) -> None:
    light = posed_light(plane_of(sine_wall(1 / 40), contrast=0.1), CAMERA, moving(np.zeros(3)))
    assert light.mean() == pytest.approx(1.0, abs=0.01)
    assert light.std() == pytest.approx(0.1, rel=0.03)
    assert light.shape == (160, 320)
    assert OVERSAMPLING == 2


def test_impossible_views_are_refused(smooth_wall: Wall) -> None:
    plane = plane_of(smooth_wall)
    with pytest.raises(ConfigError, match="behind the wall"):
        posed_light(plane, CAMERA, lambda t: (np.tile([0.0, 3.0, 0.0], (len(t), 1)), np.stack([FACING_Y] * len(t))))
    aside = FACING_Y @ turned("y", 1.2)
    with pytest.raises(ConfigError, match="past the end"):
        posed_light(plane, CAMERA, lambda t: (np.zeros((len(t), 3)), np.stack([aside] * len(t))))
    grazing = FACING_Y @ turned("y", math.pi / 4 - 0.004)
    with pytest.raises(ConfigError, match="the limit is"):
        posed_light(plane, CAMERA, lambda t: (np.zeros((len(t), 3)), np.stack([grazing] * len(t))))
    with pytest.raises(ConfigError, match="pitch_m"):
        WallPlane(smooth_wall, 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    with pytest.raises(ConfigError, match="orthogonal"):
        WallPlane(smooth_wall, 0.01, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0))
