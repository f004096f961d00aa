"""The published methods read what their papers read, fail where they are known to fail, and never answer nonsense."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.estimators.baselines.cepstrum import cepstrum_length
from axialnav.estimators.baselines.composite_mean import composite_mean
from axialnav.estimators.baselines.darkline import darkline_length
from axialnav.estimators.baselines.dct import dct_length
from axialnav.estimators.baselines.dips import null_ladder, prominent_dips
from axialnav.estimators.baselines.reading import BlurReading
from axialnav.estimators.baselines.stripes import binarised_spectrum, dark_lines, ladder, stripes_length
from axialnav.replay.simulate.render import (
    BRIGHT,
    DIM,
    CameraModel,
    Scene,
    Trajectory,
    Wall,
    photographic_wall,
    render_frames,
)
from axialnav.replay.simulate.textures import NAMES, load_texture

Method = Callable[..., BlurReading]
METHODS: list[Method] = [stripes_length, darkline_length, dct_length, cepstrum_length]


def hand_blurred(name: str, length_px: int) -> NDArray[np.float32]:
    """A noise-free photograph under a box of whole pixels, as in the paper's Fig. 5."""
    box = np.full((1, length_px), 1.0 / length_px, dtype=np.float32)
    return cv2.filter2D(load_texture(name), -1, box)[100:640, 20:980]


@pytest.fixture(scope="module")
def wall() -> Wall:
    return photographic_wall(np.random.default_rng(1), rows_px=768, cols_px=2304)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.__name__)
def test_63_px_of_noise_free_blur_are_read_within_one(method: Method, name: str) -> None:
    reading = method(hand_blurred(name, 63))
    assert reading.found
    assert reading.length_px == pytest.approx(63.0, abs=1.0)


@pytest.mark.parametrize("length_px", [9, 17, 31])
@pytest.mark.parametrize("method", METHODS[1:], ids=lambda m: m.__name__)
def test_null_methods_read_shorter_noise_free_blurs(method: Method, length_px: int) -> None:
    assert method(hand_blurred("concrete", length_px)).length_px == pytest.approx(length_px, rel=0.02)


def test_stripes_read_the_wrong_length_or_nothing_from_realistic_single_frames(wall: Wall) -> None:
    for displacement in (12.0, 31.0):
        scene = Scene(wall, 0.1, BRIGHT, trajectory=Trajectory(displacement))
        readings = [stripes_length(render_frames(scene, 1, np.random.default_rng(s)).frames[0]) for s in range(4)]
        truth = 0.3 * displacement
        assert all(not r.found or abs(r.length_px - truth) > 0.2 * truth for r in readings)


@pytest.mark.parametrize("method", [darkline_length, dct_length, cepstrum_length], ids=lambda m: m.__name__)
def test_null_methods_read_a_long_blur_of_a_good_wall(method: Method, wall: Wall) -> None:
    scene = Scene(wall, 0.1, BRIGHT, trajectory=Trajectory(45.0))
    readings = [method(render_frames(scene, 1, np.random.default_rng(s)).frames[0]) for s in range(5)]
    assert all(r.found for r in readings)
    assert np.median([r.length_px for r in readings]) == pytest.approx(13.5, rel=0.05)


@pytest.mark.parametrize("method", [darkline_length, dct_length], ids=lambda m: m.__name__)
def test_null_methods_cannot_read_a_short_blur(method: Method, wall: Wall) -> None:
    scene = Scene(wall, 0.05, DIM, trajectory=Trajectory(5.0))
    readings = [method(render_frames(scene, 1, np.random.default_rng(s)).frames[0]) for s in range(4)]
    assert all(not r.found or abs(r.length_px - 1.5) > 0.3 for r in readings)


def test_the_cepstrum_of_a_short_blur_is_the_textures_own(wall: Wall) -> None:
    scene = Scene(wall, 0.1, BRIGHT, trajectory=Trajectory(6.7))
    readings = [cepstrum_length(render_frames(scene, 1, np.random.default_rng(s)).frames[0]) for s in range(4)]
    assert all(not r.found or abs(r.length_px - 2.0) > 0.4 for r in readings)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.__name__)
def test_no_published_method_reads_a_long_composite(method: Method, wall: Wall) -> None:
    """Five frames of 31 px look blurred over 155 px: the nulls are too near the texture's own low frequencies."""
    scene = Scene(wall, 0.1, BRIGHT, trajectory=Trajectory(31.0))
    composites = [composite_mean(render_frames(scene, 5, np.random.default_rng(s)).frames) for s in range(2)]
    readings = [method(composite) for composite in composites]
    assert all(not r.found or abs(r.length_px - 155.0) > 31.0 for r in readings)


