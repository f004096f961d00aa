"""What cannot be measured gets one clear error or a refusal with its reason, never a number."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from axialnav.estimators.estimate import FrameError, MotionEstimate, MotionEstimator, MotionReason, estimate_motion
from axialnav.models.rig import Camera
from tests.estimators.scenes import texture

GOOD = np.stack([np.roll(texture(64, 96, 0), 3 * k, axis=1) for k in range(3)])


METHODS = ("joint", "composite", "single", "stripes", "darkline", "dct", "cepstrum")
WIDE = Camera(resolution=(128, 64), intrinsics=(60.0, 60.0, 64.0, 32.0), rate_hz=30.0)
PERIOD_NS = 33_000_000


def ask(frames: object, **options: object) -> MotionEstimate:
    return estimate_motion(frames, **{"frame_period_s": 0.033, "exposure_s": 0.01, **options})  # type: ignore[arg-type]


def stream(
    method: str,
    frames: object,
    stamps: tuple[object, ...] = (0, PERIOD_NS, 2 * PERIOD_NS),
    options: dict[str, object] | None = None,
    **push: object,
) -> MotionEstimate | None:
    """Answer to the last of three frames."""
    estimator = MotionEstimator(**{"frames": 3, "method": method, **(options or {})})  # type: ignore[arg-type]
    answer = None
    for t_ns, picture in zip(stamps, frames, strict=True):  # type: ignore[call-overload]
        answer = estimator.push(t_ns, picture, **{"exposure_s": 0.01, **push})
    return answer


def refusal(what: Callable[..., object], *args: object, **options: object) -> str:
    """The one line with which it is refused."""
    with pytest.raises(FrameError) as caught:
        what(*args, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


NO_FRAMES: list[tuple[object, str]] = [
    (GOOD.astype(np.float32), "uint8 or uint16, got float32"),
    (GOOD / math.nan, "uint8 or uint16"),
    (GOOD.astype(np.int16), "uint8 or uint16, got int16"),
    (GOOD.astype(">u2"), "uint8 or uint16, got >u2"),
    (GOOD > 100, "uint8 or uint16, got bool"),
    (GOOD.astype(object), "uint8 or uint16, got object"),
    (GOOD.astype(complex), "uint8 or uint16, got complex128"),
    (np.ma.masked_array(GOOD, mask=GOOD > 100), "masked"),
    (GOOD[:, :20], "at least 32 px"),
    (GOOD[:, :0], "at least 32 px"),
    (GOOD[:, :, :0], "at least 32 px"),
    (np.repeat(GOOD[..., None], 4, axis=3), "shape (64, 96, 4)"),
    ([[GOOD[0]], [GOOD[1]]], "numpy array, got list"),
    (GOOD.tolist(), "numpy array, got list"),
    ([GOOD[0], None, GOOD[2]], "numpy array, got NoneType"),
    ("abc", "numpy array, got str"),
]
NO_STACKS: list[tuple[object, str]] = [
    (GOOD[:0], "frames, got 0"),
    ([], "frames, got 0"),
    ([GOOD[0]] * 65, "to 64 frames, got 65"),
    ([GOOD[0], GOOD[1][:50]], "one size"),
    ([GOOD[0], GOOD[1].astype(np.uint16)], "one type"),
    (None, "list of pictures, got NoneType"),
    (3, "list of pictures, got int"),
    (GOOD[0], "list of pictures, got shape (64, 96)"),
    (GOOD[0, 0], "list of pictures, got shape"),
    (np.array(3, dtype=np.uint8), "list of pictures, got shape"),
    ((picture for picture in GOOD), "list of pictures, got generator"),
    ({"first": GOOD[0]}, "list of pictures, got dict"),
]
NO_OPTIONS: list[tuple[dict[str, object], str]] = [
    *(({"frame_period_s": wrong}, "frame_period_s") for wrong in (0.0, -1.0, math.nan, math.inf, None, "1", [0.03])),
    *(({"exposure_s": wrong}, "exposure_s") for wrong in (-0.01, 0.1, 1e300, math.inf, math.nan, "1", [0.01] * 3)),
    ({"axis": "z"}, "axis"),
    ({"axis": ["x"]}, "axis"),
    ({"method": "joit"}, "joint"),
    ({"method": ["joint"]}, "joint"),
    ({"method": None}, "joint"),
    ({"camera": "cam0"}, "camera must be"),
]
NO_PRIORS = [
    (1.0, 0.0), (1.0, -1.0), (math.nan, 1.0), (1.0, math.nan), (math.inf, 1.0), (1.0, math.inf), (1.0, 1.0, 1.0),
    (None, 1.0), 3.0, "ab",
]  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_measured_gets_one_line_that_names_it(method: str) -> None:
    """Whatever is wrong, with every method, at once and in a stream: one FrameError in one line."""
    for frames, words in NO_FRAMES + NO_STACKS:
        assert words in refusal(ask, frames, method=method)
    for options, words in NO_OPTIONS:
        assert words in refusal(ask, GOOD, **{"method": method, **options})
    for prior in NO_PRIORS:
        assert "prior_px" in refusal(ask, GOOD, method=method, prior_px=prior)
        assert "prior_px" in refusal(stream, method, GOOD, prior_px=prior)
    for frames, words in NO_FRAMES:
        assert words in refusal(stream, method, frames)
    for exposure in (-0.01, 0.1, 1e300, math.inf, math.nan, "1", [0.01] * 3):
        assert "exposure_s" in refusal(stream, method, GOOD, exposure_s=exposure)
    for stamp in (0.0, math.nan, None, "0", 1 << 70):
        assert "t_ns" in refusal(stream, method, GOOD, stamps=(stamp, stamp, stamp))
    for stamps in ((0, -1, 9), (0, 0, 9), (0, 33_000_000, 10)):
        assert "does not come after" in refusal(stream, method, GOOD, stamps=stamps)


@pytest.mark.parametrize("method", ["joint", "composite"])
def test_fewer_than_two_frames_are_too_few(method: str) -> None:
    assert "2 to 64 frames, got 1" in refusal(ask, GOOD[:1], method=method)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        *(({"frames": wrong}, "frames") for wrong in (0, 1, -1, 2.5, 3.0, "3", None, True, 10**9)),
        *(({"roi": wrong}, "roi") for wrong in ((0.0, 0.0, 40.0, 40.0), (0, 0, 40), (math.nan, 0, 40, 40), "abcd", 5)),
        *(({"roi": wrong}, "roi") for wrong in ((-1, 0, 40, 40), (0, 0, 0, 0), (0, 0, 31, 64))),
        *(({"roi": wrong}, "does not fit") for wrong in ((50, 50, 64, 64), (1000, 0, 40, 40))),
        ({"camera": "cam0"}, "camera must be"),
        ({"camera": WIDE}, "camera's resolution 128 x 64"),
        ({"camera": WIDE, "roi": (0, 0, 64, 129)}, "does not fit"),
        ({"method": ["joint"]}, "joint"),
        ({"axis": ["x"]}, "axis"),
    ],
)
def test_impossible_streams_are_refused(options: dict[str, object], words: str) -> None:
    assert words in refusal(stream, "joint", GOOD, options=options)


def test_a_picture_that_is_not_the_cameras_is_refused() -> None:
    assert "camera's resolution 128 x 64" in refusal(ask, GOOD, camera=WIDE)


@pytest.mark.parametrize("where", [-1e4, -60.0, -26.0, -25.0, -24.0, -23.0, 23.0, 24.0, 24.9, 25.0, 25.1, 60.0, 1e4])
def test_a_prior_beyond_what_the_frames_show_is_a_refusal(where: float) -> None:
    for estimate in (ask(GOOD, prior_px=(where, 0.1)), stream("joint", GOOD, prior_px=(where, 0.1))):
        assert estimate is not None
        assert not estimate.accepted
        assert math.isnan(estimate.displacement_px)


@pytest.mark.parametrize("method", METHODS)
def test_how_pixels_lie_in_memory_does_not_matter(method: str) -> None:
    """GIVEN the same pixels strided, read-only, in a list or in colour THEN the answer is the same to the bit."""
    wide = np.repeat(np.repeat(GOOD, 2, axis=1), 2, axis=2)[:, ::2, ::2]
    locked = GOOD.copy()
    locked.flags.writeable = False
    forms: list[object] = [wide, locked, list(GOOD), np.asfortranarray(GOOD), GOOD[:, ::-1, ::-1][:, ::-1, ::-1]]
    forms += [np.repeat(GOOD[..., None], channels, axis=3) for channels in (1, 2, 3)]
    first = ask(GOOD, method=method)
    for frames in forms:
        assert repr(ask(frames, method=method)) == repr(first)
        assert repr(replace(stream(method, frames), t_ns=None)) == repr(first)


def test_one_frame_of_unknown_rate_waits_for_the_period() -> None:
    for method in ("single", "stripes", "dct"):
        estimator = MotionEstimator(None, 1, method)
        assert estimator.push(0, GOOD[0], 0.01) is None
        assert estimator.push(33_000_000, GOOD[1], 0.01) is not None


@pytest.mark.parametrize("method", METHODS)
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
