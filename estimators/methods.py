"""Every method under its name."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike

from axialnav.estimators.baselines.reading import BlurReading
from axialnav.estimators.errors import FrameError
from axialnav.estimators.frames import Image
from axialnav.estimators.measure import JointOptions, measure_joint
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.spectral import fit_composite, fit_single
from axialnav.estimators.spectral.verdict import why_unusable
from axialnav.estimators.window import FrameWindow
from axialnav.models.camera import CompositeBlur, ExposureBlur

BASELINES = ("stripes", "darkline", "dct", "cepstrum")
LEAST_FRAMES = {"joint": 2, "composite": 2, "single": 1, **dict.fromkeys(BASELINES, 1)}
BASELINE_SIGMA = 0.2  # the published methods give none; this is what they claim at best


def known_method(method: str) -> None:
    """Refuse a name that no method has.

    Raises
    ------
    FrameError
        With the list of names.
    """
    if not isinstance(method, str) or method not in LEAST_FRAMES:
        raise FrameError(f"there is no method named {method!r}; choose from {', '.join(LEAST_FRAMES)}")


def estimate_stack(
    stack: list[Image],
    method: str,
    frame_period_s: float,
    exposure_s: float | None,
    prior_px: tuple[float, float] | None = None,
) -> MotionEstimate:
    """Run one method over grey frames of one size, motion along the rows."""
    if method == "composite":
        return fit_composite(stack, frame_period_s)
    span_s = (len(stack) - 1) * frame_period_s
    reason = why_unusable(stack)
    if reason:
        return refused(reason, signed=method == "joint", window_s=span_s, method=method)
    if method == "single":
        return fit_single([stack[len(stack) // 2]], frame_period_s, exposure_s)
    if method in BASELINES:
        return _baseline(stack, method, frame_period_s, exposure_s)
    height, width = stack[0].shape
    window = FrameWindow(height, width, len(stack), stack[0].dtype, borrow=True)
    for image in stack:
        window.push(image)
    return measure_joint(window, JointOptions(frame_period_s, exposure_s, prior_px))


def _baseline(stack: list[Image], method: str, frame_period_s: float, exposure_s: float | None) -> MotionEstimate:
    """A published method on the composite (its length is ``N d``), or on the frame if there is one."""
    read: Callable[[ArrayLike], BlurReading] = getattr(
        import_module(f"axialnav.estimators.baselines.{method}"), f"{method}_length"
    )
    frames = len(stack)
    window_s = (frames - 1) * frame_period_s if frames > 1 else exposure_s or 0.0
    if frames == 1 and not exposure_s:
        return refused(MotionReason.NO_EXPOSURE, signed=False, window_s=0.0, method=method)
    reading = read(np.mean(stack, axis=0, dtype=np.float32) if frames > 1 else stack[0])
    if not reading.found:
        return refused(reading.reason, signed=False, window_s=window_s, method=method)
    if frames > 1:
        per_period = CompositeBlur(reading.length_px, frames, frame_period_s).displacement_px
    else:
        per_period = ExposureBlur(reading.length_px, exposure_s or math.nan).displacement_px(frame_period_s)
    sigma = BASELINE_SIGMA * per_period
    return MotionEstimate(per_period, sigma, math.nan, True, MotionReason.GOOD, False, window_s, method=method)