def test_a_composite_knows_no_direction_and_keeps_what_stands_still(wall: Wall) -> None:
    scene = Scene(wall, 0.0, BRIGHT, CameraModel(pixel_pattern=0.02), Trajectory(6.7))
    frames = render_frames(scene, 20, np.random.default_rng(6)).frames
    np.testing.assert_array_equal(composite_mean(frames), composite_mean(frames[::-1]))
    noise, mean = float(np.std(frames[0].astype(float) - frames[1])) / 2.0**0.5, composite_mean(frames)
    assert noise / 20**0.5 < 0.3 * float(np.std(mean))


def test_a_composite_has_the_blur_of_the_whole_window(wall: Wall) -> None:
    scene = Scene(wall, 0.1, BRIGHT, trajectory=Trajectory(6.7))
    frames = render_frames(scene, 5, np.random.default_rng(2)).frames
    assert dct_length(composite_mean(frames)).length_px == pytest.approx(5 * 6.7, rel=0.02)


def test_composite_is_the_mean_and_keeps_fractions() -> None:
    frames = np.random.default_rng(3).integers(0, 255, (5, 40, 50), dtype=np.uint8)
    np.testing.assert_allclose(composite_mean(frames), frames.mean(axis=0), rtol=1e-6)
    with pytest.raises(ValueError, match="one shape"):
        composite_mean([frames[0], frames[1, :-1]])
    with pytest.raises(ValueError, match="one shape"):
        composite_mean([])


def test_ladder_finds_the_spacing_in_spite_of_stray_lines() -> None:
    lines = np.sort(np.concatenate([480 + 15.24 * np.arange(1, 12), 480 - 15.24 * np.arange(1, 12), [300.0, 707.0]]))
    spacing, even = ladder(np.round(lines), 480)
    assert spacing == pytest.approx(15.24, abs=0.05)
    assert even > 0.85


def test_dark_lines_of_a_drawn_spectrum() -> None:
    binary = np.full((300, 400), 255, dtype=np.uint8)
    for k in range(-4, 5):
        binary[:, 200 + 40 * k - 2 : 200 + 40 * k + 3] = 0
    expected = np.array([200 + 40 * k for k in range(-4, 5) if k])
    np.testing.assert_allclose(dark_lines(binary), expected, atol=1.0)


def test_cross_is_masked() -> None:
    binary = binarised_spectrum(hand_blurred("rock", 31))
    assert not binary[270].any()
    assert not binary[:, 480].any()
    assert 0.05 < (binary > 0).mean() < 0.95


def test_nulls_of_an_ideal_sinc_and_of_noise_alone() -> None:
    bins = np.arange(481)
    rng = np.random.default_rng(4)
    noise = rng.standard_gamma(270, 481) / 270
    profile = np.log((np.sinc(bins * 9.3 / 960) ** 2 * 100.0 / (1 + bins) + 0.002) * noise)
    assert 960 / null_ladder(profile, 12) == pytest.approx(9.3, rel=0.02)
    assert null_ladder(np.log(noise), 12) is None
    assert prominent_dips(np.linspace(1.0, 0.0, 481), 12).size == 0


BAD = {
    "black": np.zeros((100, 120), dtype=np.uint8),
    "saturated": np.full((100, 120), 255, dtype=np.uint8),
    "colour": np.zeros((100, 120, 3), dtype=np.uint8),
    "tiny": np.arange(100, dtype=np.uint8).reshape(10, 10),
    "nan": np.full((100, 120), np.nan),
    "empty": np.zeros((0, 0)),
    "text": np.full((100, 120), "x"),
    "noise": np.random.default_rng(5).normal(100.0, 4.0, (270, 480)).astype(np.uint8),
}


@pytest.mark.parametrize("name", list(BAD))
@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.__name__)
def test_bad_pictures_give_a_reason_and_no_number(method: Method, name: str) -> None:
    reading = method(BAD[name])
    assert not reading.found
    assert np.isnan(reading.length_px)
    assert len(reading.reason) > 10


def test_a_reading_cannot_contradict_itself() -> None:
    with pytest.raises(ValueError, match="finite"):
        BlurReading(float("nan"), True)
    with pytest.raises(ValueError, match="finite"):
        BlurReading(5.0, False, "none")
