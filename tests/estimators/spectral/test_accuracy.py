"""Composite and single exposure on rendered walls: errors, and whether the sigmas tell them."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.result import MotionEstimate
from axialnav.estimators.spectral import fit_composite, fit_single
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered

SPEEDS_PX = np.geomspace(0.7, 45.0, 14)
SLOW_PX = 1.5  # below, dim light does not tell five even frames from five with one missing


def test_composites_are_read_at_every_speed_and_their_sigmas_are_true() -> None:
    """Fourteen walls from 0.7 to 45 px per frame, both signs, every other in dim light; slow ones may be refused."""
    told: list[tuple[float, MotionEstimate]] = []
    for seed, speed in enumerate(SPEEDS_PX):
        picture = rendered(float(speed) * (-1) ** seed, 900 + seed, bright=seed % 2 == 0, contrast=0.1)
        told.append((float(speed), fit_composite(picture.frames, PERIOD_S)))
    good = [(speed, e) for speed, e in told if e.accepted]
    assert [speed for speed, _ in good if speed > SLOW_PX] == [speed for speed in SPEEDS_PX if speed > SLOW_PX]
    error = np.array([e.displacement_px - speed for speed, e in good])
    z = error / np.array([e.sigma_px for _, e in good])
    assert np.median(np.abs(error)) < 0.02
    assert np.max(np.abs(error) / [speed for speed, _ in good]) < 0.05
    assert 0.3 < np.sqrt(np.mean(z**2)) < 1.6
    assert not any(e.signed for _, e in told)


def test_slow_walls_are_read_though_the_first_dark_line_is_hardly_in_the_spectrum() -> None:
    """The frames' own spectrum tells the texture's fading from the comb: from 0.5 px per frame on, in bright light."""
    speeds = np.linspace(0.48, 0.7, 8)
    told = [fit_composite(rendered(s, 920, bright=True, contrast=0.1).frames, PERIOD_S) for s in speeds]
    assert all(e.accepted for e in told)
    error = np.array([e.displacement_px for e in told]) - speeds
    assert np.max(np.abs(error)) < 0.02
    assert 0.2 < np.sqrt(np.mean((error / [e.sigma_px for e in told]) ** 2)) < 1.6


@pytest.mark.parametrize("exposure_s", [0.001, 0.030])
@pytest.mark.parametrize("displacement_px", [2.3, 17.0])
def test_the_exposure_does_not_matter(displacement_px: float, exposure_s: float) -> None:
    camera = {"exposure_s": exposure_s}
    estimate = fit_composite(rendered(displacement_px, 930, bright=True, contrast=0.1, camera=camera).frames, PERIOD_S)
    assert estimate.displacement_px == pytest.approx(displacement_px, rel=0.005)


@pytest.mark.parametrize("frames", [2, 3, 8])
def test_any_number_of_frames_will_do(frames: int) -> None:
    picture = rendered(-7.7, 940, bright=True, contrast=0.1, frames=frames)
    estimate = fit_composite(picture.frames, PERIOD_S)
    assert estimate.displacement_px == pytest.approx(7.7, rel=0.02)
    assert estimate.window_s == pytest.approx((frames - 1) * PERIOD_S)


def test_one_exposure_tells_fast_motion_and_its_sigmas_are_true() -> None:
    z, right = [], 0
    for seed, speed in enumerate(np.linspace(16.0, 60.0, 12)):
        picture = rendered(float(speed), 960 + seed, bright=True, contrast=0.1, frames=1)
        estimate = fit_single(picture.frames, PERIOD_S, EXPOSURE_S)
        if estimate.accepted:
            right += estimate.displacement_px == pytest.approx(speed, rel=0.1)
            z.append((estimate.displacement_px - speed) / estimate.sigma_px)
    assert len(z) >= 9
    assert right == len(z)
    assert 0.3 < np.sqrt(np.mean(np.square(z))) < 1.7


def test_more_frames_make_the_blur_sharper() -> None:
    frames = rendered(30.0, 980, contrast=0.1, bright=True).frames
    one, five = fit_single(frames[2:3], PERIOD_S, EXPOSURE_S), fit_single(frames, PERIOD_S, EXPOSURE_S)
    assert five.displacement_px == pytest.approx(30.0, rel=0.05)
    assert five.sigma_px < one.sigma_px
