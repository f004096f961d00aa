"""A camera that rolls: the upper part of the picture moves one way, the lower one the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.estimators.estimate import estimate_motion
from axialnav.estimators.layout import BANDS
from axialnav.estimators.roll import steady_roll
from axialnav.estimators.search import Profiles
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered

HEIGHT = np.array([-0.8, -0.4, 0.0, 0.4, 0.8])


def _peaks(place_px: list[float]) -> Profiles:
    """Bands whose likelihoods have their tops at these displacements."""
    grid = 0.25 * np.arange(-40, 41)
    gain = 2000.0 - 300.0 * np.abs(grid - np.array(place_px)[:, None]) ** 2
    return Profiles(grid, np.maximum(gain, 0.0).astype(np.float32), np.full(BANDS, 20.0))


def _found(place_px: list[float]) -> float:
    profiles = _peaks(place_px)
    return steady_roll(profiles, int(profiles.everyone.argmax()), HEIGHT)


def test_peaks_on_a_line_over_height_are_a_roll() -> None:
    assert _found([3.0 - 0.9 * h for h in HEIGHT]) == pytest.approx(-0.9, abs=0.02)


def test_peaks_that_agree_or_lie_off_every_line_are_none() -> None:
    assert _found([3.0] * BANDS) == 0.0
    assert _found([0.0, 3.0, 3.0, 3.0, 3.0]) == 0.0
    assert _found([0.0, 1.0, 3.0, 3.0, 3.0]) == 0.0


def test_a_sheared_profile_has_all_tops_in_one_place() -> None:
    slope = 1.25
    assert set(_peaks([2.0 + slope * h for h in HEIGHT]).sheared(slope * HEIGHT).gain.argmax(axis=1)) == {48}


@pytest.mark.parametrize("d", [-1.2, 6.0])
@pytest.mark.parametrize("rate_deg", [-0.35, 0.35])
def test_a_camera_that_rolls_steadily_is_no_quarrel_of_bands(d: float, rate_deg: float) -> None:
    """GIVEN a roll that moves the outer bands 2 px apart per frame THEN all five agree, and the error is small."""
    picture = rendered(d, 3, roll_rate_rad=math.radians(rate_deg))
    estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert estimate.accepted, estimate.reason
    assert estimate.bands == (BANDS, BANDS)
    assert estimate.displacement_px == pytest.approx(d, abs=max(0.03, 4.0 * estimate.sigma_px))
    assert estimate.sigma_px < 0.04


@pytest.mark.slow
def test_rows_that_take_part_lie_around_the_axis() -> None:
    """GIVEN rows that no blocks of bins fill WHEN the camera rolls steadily THEN no displacement comes of it."""
    errors = []
    for seed in range(4):
        picture = rendered(
            3.0, seed, bright=True, camera={"width": 1920, "height": 1080}, roll_rate_rad=math.radians(0.05)
        )
        estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
        errors.append(estimate.displacement_px - 3.0)
    assert abs(np.mean(errors)) < 0.002
