"""The joint estimate on rendered walls: accuracy, honest sigma, and each safeguard switched on and off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from axialnav.estimators.estimate import MotionEstimate, MotionReason, estimate_motion
from axialnav.estimators.measure import JointOptions, measure_joint
from axialnav.estimators.refine import fit_frames
from axialnav.estimators.window import FrameWindow
from axialnav.replay.simulate.render import Rendering, dropped_frame
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered, texture


def measured(picture: Rendering, **options: object) -> MotionEstimate:
    frames = picture.frames
    window = FrameWindow(frames.shape[1], frames.shape[2], len(frames), frames.dtype)
    for frame in frames:
        window.push(frame)
    return measure_joint(window, JointOptions(PERIOD_S, EXPOSURE_S, **options))  # type: ignore[arg-type]


@pytest.mark.slow
def test_errors_are_small_signed_and_as_large_as_sigma_says() -> None:
    """40 windows of a weakly textured wall in dim light, 0.5 to 40 px per frame, both ways."""
    rng = np.random.default_rng(1)
    errors, z = [], []
    for seed in range(40):
        d = float(np.exp(rng.uniform(np.log(0.5), np.log(40.0)))) * (1.0 if seed % 2 else -1.0)
        picture = rendered(d, seed)
        estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
        assert estimate.accepted, estimate.reason
        assert estimate.signed
        errors.append(estimate.displacement_px - picture.displacement_px)
        z.append(errors[-1] / estimate.sigma_px)
    assert np.sqrt(np.mean(np.square(errors))) < 0.02
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.4


@pytest.mark.parametrize("frames", [2, 3, 5, 8])
def test_any_number_of_frames_from_two(frames: int) -> None:
    picture = rendered(6.3, 3, frames=frames, bright=True, contrast=0.1)
    estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S)
    assert estimate.displacement_px == pytest.approx(6.3, abs=0.02)
    assert estimate.window_s == pytest.approx((frames - 1) * PERIOD_S)


def test_motion_down_the_columns_is_the_same_measurement() -> None:
    frames = np.ascontiguousarray(rendered(4.2, 4).frames.transpose(0, 2, 1))
    estimate = estimate_motion(frames, frame_period_s=PERIOD_S, axis="y")
    assert estimate.displacement_px == pytest.approx(4.2, abs=0.03)


def test_drift_across_the_rows_is_seen_and_followed() -> None:
    picture = rendered(9.0, 5, drift_px=2.0)
    estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S)
    assert estimate.cross_px == pytest.approx(2.0, abs=0.15)
    assert estimate.displacement_px == pytest.approx(9.0, abs=0.04)


@pytest.mark.parametrize("drift_px", [1, 3])
def test_two_frames_of_slanted_lines_are_followed_across_the_rows(drift_px: int) -> None:
    """Half of the texture leans: a row that is one too high shows it 0.8 px too far, and all rows agree about that."""
    rng = np.random.default_rng(3)
    row, column = np.mgrid[0:420, 0:900]
    upright = ndimage.gaussian_filter(rng.normal(size=(420, 900)), 1.0)
    long = ndimage.gaussian_filter(rng.normal(size=(420, 1400)), (8.0, 1.0))
    leaning = ndimage.map_coordinates(long, [row, column + 0.8 * row], order=1)
    wall = 110.0 + 6.0 * (upright / upright.std() + leaning / leaning.std())
    cuts = [wall[20 + k * drift_px :, 40 + 6 * k :][:300, :520] for k in range(2)]
    frames = [np.rint(cut + rng.normal(0.0, 1.0, cut.shape)).clip(0, 255).astype(np.uint8) for cut in cuts]
    estimate = estimate_motion(frames, frame_period_s=PERIOD_S)
    assert estimate.displacement_px == pytest.approx(-6.0, abs=0.01)
    assert estimate.cross_px == pytest.approx(-drift_px, abs=0.4)


@pytest.mark.parametrize("displacement_px", [7, -23])
def test_windows_follow_the_wall(displacement_px: int) -> None:
    """GIVEN whole pixels of motion and no noise THEN windows that follow show one piece of wall, but for its level."""
    frames = [texture(120, 900, 1)[:, 300 - k * displacement_px :][:, :480] for k in range(5)]
    window = FrameWindow(120, 480, 5, frames[0].dtype)
    for frame in frames:
        window.push(frame)
    led = window.following(float(displacement_px)).total
    assert np.abs(led.im).max() < 0.03 * led.re.max()
    left = window.following(0.0).total
    assert np.abs(left.im).max() > 0.3 * left.re.max()


def test_what_every_row_has_alike_is_no_wall_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """GIVEN columns with gains of their own and a faint wall THEN it takes the columns' level off to see its motion."""
    pictures = [rendered(0.8, seed, contrast=0.03, camera={"column_pattern": 0.01}) for seed in (1, 2, 3)]
    for picture in pictures:
        assert measured(picture).displacement_px == pytest.approx(0.8, abs=0.03)
    monkeypatch.setattr("axialnav.estimators.window.remove_level", lambda rows, smooth, means: None)
    for picture in pictures:
        assert measured(picture).displacement_px != pytest.approx(0.8, abs=0.5)


