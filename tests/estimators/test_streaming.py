"""The estimator that flies: frame by frame, with gaps, clocks and cameras as they are."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from axialnav.estimators.estimate import FrameError, MotionEstimator, MotionReason, estimate_motion
from axialnav.models.rig import Camera
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered

PERIOD_NS = round(PERIOD_S * 1e9)
CAMERA = Camera(resolution=(640, 360), intrinsics=(300.0, 300.0, 320.0, 180.0), rate_hz=30.0)


def test_streaming_gives_the_batch_estimate_at_the_middle_of_every_window() -> None:
    frames = rendered(6.0, 1, frames=7).frames
    estimator = MotionEstimator(CAMERA, frames=5)
    answers = [estimator.push(k * PERIOD_NS, frame, EXPOSURE_S) for k, frame in enumerate(frames)]
    assert answers[:4] == [None] * 4
    for k in (4, 5, 6):
        answer = answers[k]
        assert answer is not None
        batch = estimate_motion(frames[k - 4 : k + 1], frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
        least = 1e-6 if k == 4 else 0.5 * batch.sigma_px  # later windows are cut once, a little shorter
        assert answer.displacement_px == pytest.approx(batch.displacement_px, abs=least)
        assert answer.t_ns == (k - 2) * PERIOD_NS
        assert answer.window_s == pytest.approx(4 * PERIOD_S, rel=1e-6)


def test_a_gap_empties_the_ring_and_the_next_estimate_says_so() -> None:
    frames = rendered(6.0, 2, frames=6).frames
    estimator = MotionEstimator(CAMERA, frames=3)
    stamps = [k * PERIOD_NS + (3 * PERIOD_NS if k >= 3 else 0) for k in range(6)]
    answers = [estimator.push(t, frame) for t, frame in zip(stamps, frames, strict=True)]
    assert [answer is None for answer in answers] == [True, True, False, True, True, False]
    assert answers[2] is not None
    assert answers[2].note == ""
    assert answers[5] is not None
    assert "gap of 133" in answers[5].note


@pytest.mark.parametrize("camera", [CAMERA, None], ids=["rate known", "rate unknown"])
def test_a_camera_that_slows_down_in_the_dark_is_followed(camera: Camera | None) -> None:
    """GIVEN 30 frames per second WHEN the exposure halves the rate THEN gaps are told, then motion again."""
    frames = rendered(3.0, 8, frames=40).frames
    estimator = MotionEstimator(camera, frames=2)
    stamps = [k * PERIOD_NS for k in range(10)] + [(9 + 2 * k) * PERIOD_NS for k in range(1, 16)]
    answers = [estimator.push(t, frames[t // PERIOD_NS]) for t in stamps]
    assert all(answer is not None for answer in answers[1:10])
    assert answers[10] is None
    followed = [answer for answer in answers[11:] if answer is not None]
    assert len(followed) >= 2
    assert "gap of 66.7 ms" in followed[0].note
    assert [answer.note for answer in followed[1:]] == [""] * (len(followed) - 1)
    assert followed[-1].displacement_px == pytest.approx(6.0, abs=0.1)


def test_one_short_step_does_not_make_every_other_a_gap() -> None:
    frames = rendered(3.0, 9, frames=12).frames
    estimator = MotionEstimator(frames=2)
    stamps = [k * PERIOD_NS - (PERIOD_NS // 2 if k == 3 else 0) for k in range(12)]
    answers = [estimator.push(t, frame) for t, frame in zip(stamps, frames, strict=True)]
    assert all(answer is not None for answer in answers[-6:])


@pytest.mark.parametrize("stamp", [0, -5, 10])
def test_stamps_that_do_not_advance_are_an_error(stamp: int) -> None:
    frames = rendered(6.0, 3, frames=2).frames
    estimator = MotionEstimator(CAMERA, frames=2)
    estimator.push(10, frames[0])
    with pytest.raises(FrameError, match="does not come after"):
        estimator.push(stamp, frames[1])


def test_another_picture_size_or_a_bad_exposure_is_an_error() -> None:
    frames = rendered(6.0, 4, frames=2).frames
    estimator = MotionEstimator(frames=2)
    estimator.push(0, frames[0])
    with pytest.raises(FrameError, match="make a new estimator"):
        estimator.push(PERIOD_NS, frames[1][:200])
    with pytest.raises(FrameError, match="exposure_s"):
        estimator.push(PERIOD_NS, frames[1], -0.001)
    with pytest.raises(FrameError, match="integer"):
        estimator.push(1.5, frames[1])  # type: ignore[arg-type]


@pytest.mark.parametrize("options", [{"frames": 1}, {"method": "blur"}, {"axis": "z"}, {"roi": (0, 0, 8, 100)}])
def test_impossible_estimators_are_refused_at_once(options: dict[str, object]) -> None:
    with pytest.raises(FrameError):
        MotionEstimator(CAMERA, **options)  # type: ignore[arg-type]


def test_a_frame_delivered_twice_spoils_only_the_windows_that_hold_it() -> None:
    frames = rendered(6.0, 5, frames=7).frames.copy()
    frames[2] = frames[1]
    estimator = MotionEstimator(CAMERA, frames=3)
    reasons = [a.reason for k, f in enumerate(frames) if (a := estimator.push(k * PERIOD_NS, f)) is not None]
    assert reasons[0] == MotionReason.DUPLICATED
    assert reasons[-1] == MotionReason.GOOD


def test_a_region_of_interest_and_a_lens_are_honoured() -> None:
    """GIVEN a barrel lens WHEN the picture is undistorted THEN the pinhole displacement comes back."""
    picture = rendered(9.0, 6, bright=True, contrast=0.1, camera={"k1": -0.15, "focal_px": 400.0})
    lens = Camera(
        resolution=(640, 360), intrinsics=(400.0, 400.0, 319.5, 179.5), rate_hz=30.0,
        distortion_model="radial-tangential", distortion_coefficients=(-0.15, 0.0, 0.0, 0.0),
    )  # fmt: skip
    roi = (60, 80, 240, 480)

    def last(undistort: bool) -> float:
        estimator = MotionEstimator(lens, frames=5, roi=roi, undistort=undistort)
        answers = [estimator.push(k * PERIOD_NS, frame) for k, frame in enumerate(picture.frames)]
        assert answers[-1] is not None
        return answers[-1].displacement_px

    assert last(True) == pytest.approx(9.0, abs=0.05)
    assert abs(last(False) - 9.0) > 0.1


@pytest.mark.parametrize("frames", [2, 5])
def test_a_steady_stream_keeps_its_memory(frames: int) -> None:
    """GIVEN a full ring THEN a push leaves nothing behind, and what it takes in between is less than one picture."""
    pictures = rendered(6.0, 10, frames=40).frames
    estimator = MotionEstimator(CAMERA, frames=frames)
    for k in range(20):
        estimator.push(k * PERIOD_NS, pictures[k], EXPOSURE_S)
    kept, taken = [], []
    tracemalloc.start(1)
    try:
        for k in range(20, 40):
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            estimator.push(k * PERIOD_NS, pictures[k], EXPOSURE_S)
            now, peak = tracemalloc.get_traced_memory()
            kept.append(now - before)
            taken.append(peak - before)
    finally:
        tracemalloc.stop()
    assert sum(kept[4:]) < 8_000  # small numbers and caches of numpy's, 0.2 % of the ring
    assert max(taken) < pictures[0].nbytes


def test_a_stream_measures_the_blur_once_per_window_of_new_frames() -> None:
    frames = rendered(24.0, 11, bright=True, contrast=0.1, frames=14).frames
    estimator = MotionEstimator(CAMERA, frames=5)
    answers = [estimator.push(k * PERIOD_NS, frame, EXPOSURE_S) for k, frame in enumerate(frames)]
    kappa = np.array([answer.kappa for answer in answers if answer is not None])
    told = np.isfinite(kappa)
    assert told.tolist() == [k % 4 == 3 for k in range(10)]
    np.testing.assert_allclose(kappa[told], 1.0, atol=0.1)


def test_other_methods_stream_too() -> None:
    frames = rendered(20.0, 7, frames=5, bright=True, contrast=0.1).frames
    estimator = MotionEstimator(CAMERA, frames=5, method="composite")
    answers = [estimator.push(k * PERIOD_NS, frame, EXPOSURE_S) for k, frame in enumerate(frames)]
    assert answers[-1] is not None
    assert answers[-1].displacement_px == pytest.approx(20.0, abs=0.2)
    assert np.isnan(answers[-1].cross_px)
