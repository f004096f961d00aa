"""The picture moves as physics says: f v T / Z, whatever else happens to it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from axialnav.replay.simulate.motion import Path
from axialnav.replay.simulate.render import (
    CameraModel,
    LightLevel,
    Scene,
    Trajectory,
    Wall,
    displacement_px,
    dropped_frame,
    duplicated_frame,
    render_frames,
)
from axialnav.replay.simulate.view import light_frames

SMALL = CameraModel(width=320, height=128)


def phase_shift(a: NDArray[np.uint8], b: NDArray[np.uint8], near: float) -> float:
    """Shift of b against a along the rows [px]: slope of the cross-spectrum's phase around a whole-pixel guess."""
    whole = round(near)
    width = a.shape[1] - abs(whole)
    first = a[:, max(0, -whole) :][:, :width].astype(float)
    second = b[:, max(0, whole) :][:, :width].astype(float)
    window = np.hanning(width)
    spectra = [np.fft.rfft((p - p.mean()) * window, axis=1)[:, 4 : width // 5] for p in (first, second)]
    cross = (spectra[1] * spectra[0].conj()).sum(axis=0)
    frequency = np.arange(4, width // 5) / width
    weight = np.abs(cross) * frequency
    return whole - float(weight @ np.angle(cross)) / (2 * np.pi * float(weight @ frequency))


@pytest.mark.parametrize(
    ("velocity_m_s", "distance_m"), [(0.4, 2.0), (-0.37, 1.3), (1.9, 2.2), (-3.0, 1.0), (0.013, 1.7)]
)
def test_displacement_is_f_v_t_over_z(
    wall: Wall, noiseless: LightLevel, velocity_m_s: float, distance_m: float
) -> None:
    expected = displacement_px(SMALL.focal_px, velocity_m_s, distance_m, SMALL.frame_period_s)
    scene = Scene(wall, 0.2, noiseless, SMALL, Trajectory(expected))
    measured = []
    for seed in range(6):
        rendering = render_frames(scene, 2, np.random.default_rng(seed))
        assert rendering.displacement_px == pytest.approx(SMALL.focal_px * velocity_m_s / 30.0 / distance_m)
        measured.append(phase_shift(rendering.frames[0], rendering.frames[1], expected))
    assert np.mean(measured) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("step_px", [5.0, -3.0, 0.25, -0.5])
def test_whole_pixels_of_motion_repeat_the_picture(wall: Wall, noiseless: LightLevel, step_px: float) -> None:
    frames = render_frames(Scene(wall, 0.2, noiseless, SMALL, Trajectory(step_px)), 5, np.random.default_rng(1)).frames
    shift = round(4 * step_px)
    first, last = frames[0].astype(int), frames[4].astype(int)
    overlap = (first[:, -shift:], last[:, :shift]) if shift < 0 else (first[:, :-shift], last[:, shift:])
    assert np.abs(overlap[0] - overlap[1]).max() <= 1  # rounding to 8 bits
    assert np.std(first) > 5.0


def test_a_long_run_is_seamless(wall: Wall, noiseless: LightLevel) -> None:
    frames = render_frames(Scene(wall, 0.2, noiseless, SMALL, Trajectory(37.0)), 24, np.random.default_rng(2)).frames
    for before, after in zip(frames[:-1].astype(int), frames[1:].astype(int), strict=True):
        assert np.abs(before[:, :-37] - after[:, 37:]).max() <= 1


def test_drift_moves_rows_and_leaves_columns(wall: Wall, noiseless: LightLevel) -> None:
    rendering = render_frames(
        Scene(wall, 0.2, noiseless, SMALL, Trajectory(4.0, drift_px=0.5)), 5, np.random.default_rng(3)
    )
    first, last = rendering.frames[0].astype(int), rendering.frames[4].astype(int)
    assert rendering.drift_px == pytest.approx(0.5)
    assert np.abs(first[:-2, :-16] - last[2:, 16:]).max() <= 1


def test_acceleration_keeps_the_mean_over_the_window(wall: Wall, noiseless: LightLevel) -> None:
    scene = Scene(wall, 0.2, noiseless, SMALL, Trajectory(6.0, acceleration_px=1.0))
    rendering = render_frames(scene, 5, np.random.default_rng(4))
    steps = np.diff(rendering.positions_px[:, 0])
    np.testing.assert_allclose(steps, [4.5, 5.5, 6.5, 7.5])
    assert rendering.displacement_px == pytest.approx(6.0)
    measured = [
        phase_shift(a, b, s) for a, b, s in zip(rendering.frames[:-1], rendering.frames[1:], steps, strict=True)
    ]
    np.testing.assert_allclose(measured, steps, atol=0.03)


def test_a_dropped_frame_doubles_one_step_and_a_duplicate_repeats_the_bytes(wall: Wall) -> None:
    dropped = render_frames(
        Scene(wall, camera=SMALL, trajectory=Trajectory(6.0, frame_times=dropped_frame(5, 1))),
        5,
        np.random.default_rng(5),
    )
    np.testing.assert_allclose(np.diff(dropped.positions_px[:, 0]), [6.0, 12.0, 6.0, 6.0])
    doubled = render_frames(
        Scene(wall, camera=SMALL, trajectory=Trajectory(6.0, jitter_px=1.0, frame_times=duplicated_frame(5, 1))),
        5,
        np.random.default_rng(5),
    )
    assert np.array_equal(doubled.frames[1], doubled.frames[2])
    assert not np.array_equal(doubled.frames[0], doubled.frames[1])
    assert doubled.positions_px[1, 0] == doubled.positions_px[2, 0]


def test_jitter_has_the_stated_deviation_and_is_true(wall: Wall, noiseless: LightLevel) -> None:
    scene = Scene(wall, 0.2, noiseless, SMALL, Trajectory(3.0, jitter_px=0.3))
    rendering = render_frames(scene, 80, np.random.default_rng(6))
    errors = rendering.positions_px[:, 0] - 3.0 * (np.arange(80) - 39.5)
    assert np.std(errors) == pytest.approx(0.3, rel=0.2)
    step = float(np.diff(rendering.positions_px[:2, 0])[0])
    assert phase_shift(rendering.frames[0], rendering.frames[1], step) == pytest.approx(step, abs=0.03)


def test_rolling_shutter_skews_moving_columns(sine_wall, noiseless: LightLevel) -> None:
    camera = CameraModel(width=320, height=128, readout_s=1.0 / 60.0)
    moving = render_frames(
        Scene(sine_wall(1 / 16), 0.3, noiseless, camera, Trajectory(6.0)), 1, np.random.default_rng(7)
    )
    rows = moving.frames[0].astype(float) - 110.0
    wave = np.exp(-2j * np.pi * np.arange(320) / 16.0) * np.hanning(320)
    phase = np.unwrap(np.angle(rows @ wave))
    skew_px = -np.polyfit(np.arange(128), phase, 1)[0] * 16.0 / (2 * np.pi)
    assert skew_px == pytest.approx(6.0 * 0.5 / 128, abs=1e-4)  # d * readout / T over the height


@pytest.mark.parametrize("yaw_deg", [5.0, -10.0])
def test_yaw_stretches_the_flow(smooth_wall: Wall, noiseless: LightLevel, yaw_deg: float) -> None:
    camera, yaw, step = CameraModel(width=480, height=128), math.radians(yaw_deg), 0.5
    scene = Scene(smooth_wall, 0.3, noiseless, camera, Trajectory(step, yaw_rad=yaw))
    rendering = render_frames(scene, 2, np.random.default_rng(8))
    first, second = rendering.frames.astype(float)
    slope = 0.5 * np.gradient(first + second, axis=1)
    change = second - first
    for centre in (-160, 0, 160):
        part = np.s_[:, 240 + centre - 40 : 240 + centre + 40]
        flow = -float((slope[part] * change[part]).sum() / (slope[part] ** 2).sum())
        expected = step * (math.cos(yaw) + centre / camera.focal_px * math.sin(yaw)) ** 2
        assert flow == pytest.approx(expected, rel=0.03)
    assert rendering.displacement_px == pytest.approx(step * math.cos(yaw) ** 2)


def test_roll_turns_the_picture_about_its_centre(smooth_wall: Wall, noiseless: LightLevel) -> None:
    scene = Scene(smooth_wall, 0.3, noiseless, SMALL)
    angle = 0.02

    def light(roll: float) -> NDArray[np.float64]:
        path = Path(scene.trajectory, np.zeros(1), np.zeros(1), np.array([roll]))
        return next(light_frames(scene, path, np.random.default_rng(9))).astype(float)

    level, rolled = light(0.0), light(angle)
    c, s = math.cos(angle), math.sin(angle)
    matrix, centre = np.array([[c, s], [-s, c]]), np.array([63.5, 159.5])
    expected = ndimage.affine_transform(level, matrix, offset=centre - matrix @ centre, order=3)
    inside = np.s_[12:-12, 12:-12]
    assert np.corrcoef(rolled[inside].ravel(), expected[inside].ravel())[0, 1] > 0.9995
    assert np.corrcoef(rolled[inside].ravel(), level[inside].ravel())[0, 1] < 0.999


def test_distortion_moves_pixels_by_its_polynomial(smooth_wall: Wall, noiseless: LightLevel) -> None:
    k1 = -0.1
    camera = CameraModel(width=320, height=128, k1=k1)
    plain, bent = (
        render_frames(Scene(smooth_wall, 0.3, noiseless, c), 1, np.random.default_rng(10)).frames[0].astype(float)
        for c in (SMALL, camera)
    )
    v, u = np.mgrid[20:108:4, 20:300:4].astype(float)
    x, y = (u - 159.5) / camera.focal_px, (v - 63.5) / camera.focal_px
    scale = 1.0 + k1 * (x**2 + y**2)
    seen = ndimage.map_coordinates(bent, [y * scale * camera.focal_px + 63.5, x * scale * camera.focal_px + 159.5])
    wanted = plain[20:108:4, 20:300:4]
    seen, wanted = seen - seen.mean(), wanted - wanted.mean()
    assert np.corrcoef(seen.ravel(), wanted.ravel())[0, 1] > 0.999