def test_acceleration_is_fitted_where_it_shows_and_only_there() -> None:
    bent = estimate_motion(rendered(9.0, 6, acceleration_px=1.0).frames, frame_period_s=PERIOD_S)
    assert bent.acceleration_px == pytest.approx(1.0, abs=0.05)
    assert bent.displacement_px == pytest.approx(9.0, abs=0.04)
    straight = estimate_motion(rendered(9.0, 6).frames, frame_period_s=PERIOD_S)
    assert straight.acceleration_px == 0.0


def test_an_acceleration_known_from_before_is_kept_or_given_up_as_the_frames_say() -> None:
    """The answer does not depend on whether the fit begins with an acceleration."""
    for picture in (rendered(9.0, 6, acceleration_px=1.0), rendered(9.0, 6)):
        window = FrameWindow(*picture.frames[0].shape, 5, picture.frames.dtype)
        for frame in picture.frames:
            window.push(frame)
        products = window.following(9.0)
        cold, warm = (fit_frames(products, np.array(start), 0.3) for start in ([9.0], [9.0, 0.9]))
        assert cold is not None
        assert warm is not None
        np.testing.assert_allclose(warm.motion, cold.motion, atol=0.3 * np.sqrt(cold.covariance[0, 0]))


@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_a_dropped_frame_is_refused_and_believed_without_the_check(place: int) -> None:
    picture = rendered(3.0, 7, bright=True, contrast=0.1, frame_times=dropped_frame(5, place))
    guarded = measured(picture)
    assert not guarded.accepted
    assert guarded.reason in (MotionReason.UNEVEN, MotionReason.PAIR)
    assert measured(picture, evenness=False, kappa=False).reason not in (MotionReason.UNEVEN, MotionReason.PAIR)


def test_a_dropped_frame_between_two_is_caught_by_the_blur_alone() -> None:
    """N = 2 leaves nothing to compare but the length of the blur: half of what the displacement says."""
    picture = rendered(24.0, 8, bright=True, contrast=0.1, frames=2, frame_times=(0.0, 2.0))
    guarded = measured(picture)
    assert guarded.reason == MotionReason.KAPPA
    assert guarded.kappa == pytest.approx(0.5, abs=0.1)
    assert measured(picture, kappa=False).displacement_px == pytest.approx(48.0, abs=0.1)
    healthy = measured(rendered(24.0, 8, bright=True, contrast=0.1, frames=2))
    assert healthy.kappa == pytest.approx(1.0, abs=0.1)


def test_a_frame_delivered_twice_is_refused() -> None:
    frames = rendered(5.0, 9).frames.copy()
    frames[3] = frames[2]
    assert estimate_motion(frames, frame_period_s=PERIOD_S).reason == MotionReason.DUPLICATED


@pytest.mark.parametrize("name", ["gear", "corner"])
def test_row_bands_see_past_what_is_fixed_to_the_airframe(name: str) -> None:
    picture = rendered(20.0, 10, occluders=(name,))
    assert measured(picture).displacement_px == pytest.approx(20.0, abs=0.15)


@pytest.mark.parametrize("d", [-28.0, 26.0, 30.0])
def test_a_vignette_is_no_object_in_front_of_a_fast_wall(d: float) -> None:
    estimate = measured(rendered(d, 0, camera={"vignette": 0.4}))
    assert estimate.accepted, estimate.reason
    assert estimate.displacement_px == pytest.approx(d, abs=5.0 * estimate.sigma_px)


