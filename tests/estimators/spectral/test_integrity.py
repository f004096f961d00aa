"""What a spectrum cannot tell is refused; nothing accepted is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.estimators.errors import FrameError
from axialnav.estimators.result import MotionReason
from axialnav.estimators.spectral import fit_composite, fit_single
from axialnav.estimators.spectral.copies import wall_copies
from axialnav.estimators.spectral.reading import read_comb
from axialnav.estimators.spectral.standing import columns_stand
from axialnav.replay.simulate.render import (
    BRIGHT,
    CameraModel,
    Scene,
    Trajectory,
    brick_wall,
    dropped_frame,
    render_frames,
)
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered, texture

FAST_PX = (3.4, 9.1, 17.0, 33.0)


@pytest.mark.parametrize("seed", range(4))
def test_noise_has_no_motion(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(100.0, 8.0, (5, 360, 640)).astype(np.uint8)
    assert not fit_composite(noise, PERIOD_S).accepted
    assert not fit_single(noise[:1], PERIOD_S, EXPOSURE_S).accepted


@pytest.mark.parametrize("seed", range(3))
def test_a_wall_that_stands_still_is_not_given_a_speed(seed: int) -> None:
    frames = rendered(0.0, 700 + seed, bright=True, contrast=0.1).frames
    assert not fit_composite(frames, PERIOD_S).accepted
    assert not fit_single(frames[:1], PERIOD_S, EXPOSURE_S).accepted


@pytest.mark.parametrize("gap", range(4))
@pytest.mark.parametrize("displacement_px", FAST_PX)
def test_a_dropped_frame_is_refused(displacement_px: float, gap: int) -> None:
    """Copies that are not evenly spaced leave another comb, and that explains the picture better."""
    times = dropped_frame(5, gap)
    picture = rendered(displacement_px, 720, bright=True, contrast=0.1, frame_times=times)
    assert not fit_composite(picture.frames, PERIOD_S).accepted


@pytest.mark.parametrize(("bright", "displacement_px"), [(True, 0.48), (True, 0.65), (False, 0.85), (False, 1.7)])
def test_a_dropped_frame_of_a_slow_wall_is_refused(bright: bool, displacement_px: float) -> None:
    """Half a ridge of the comb is in view: a frame is not known to be there unless its absence is ruled out."""
    for gap in range(4):
        picture = rendered(displacement_px, 730 + gap, bright=bright, contrast=0.05, frame_times=dropped_frame(5, gap))
        assert not fit_composite(picture.frames, PERIOD_S).accepted


def test_a_periodic_wall_is_refused_or_read_right() -> None:
    """One frame has a comb already; what is divided by it tells the displacement only where periods are not in step."""
    wall, refused = brick_wall(np.random.default_rng(77), tone=0.0, roughness=0.0), []
    camera = CameraModel(width=640, height=360, exposure_s=EXPOSURE_S, frame_period_s=PERIOD_S)
    for seed, displacement_px in enumerate((2.3, 5.1, 9.4, 14.7, 18.2, 21.0, 25.0, 33.0)):
        scene = Scene(wall, 0.1, BRIGHT, camera, Trajectory(displacement_px=displacement_px))
        estimate = fit_composite(render_frames(scene, 5, np.random.default_rng(seed)).frames, PERIOD_S)
        refused.append(estimate.reason == MotionReason.PERIODIC)
        assert not estimate.accepted or estimate.displacement_px == pytest.approx(displacement_px, rel=0.02)
    assert sum(refused) >= 2


@pytest.mark.parametrize("occluder", ["gear", "corner", "cable"])
def test_strips_with_something_fixed_to_the_camera_are_left_out(occluder: str) -> None:
    for seed, displacement_px in enumerate((1.4, 6.3, 22.0)):
        picture = rendered(displacement_px, 750 + seed, bright=True, contrast=0.1, occluders=(occluder,))
        estimate = fit_composite(picture.frames, PERIOD_S)
        assert estimate.accepted
        assert abs(estimate.displacement_px - displacement_px) < max(0.01 * displacement_px, 4.0 * estimate.sigma_px)


@pytest.mark.parametrize("displacement_px", [0.6, 0.9])
def test_columns_that_stand_before_a_slow_wall_are_seen(displacement_px: float) -> None:
    """Behind a bar over all strips a slow wall looks slower still, which only the columns tell."""

    def stands(occluders: tuple[str, ...]) -> bool:
        picture = rendered(displacement_px, 755, bright=True, contrast=0.1, occluders=occluders)
        copies, usable = wall_copies(list(picture.frames))
        assert copies is not None
        return columns_stand(copies, read_comb(copies, usable, 80.0).noise)

    assert stands(("bar",))
    assert not stands(())


@pytest.mark.parametrize("displacement_px", [0.6, 0.9, 2.0, 12.0])
def test_a_bar_over_all_strips_is_refused(displacement_px: float) -> None:
    picture = rendered(displacement_px, 755, bright=True, contrast=0.1, occluders=("bar",))
    assert not fit_composite(picture.frames, PERIOD_S).accepted


def test_a_slow_wall_behind_a_codec_is_refused() -> None:
    """Only the lower frequencies are left, and the first dark line is not among them."""
    picture = rendered(0.7, 757, bright=True, contrast=0.1, camera={"jpeg_quality": 80})
    assert not fit_composite(picture.frames, PERIOD_S).accepted


@pytest.mark.parametrize("displacement_px", FAST_PX)
def test_a_lens_out_of_focus_is_refused_or_does_no_harm(displacement_px: float) -> None:
    picture = rendered(displacement_px, 740, bright=True, contrast=0.1, camera={"lens_sigma_px": 4.0})
    composite = fit_composite(picture.frames, PERIOD_S)
    single = fit_single(picture.frames[:1], PERIOD_S, EXPOSURE_S)
    for estimate in (composite, single):
        assert not estimate.accepted or estimate.displacement_px == pytest.approx(displacement_px, rel=0.2)


def test_too_slow_for_the_exposure_is_said_by_name() -> None:
    picture = rendered(4.0, 760, bright=True, contrast=0.1, frames=1)
    estimate = fit_single(picture.frames, PERIOD_S, EXPOSURE_S)
    assert not estimate.accepted
    assert math.isnan(estimate.displacement_px)


def test_a_frame_delivered_twice_is_said_by_name() -> None:
    frames = rendered(9.0, 770).frames.copy()
    frames[3] = frames[2]
    assert fit_composite(frames, PERIOD_S).reason == MotionReason.DUPLICATED


@pytest.mark.parametrize("exposure_s", [None, 0.0])
def test_a_blur_without_an_exposure_says_nothing(exposure_s: float | None) -> None:
    frames = rendered(40.0, 780, frames=1).frames
    assert fit_single(frames, PERIOD_S, exposure_s).reason == MotionReason.NO_EXPOSURE


@pytest.mark.parametrize(
    ("period_s", "exposure_s", "words"),
    [(0.0, 0.01, "frame_period_s"), (math.nan, 0.01, "frame_period_s"), (0.03, -1.0, "exposure_s"), (0.03, 1.0, "exp")],
)
def test_times_that_cannot_be_are_named(period_s: float, exposure_s: float, words: str) -> None:
    stack = np.stack([texture(64, 96, k) for k in range(3)])
    with pytest.raises(FrameError, match=words):
        fit_single(stack, period_s, exposure_s)
    if not period_s > 0.0:
        with pytest.raises(FrameError, match=words):
            fit_composite(stack, period_s)


def test_frames_that_cannot_be_are_named() -> None:
    frame = texture(64, 96, 0)
    with pytest.raises(FrameError, match="2 to 64 frames, got 1"):
        fit_composite([frame], PERIOD_S)
    with pytest.raises(FrameError, match="one size"):
        fit_single([frame, frame[:40]], PERIOD_S, EXPOSURE_S)
    with pytest.raises(FrameError, match="uint8 or uint16"):
        fit_single([frame.astype(np.float64)], PERIOD_S, EXPOSURE_S)


def test_small_pictures_of_any_kind_never_crash() -> None:
    """Noise of every odd size, from the smallest that is allowed on."""
    rng = np.random.default_rng(9)
    for height, width in ((32, 32), (33, 47), (32, 200), (120, 32), (61, 97)):
        frames = rng.integers(0, 200, (4, height, width)).astype(np.uint16)
        assert not fit_composite(frames, PERIOD_S).accepted
        assert not fit_single(frames[:1], PERIOD_S, EXPOSURE_S).accepted
