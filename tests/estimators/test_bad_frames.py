"""What cannot be measured gets one clear error or a refusal with its reason, never a number."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.estimators.estimate import FrameError, MotionEstimate, MotionReason, estimate_motion
from tests.estimators.scenes import texture

GOOD = np.stack([np.roll(texture(64, 96, 0), 3 * k, axis=1) for k in range(3)])


def ask(frames: object, **options: object) -> MotionEstimate:
    return estimate_motion(frames, **{"frame_period_s": 0.033, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("frames", "options", "words"),
    [
        (GOOD.astype(np.float32), {}, "uint8 or uint16, got float32"),
        (GOOD / math.nan, {}, "uint8 or uint16"),
        (GOOD[:, :20], {}, "at least 32 px"),
        (GOOD[0], {}, "grey"),
        (GOOD[:1], {}, "at least 2 frames, got 1"),
        (GOOD[:0], {}, "at least 2 frames, got 0"),
        ([GOOD[0], GOOD[1][:50]], {}, "one size"),
        ([GOOD[0], GOOD[1].astype(np.uint16)], {}, "one type"),
        ([[1, 2], [3, 4]], {}, "numpy array"),
        (GOOD, {"method": "joit"}, "joint"),
        (GOOD, {"axis": "z"}, "axis"),
        (GOOD, {"frame_period_s": 0.0}, "frame_period_s"),
        (GOOD, {"frame_period_s": math.nan}, "frame_period_s"),
        (GOOD, {"exposure_s": -0.01}, "exposure_s"),
        (GOOD, {"exposure_s": 0.1}, "exposure_s"),
        (GOOD, {"exposure_s": math.nan}, "exposure_s"),
        (GOOD, {"prior_px": (1.0, 0.0)}, "prior_px"),
        (GOOD, {"prior_px": (math.nan, 1.0)}, "prior_px"),
    ],
)
def test_wrong_input_gets_one_line_that_names_it(frames: object, options: dict[str, object], words: str) -> None:
    with pytest.raises(FrameError, match=words) as caught:
        ask(frames, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", ["joint", "composite", "single"])
@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (np.zeros((64, 96), np.uint8), MotionReason.DARK),
        (np.full((64, 96), 255, np.uint8), MotionReason.SATURATED),
        (np.full((64, 96), 4095, np.uint16), MotionReason.SATURATED),
        (np.full((64, 96), 90, np.uint8), MotionReason.NO_TEXTURE),
    ],
)
def test_pictures_of_nothing_are_refused_by_name(method: str, frame: np.ndarray, reason: str) -> None:
    estimate = ask([frame, frame, frame], method=method, exposure_s=0.01)
    assert not estimate.accepted
    assert estimate.reason == reason
    assert math.isnan(estimate.displacement_px)
    assert math.isnan(estimate.sigma_px)


def test_an_accepted_estimate_cannot_be_built_without_a_number() -> None:
    with pytest.raises(ValueError, match="finite"):
        MotionEstimate(math.nan, 0.1, 0.0, True, "", True, 0.1)
    with pytest.raises(ValueError, match="positive"):
        MotionEstimate(1.0, 0.0, 0.0, True, "", True, 0.1)


def test_random_pictures_never_crash_and_never_lie() -> None:
    """Pure noise of any size and type: refused, whatever the shape."""
    rng = np.random.default_rng(2)
    for _ in range(25):
        shape = (int(rng.integers(2, 7)), int(rng.integers(32, 120)), int(rng.integers(32, 160)))
        kind = rng.choice([np.uint8, np.uint16])
        frames = rng.integers(0, 200, shape).astype(kind)
        for method in ("joint", "composite"):
            assert not ask(frames, method=method).accepted