def test_a_cable_does_not_hold_the_wall_back() -> None:
    """A slow wall behind a cable, most of which runs along the motion: what is left of it would pull towards zero."""
    seen = [measured(rendered(1.1, seed, occluders=("cable",))) for seed in range(8)]
    errors = np.array([estimate.displacement_px - 1.1 for estimate in seen])
    assert abs(errors.mean()) < 0.004
    assert np.sqrt(np.mean((errors / [estimate.sigma_px for estimate in seen]) ** 2)) < 1.4


def test_bands_that_only_saw_a_cable_take_part_once_it_is_cut_out() -> None:
    """The cable wins the vote of two bands; four strips of ten would cost a third of the accuracy."""
    sigmas = np.array([[measured(rendered(20.0, s, occluders=o)).sigma_px for o in ((), ("cable",))] for s in range(6)])
    plain, behind = np.median(sigmas, axis=0)
    assert behind < 1.2 * plain


def test_without_the_vote_a_landing_gear_is_taken_for_a_wall_at_rest() -> None:
    picture = rendered(20.0, 10, contrast=0.02, occluders=("gear",))
    assert measured(picture, consensus=False).displacement_px == pytest.approx(0.0, abs=0.5)
    voted = measured(picture)
    assert not voted.accepted or abs(voted.displacement_px - 20.0) < 1.0


@pytest.mark.slow
def test_noise_alone_is_never_a_displacement() -> None:
    for seed in range(40):
        pattern = {"pixel_pattern": 0.01} if seed % 2 else {}
        picture = rendered(7.0, seed, contrast=0.0, camera=pattern)
        estimate = estimate_motion(picture.frames, frame_period_s=PERIOD_S)
        assert not estimate.accepted
        assert estimate.reason in (MotionReason.AMBIGUOUS, MotionReason.STATIC, MotionReason.BANDS)


def test_a_prior_narrows_the_search_and_does_not_pull() -> None:
    picture = rendered(12.0, 11, contrast=0.02)
    free = estimate_motion(picture.frames, frame_period_s=PERIOD_S)
    led = estimate_motion(picture.frames, frame_period_s=PERIOD_S, prior_px=(12.4, 0.3))
    assert led.displacement_px == pytest.approx(free.displacement_px, abs=1e-3)
    assert led.sigma_px == pytest.approx(free.sigma_px, rel=1e-2)
    misled = estimate_motion(picture.frames, frame_period_s=PERIOD_S, prior_px=(-20.0, 1.0))
    assert not misled.accepted


def test_equal_frames_give_equal_bits() -> None:
    picture = rendered(7.7, 12)
    first, second = (estimate_motion(picture.frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S) for _ in range(2))
    assert repr(first) == repr(second)


def test_deep_pixels_and_colour_say_the_same() -> None:
    frames = rendered(7.7, 13).frames
    grey = estimate_motion(frames, frame_period_s=PERIOD_S)
    deep = estimate_motion(frames.astype(np.uint16) * 16, frame_period_s=PERIOD_S)
    colour = estimate_motion([np.dstack([f, f, f]) for f in frames], frame_period_s=PERIOD_S)
    yuyv = estimate_motion([np.dstack([f, np.full_like(f, 128)]) for f in frames], frame_period_s=PERIOD_S)
    assert deep.displacement_px == pytest.approx(grey.displacement_px, abs=1e-4)
    assert colour.displacement_px == grey.displacement_px == yuyv.displacement_px


def test_a_wall_that_repeats_itself_needs_a_prior() -> None:
    """A strictly periodic wall fits at d and at d minus its period alike: refused, unless a prior rules one out."""
    period, d = 64.0, 40.0
    x = np.arange(640.0)
    rng = np.random.default_rng(15)
    level = np.linspace(0.7, 1.3, 360)[:, None]

    def frame(k: int) -> np.ndarray:
        waves = sum(np.sin(2.0 * np.pi * n * (x - d * k) / period + n) / n for n in range(1, 12))
        return np.clip(110.0 + 15.0 * level * waves + rng.normal(0.0, 2.0, (360, 640)), 0, 255).astype(np.uint8)

    frames = [frame(k) for k in range(5)]
    assert not estimate_motion(frames, frame_period_s=PERIOD_S).accepted
