"""A camera at an angle to the wall: one side of the picture moves faster, and the sigma knows."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.estimate import estimate_motion
from axialnav.estimators.spectrum import Band
from axialnav.estimators.stretch import Stretch, apply_half_windows, half_windows, outer_frames
from axialnav.estimators.window import FrameWindow
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered


def slanting(seed: int, yaw_deg: float) -> tuple[float, float]:
    """Error and sigma [px] of one window past a wall that is seen at an angle."""
    picture = rendered(8.0, seed, bright=True, contrast=0.1, yaw_rad=np.deg2rad(yaw_deg))
    estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert estimate.accepted
    return estimate.displacement_px - picture.displacement_px, estimate.sigma_px


def test_errors_past_a_slanting_wall_are_as_large_as_sigma_says() -> None:
    """GIVEN yaws of 4 degrees WHEN measured THEN errors are several times those of a square wall, and so is sigma."""
    trials = np.array([slanting(seed, 4.0 * (-1) ** seed) for seed in range(16)])
    square = np.array([slanting(seed, 0.0) for seed in range(4)])
    z = float(np.sqrt(np.mean((trials[:, 0] / trials[:, 1]) ** 2)))
    assert 0.3 < z < 1.7  # sigma is a guess about texture that is not known: no chi-square band
    assert np.median(trials[:, 1]) > 5.0 * np.median(square[:, 1])


def test_halves_are_the_windows_taken_apart() -> None:
    """The squares of both halves add up to the window's, so that their powers add up to that of the whole."""
    rng, spans = np.random.default_rng(3), np.array([[0, 2], [5, 8]])
    rows, windows = rng.normal(size=(9, 50)).astype(np.float32), rng.uniform(size=(2, 40)).astype(np.float32)
    halves, out = half_windows(40), np.full((10, 48), 7.0, dtype=np.float32)
    np.testing.assert_allclose(np.sum(halves**2, axis=0), 1.0, rtol=1e-6)
    apply_half_windows(rows, spans, 4, windows, halves, out)
    whole = rows[[0, 1, 5, 6, 7], 4:44] * windows[[0, 0, 1, 1, 1]]
    np.testing.assert_allclose(out[:5, :40], whole * halves[0], rtol=1e-6)
    np.testing.assert_allclose(out[5:, :40], whole * halves[1], rtol=1e-6)
    assert not out[:, 40:].any()


@pytest.mark.parametrize(("frames", "outer"), [(2, [0, 1]), (3, [0, 1, 2]), (5, [0, 2, 4]), (6, [0, 2, 5])])
def test_the_halves_are_asked_about_few_frames(frames: int, outer: list[int]) -> None:
    picture = rendered(6.0, 4, frames=frames)
    window = FrameWindow(*picture.frames[0].shape, frames, picture.frames.dtype)
    for frame in picture.frames:
        window.push(frame)
    products = window.following(6.0)
    re, im, offset = window.halves(products.band)
    assert outer_frames(frames).tolist() == outer
    np.testing.assert_array_equal(offset, products.offset_px[outer])
    assert re.shape == im.shape == (2, 1, len(outer) * (len(outer) - 1) // 2, Band(products.band.length).count)


def test_an_answer_is_kept_for_as_many_windows_as_share_frames() -> None:
    stretch = Stretch()
    assert stretch.stale()
    stretch.renew(0.25, 4)
    assert [stretch.stale() for _ in range(4)] == [False, False, False, True]
    assert stretch.variance == 0.25
    stretch.renew(0.0, 4)
    stretch.forget()
    assert stretch.stale()
