"""Walls keep their variance, wrap without a seam and have the spectra they are named after."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate import textures
from axialnav.replay.simulate.walls import PATCH_PX, brick_wall, fractal_wall, photographic_wall


def test_every_photograph_is_shipped_with_its_licence_and_is_small() -> None:
    notice = (textures.FOLDER / "LICENSES.md").read_text()
    files = sorted(textures.FOLDER.glob("*.jpg"))
    assert tuple(f.stem for f in files) == textures.NAMES
    assert all(f.name in notice for f in files)
    assert sum(f.stat().st_size for f in files) < 3_000_000
    for name in textures.NAMES:
        texture = textures.load_texture(name)
        assert texture.mean() == pytest.approx(0.0, abs=1e-3)
        assert texture.std() == pytest.approx(1.0, rel=1e-3)


def test_an_unknown_photograph_is_named() -> None:
    with pytest.raises(ConfigError, match="marble"):
        textures.load_texture("marble")


def test_blending_keeps_the_variance_between_the_patches() -> None:
    stacks = [
        photographic_wall(np.random.default_rng(s), rows_px=384, cols_px=768, stain=0.0).image.reshape(4, 96, 8, 192)
        for s in range(6)
    ]
    power = np.mean(np.array(stacks) ** 2, axis=(0, 1, 3))  # by place within half a patch
    assert power.shape == (PATCH_PX // 2, PATCH_PX)
    profile = power.mean(axis=0)
    assert profile.max() / profile.min() < 1.35
    assert power.mean() == pytest.approx(1.0, rel=0.15)


def test_walls_wrap_without_a_seam() -> None:
    image = photographic_wall(np.random.default_rng(1), rows_px=384, cols_px=768).image
    for axis in (0, 1):
        inner = np.abs(np.diff(image, axis=axis)).mean()
        seam = np.abs(np.take(image, 0, axis=axis) - np.take(image, -1, axis=axis)).mean()
        assert seam < 1.3 * inner


def test_crop_runs_over_the_edges() -> None:
    wall = photographic_wall(np.random.default_rng(2), rows_px=192, cols_px=384)
    rows, cols = wall.image.shape
    tiled = np.tile(wall.image, (3, 5))
    for row, col in ((0, 0), (rows - 7, cols // 2 - 9), (-5, -11), (3 * rows + 4, 7 * cols)):
        r, c = row % rows, (2 * col) % cols
        np.testing.assert_array_equal(wall.crop(row, 40, col, 600), tiled[r : r + 40, c : c + 1200])


@pytest.mark.parametrize("exponent", [2.0, 2.5])
def test_a_fractal_wall_falls_as_its_exponent(exponent: float) -> None:
    image = fractal_wall(np.random.default_rng(3), exponent, rows_px=512, cols_px=512).image
    power = np.abs(np.fft.rfft2(image)) ** 2
    fx, fy = np.fft.rfftfreq(1024, 0.5)[None, :], np.fft.fftfreq(512)[:, None]
    radius = np.hypot(fx, fy).ravel()
    inside = (radius > 0.02) & (radius < 0.4)
    slope = np.polyfit(np.log(radius[inside]), np.log(power.ravel()[inside]), 1)[0]
    assert slope == pytest.approx(-exponent, abs=0.05)
    assert image.std() == pytest.approx(1.0, rel=1e-3)


def test_a_brick_wall_without_tones_repeats_and_with_tones_does_not() -> None:
    for tone, repeats in ((0.0, True), (0.5, False)):
        wall = brick_wall(np.random.default_rng(4), tone=tone, roughness=0.0, rows_px=88, cols_px=660)
        same = np.array_equal(wall.crop(0, 88, 0, 132), wall.crop(0, 88, 66, 132))
        assert same is repeats
    joints = brick_wall(np.random.default_rng(4), tone=0.0, roughness=0.0, rows_px=88, cols_px=660).image
    assert joints.mean() == pytest.approx((1 - 3 / 22) * (1 - 3 / 66), rel=1e-6)
