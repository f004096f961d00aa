"""What reaches the pixels: exposure blur, lens, aliasing, lamps, noise and contrast, against their formulas."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.exposure import exposure_nodes, flicker_gain
from axialnav.replay.simulate.noise import expose
from axialnav.replay.simulate.optics import fixed_pattern, light_falloff
from axialnav.replay.simulate.render import (
    BRIGHT,
    DARK,
    DIM,
    CameraModel,
    Disturbance,
    LightLevel,
    Scene,
    Trajectory,
    Wall,
    render_frames,
)

SMALL = CameraModel(width=320, height=128)


@pytest.mark.parametrize(("displacement_px", "exposure_ratio"), [(20.0, 0.3), (-20.0, 0.3), (6.0, 0.9), (45.0, 0.3)])
def test_exposure_blur_is_a_sinc(
    wall: Wall, noiseless: LightLevel, displacement_px: float, exposure_ratio: float
) -> None:
    camera = CameraModel(width=640, height=128, exposure_s=exposure_ratio / 30.0)
    window = np.hanning(640)
    cross, power = 0.0, 0.0
    for seed in range(8):
        still, moving = (
            render_frames(Scene(wall, 0.25, noiseless, camera, Trajectory(d)), 1, np.random.default_rng(seed))
            for d in (0.0, displacement_px)
        )
        a, b = (np.fft.rfft((r.frames[0] - 110.0) * window, axis=1) for r in (still, moving))
        cross, power = cross + (b * a.conj()).sum(axis=0), power + (np.abs(a) ** 2).sum(axis=0)
    frequency = np.arange(321) / 640
    expected = np.sinc(frequency * displacement_px * exposure_ratio)
    kept = slice(8, 200)  # up to 0.31 cycles/px, where the texture stands out of the rounding
    np.testing.assert_allclose((cross / power).real[kept], expected[kept], atol=0.04)
    assert np.abs((cross / power).real - expected)[kept].mean() < 0.01
    assert moving.blur_px == pytest.approx(abs(displacement_px) * exposure_ratio)


def test_exposure_nodes_integrate_short_and_long_blurs_exactly() -> None:
    for blur_px in (0.2, 3.0, 13.5, 80.0):
        nodes, weights = exposure_nodes(1.0, blur_px)
        for cycles in np.linspace(0.0, blur_px, 50):  # up to one cycle per pixel, the finest a wall holds
            assert (weights * np.cos(2 * np.pi * cycles * nodes)).sum() == pytest.approx(np.sinc(cycles), abs=1e-8)


@pytest.mark.parametrize("contrast", [0.2, 0.05])
def test_contrast_is_rms_over_mean(sine_wall, noiseless: LightLevel, contrast: float) -> None:
    frames = render_frames(Scene(sine_wall(1 / 80), contrast, noiseless, SMALL), 1, np.random.default_rng(1)).frames
    assert frames.mean() == pytest.approx(110.0, rel=0.01)
    assert frames.std() / frames.mean() == pytest.approx(contrast, rel=0.02)


def test_lens_and_pixel_pass_a_wave_as_their_transfer_says(sine_wall, noiseless: LightLevel) -> None:
    for frequency in (0.11, 0.26, 0.39):  # fractions that do not repeat within a few pixels
        scene = Scene(sine_wall(frequency), 0.3, noiseless, SMALL)
        wave = render_frames(scene, 1, np.random.default_rng(2)).frames.std() / 110.0
        transfer = np.exp(-2 * (np.pi * 0.6 * frequency) ** 2) * np.sinc(frequency)
        assert wave == pytest.approx(0.3 * transfer, rel=0.02)


def test_waves_finer_than_a_pixel_are_aliased_not_lost(sine_wall, noiseless: LightLevel) -> None:
    sharp = CameraModel(width=320, height=128, lens_sigma_px=0.2)
    frame = render_frames(Scene(sine_wall(0.75), 0.5, noiseless, sharp), 1, np.random.default_rng(3)).frames[0]
    spectrum = np.abs(np.fft.rfft(frame.astype(float).mean(axis=0) - frame.mean()))
    assert np.argmax(spectrum) == 80  # 0.75 cycles/px folds to 0.25
    transfer = np.exp(-2 * (np.pi * 0.2 * 0.75) ** 2) * np.sinc(0.75)
    assert frame.std() / 110.0 == pytest.approx(0.5 * transfer, rel=0.03)


@pytest.mark.parametrize(("light", "sigma_dn"), [(BRIGHT, 2.35), (DIM, 4.25), (DARK, 6.63)])
def test_noise_has_the_stated_statistics(wall: Wall, light: LightLevel, sigma_dn: float) -> None:
    frames = render_frames(Scene(wall, 0.0, light, SMALL), 12, np.random.default_rng(4)).frames.astype(float)
    sigma = np.sqrt(light.sigma_dn() ** 2 + 1 / 12)  # rounding adds its twelfth
    assert light.sigma_dn() == pytest.approx(sigma_dn, abs=0.01)
    assert frames.mean() == pytest.approx(light.mean_dn, abs=0.05)
    assert frames.std() == pytest.approx(sigma, rel=0.01)
    deviation = (frames - frames.mean()) / frames.std()
    assert np.mean(deviation**4) == pytest.approx(3.0, abs=0.06)
    assert abs(np.mean(deviation[:, :, 1:] * deviation[:, :, :-1])) < 0.01
    assert abs(np.mean(deviation[:, 1:] * deviation[:, :-1])) < 0.01
    assert abs(np.mean(deviation[1:] * deviation[:-1])) < 0.01


def test_shot_noise_grows_with_the_light_and_stops_at_the_ends_of_the_scale() -> None:
    rng = np.random.default_rng(5)
    for relative in (0.25, 1.0, 1.8):
        flat = np.full((400, 400), relative, dtype=np.float32)
        expected = np.hypot(BRIGHT.sigma_dn(110.0 * relative), np.sqrt(1 / 12))
        assert expose(flat, BRIGHT, rng).std() == pytest.approx(expected, rel=0.01)
    assert (expose(np.full((64, 64), 9.0, dtype=np.float32), BRIGHT, rng) == 255).all()
    assert expose(np.full((64, 64), -1.0, dtype=np.float32), BRIGHT, rng).max() <= 1


@pytest.mark.parametrize(("read_noise_e", "sigma_dn"), [(0.0, 1000**0.5 / 10), (50.0, 3500**0.5 / 10)])
def test_shot_and_read_noise_add_in_electrons(read_noise_e: float, sigma_dn: float) -> None:
    """1000 electrons at 10 per grey value; the rounding to 8 bits adds a twelfth."""
    light = np.ones((300, 400), dtype=np.float32)
    picture = expose(light, LightLevel(100.0, 10.0, read_noise_e), np.random.default_rng(11))
    assert picture.std() == pytest.approx((sigma_dn**2 + 1.0 / 12.0) ** 0.5, rel=0.01)
    assert picture.mean() == pytest.approx(100.0, abs=0.1)


def test_gamma_bends_grey_values_between_black_and_white(noiseless: LightLevel) -> None:
    light = np.linspace(0.05, 2.2, 64 * 64, dtype=np.float32).reshape(64, 64)
    picture = expose(light, noiseless, np.random.default_rng(12), 2.2).astype(float)
    np.testing.assert_allclose(picture, 255.0 * (light * 110.0 / 255.0) ** (1.0 / 2.2), atol=0.51)


def test_equal_seeds_give_equal_bytes(wall: Wall) -> None:
    camera = CameraModel(width=320, height=128, pixel_pattern=0.01, jpeg_quality=80, gamma=2.2)
    disturbance = Disturbance(0.2, 100.0, 0.05, 0.5, ("gear", "cable"))
    scene = Scene(wall, 0.1, DIM, camera, Trajectory(5.0, 0.3, 0.5, 0.1, 0.002, 0.05), disturbance)
    first, again, other = (render_frames(scene, 3, np.random.default_rng(s)).frames for s in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_lamp_flickers_unless_the_exposure_is_its_period() -> None:
    time = np.linspace(0.0, 3.0, 1000)
    assert np.ptp(flicker_gain(time, 0.2, 100 / 30, 0.4, 0.3)) == pytest.approx(0.0, abs=1e-12)
    short = flicker_gain(time, 0.2, 100 / 30, 0.4, 0.15)
    assert np.ptp(short) == pytest.approx(2 * 0.2 * np.sinc(0.5), rel=1e-3)
    brute = [
        1 + 0.2 * np.sin(2 * np.pi * 100 / 30 * np.linspace(t - 0.075, t + 0.075, 4001) + 0.4).mean() for t in time[:9]
    ]
    np.testing.assert_allclose(short[:9], brute, atol=1e-4)


def test_flicker_and_gain_change_whole_frames_and_rows(wall: Wall, noiseless: LightLevel) -> None:
    camera = CameraModel(width=320, height=128, exposure_s=0.002)
    scene = Scene(wall, 0.0, noiseless, camera, disturbance=Disturbance(flicker_depth=0.2))
    means = render_frames(scene, 12, np.random.default_rng(6)).frames.mean(axis=(1, 2)) / 110.0
    assert 0.2 < np.ptp(means) < 0.4
    rolling = CameraModel(width=320, height=128, exposure_s=0.002, readout_s=0.02)
    banded = render_frames(
        Scene(wall, 0.0, noiseless, rolling, disturbance=Disturbance(flicker_depth=0.2)), 1, np.random.default_rng(6)
    )
    rows = banded.frames[0].mean(axis=1) / 110.0
    assert np.ptp(rows) == pytest.approx(2 * 0.2 * np.sinc(0.2), rel=0.03)


def test_fixed_pattern_and_vignette_stay_with_the_camera(wall: Wall, noiseless: LightLevel) -> None:
    pattern = fixed_pattern(500, 400, 0.01, 0.02, np.random.default_rng(7))
    assert pattern.mean(axis=0).std() == pytest.approx(0.02, rel=0.1)
    assert (pattern - pattern.mean(axis=0)).std() == pytest.approx(0.01, rel=0.02)
    falloff = light_falloff(128, 320, 0.4, 0.0)
    assert falloff.mean() == pytest.approx(1.0, rel=1e-5)
    assert falloff[0, 0] / falloff[64, 160] == pytest.approx(0.6, abs=0.01)
    spot = light_falloff(129, 321, 0.0, 1.5)
    assert spot[64, 160] / spot[0, 0] == pytest.approx(2.5 / (1.0 + 1.5 * np.exp(-4.0)), rel=0.02)
    camera = CameraModel(width=320, height=128, pixel_pattern=0.01, vignette=0.3)
    frames = render_frames(Scene(wall, 0.0, noiseless, camera, Trajectory(9.0)), 2, np.random.default_rng(8)).frames
    assert (frames[0] != frames[1]).mean() < 0.001  # a value on the edge of two grey levels may round either way
    assert frames[0].std() > 5.0


@pytest.mark.parametrize("name", ["gear", "corner", "cable", "bar"])
def test_occluders_do_not_move(wall: Wall, noiseless: LightLevel, name: str) -> None:
    scene = Scene(wall, 0.2, noiseless, SMALL, Trajectory(11.0), Disturbance(occluders=(name,)))
    plain = Scene(wall, 0.2, noiseless, SMALL, Trajectory(11.0))
    first, last = render_frames(scene, 2, np.random.default_rng(9)).frames.astype(int)
    covered = (np.abs(first - last) <= 1) & (first < 90)
    assert 0.002 < covered.mean() < 0.3
    bare = render_frames(plain, 2, np.random.default_rng(9)).frames.astype(int)
    assert (np.abs(bare[0] - bare[1])[covered] > 1).mean() > 0.5


def test_jpeg_leaves_its_block_grid(wall: Wall) -> None:
    camera = CameraModel(width=320, height=128, jpeg_quality=40)
    frame = render_frames(Scene(wall, 0.05, DIM, camera), 1, np.random.default_rng(10)).frames[0].astype(float)
    raw = render_frames(Scene(wall, 0.05, DIM, SMALL), 1, np.random.default_rng(10)).frames[0]
    coded = cv2.imencode(".jpg", raw, [cv2.IMWRITE_JPEG_QUALITY, 40])[1]
    np.testing.assert_array_equal(frame, cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))
    steps = np.abs(np.diff(frame, axis=1)).mean(axis=0)
    assert steps[7::8].mean() > 1.15 * np.delete(steps, np.s_[7::8]).mean()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda wall: CameraModel(width=321), "even width"),
        (lambda wall: CameraModel(exposure_s=0.05), "exposure_s"),
        (lambda wall: CameraModel(readout_s=0.05), "readout_s"),
        (lambda wall: LightLevel(-1.0, 4.0), "BRIGHT, DIM or DARK"),
        (lambda wall: Scene(wall, contrast=1.5), "contrast"),
        (lambda wall: Trajectory(yaw_rad=1.0), "yaw_rad"),
        (lambda wall: Trajectory(float("nan")), "finite"),
        (lambda wall: render_frames(Scene(wall), 0, np.random.default_rng(0)), "0 frames"),
        (
            lambda wall: render_frames(
                Scene(wall, disturbance=Disturbance(occluders=("ufo",))), 1, np.random.default_rng(0)
            ),
            "ufo",
        ),
        (
            lambda wall: render_frames(Scene(wall, camera=CameraModel(k1=-0.05)), 1, np.random.default_rng(0)),
            "folds the picture",
        ),
    ],
)
def test_nonsense_is_refused_with_one_sentence(wall: Wall, make, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        make(wall)
