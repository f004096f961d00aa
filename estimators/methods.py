"""Every method under its name."""

from __future__ import annotations

from itertools import pairwise

from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Image, unusable
from axialnav.estimators.measure import JointOptions, measure_joint
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.window import FrameWindow

LEAST_FRAMES = {"joint": 2}


def known_method(method: str) -> None:
    """Refuse a name that no method has.

    Raises
    ------
    FrameError
        With the list of names.
    """
    if method not in LEAST_FRAMES:
        raise FrameError(f"there is no method named {method!r}; choose from {', '.join(LEAST_FRAMES)}")


def estimate_stack(
    stack: list[Image],
    method: str,
    frame_period_s: float,
    exposure_s: float | None,
    prior_px: tuple[float, float] | None = None,
) -> MotionEstimate:
    """Run one method over grey frames of one size, motion along the rows."""
    span_s = (len(stack) - 1) * frame_period_s
    reason = next((why for why in map(unusable, stack) if why), "") or _duplicated(stack)
    if reason:
        return refused(reason, signed=method == "joint", window_s=span_s, method=method)
    window = FrameWindow(stack[0].shape[0], stack[0].shape[1], len(stack), stack[0].dtype)
    for image in stack:
        window.push(image)
    return measure_joint(window, JointOptions(frame_period_s, exposure_s, prior_px))


def _duplicated(stack: list[Image]) -> str:
    same = any((a == b).all() for a, b in pairwise(stack))
    return MotionReason.DUPLICATED if same else ""
