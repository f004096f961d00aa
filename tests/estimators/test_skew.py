"""Two exposures of a camera that changes its speed while they last."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from axialnav.estimators.estimate import MotionEstimate, estimate_motion
from axialnav.estimators.result import MotionReason
from axialnav.replay.simulate.render import (
    BRIGHT,
    CameraModel,
    Scene,
    Trajectory,
    Wall,
    photographic_wall,
    render_frames,
)

PERIOD_S = 1 / 30


@cache
def _wall(number: int) -> Wall:
    return photographic_wall(np.random.default_rng(number))


def _pairs(
    displacement_px: float, acceleration_px: float, exposure_s: float = PERIOD_S
) -> list[tuple[MotionEstimate, float]]:
    """Estimates and true displacements of two frames each; the exposure is not told."""
    camera = CameraModel(width=480, height=270, exposure_s=exposure_s, frame_period_s=PERIOD_S)
    motion = Trajectory(displacement_px=displacement_px, acceleration_px=acceleration_px)
    pairs = []
    for seed in range(8):
        rng = np.random.default_rng([seed, 5])
        seen = render_frames(Scene(_wall(seed % 2), 0.05, BRIGHT, camera, motion), 2, rng)
        pairs.append((estimate_motion(seen.frames, frame_period_s=PERIOD_S), seen.displacement_px))
    return pairs


@pytest.mark.parametrize(("displacement_px", "acceleration_px"), [(3.0, 6.0), (4.0, 6.0)])
def test_sigma_covers_what_skewed_streaks_do_to_a_pair(displacement_px: float, acceleration_px: float) -> None:
    """The wall comes from rest and leaves faster: one streak is brighter at its end, and fine texture follows it."""
    pairs = _pairs(displacement_px, acceleration_px)
    error = np.array([estimate.displacement_px - truth for estimate, truth in pairs if estimate.accepted])
    sigma = np.array([estimate.sigma_px for estimate, _ in pairs if estimate.accepted])
    assert len(error) >= 6
    assert np.sqrt(np.mean(error**2)) > 0.05
    assert 0.4 < np.sqrt(np.mean((error / sigma) ** 2)) < 1.6


def test_a_pair_whose_streaks_tell_different_displacements_is_refused() -> None:
    pairs = _pairs(10.0, 10.0)
    assert {estimate.reason for estimate, _ in pairs} == {MotionReason.SIGMA}


@pytest.mark.parametrize(("acceleration_px", "exposure_s"), [(0.0, PERIOD_S), (6.0, 0.1 * PERIOD_S)])
def test_even_or_short_exposures_keep_their_small_sigma(acceleration_px: float, exposure_s: float) -> None:
    pairs = _pairs(4.0, acceleration_px, exposure_s)
    z = [(estimate.displacement_px - truth) / estimate.sigma_px for estimate, truth in pairs]
    assert all(estimate.sigma_px < 0.03 for estimate, _ in pairs)
    assert np.sqrt(np.mean(np.square(z))) < 1.6
