"""The methods the paper's experiments compare: a window of frames in, px per frame out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from axialnav.estimators.baselines.cepstrum import cepstrum_length
from axialnav.estimators.baselines.composite_mean import composite_mean
from axialnav.estimators.baselines.darkline import darkline_length
from axialnav.estimators.baselines.dct import dct_length
from axialnav.estimators.baselines.reading import BlurReading
from axialnav.estimators.baselines.stripes import stripes_length
from axialnav.estimators.estimate import estimate_motion
from axialnav.models.camera import CompositeBlur, ExposureBlur


@dataclass(frozen=True)
class Window:
    """What a method may know: frames uint8 (n, h, w), frame period and exposure [s]."""

    frames: NDArray[np.uint8]
    frame_period_s: float
    exposure_s: float


Measure = Callable[[Window], tuple[float, ...]]
"""Displacement per frame [px]; several when the method cannot tell which of them is meant, NaN when it has none."""


def one_frame(method: Callable[[ArrayLike], BlurReading]) -> Measure:
    """Read the middle frame; blur ``l`` of one exposure means ``l T / te`` per frame (the paper's equation 3)."""

    def measure(window: Window) -> tuple[float, ...]:
        """From the middle frame."""
        reading = method(window.frames[len(window.frames) // 2])
        if not reading.found:
            return (math.nan,)
        return (ExposureBlur(reading.length_px, window.exposure_s).displacement_px(window.frame_period_s),)

    return measure


def of_composite(method: Callable[[ArrayLike], BlurReading]) -> Measure:
    """Read the mean of all frames; composite length ``l_c`` means ``l_c / N`` per frame."""

    def measure(window: Window) -> tuple[float, ...]:
        """From the mean of all frames."""
        reading = method(composite_mean(window.frames))
        if not reading.found:
            return (math.nan,)
        return (CompositeBlur(reading.length_px, len(window.frames), window.frame_period_s).displacement_px,)

    return measure


def of_composite_either_way(method: Callable[[ArrayLike], BlurReading]) -> Measure:
    """Read the mean of all frames; leave open whether dark lines (``l_c / N``) or bright ridges (``d``) were read."""

    def measure(window: Window) -> tuple[float, ...]:
        """Both readings of the mean of all frames."""
        ridges = method(composite_mean(window.frames)).length_px
        return *of_composite(method)(window), ridges

    return measure


def estimator(method: str) -> Measure:
    """One of the package's own estimators; NaN when it refuses."""

    def measure(window: Window) -> tuple[float, ...]:
        """By the package's estimator."""
        frames = window.frames if method != "single" else window.frames[len(window.frames) // 2][None]
        estimate = estimate_motion(
            frames, method=method, frame_period_s=window.frame_period_s, exposure_s=window.exposure_s
        )
        return (abs(estimate.displacement_px) if estimate.accepted else math.nan,)

    return measure


METHODS: dict[str, Measure] = {
    "stripes, one frame": one_frame(stripes_length),
    "stripes, composite": of_composite(stripes_length),
    "stripes, composite, oracle": of_composite_either_way(stripes_length),
    "dark line, one frame": one_frame(darkline_length),
    "dark line, composite": of_composite(darkline_length),
    "DCT, one frame": one_frame(dct_length),
    "DCT, composite": of_composite(dct_length),
    "cepstrum, one frame": one_frame(cepstrum_length),
    "cepstrum, composite": of_composite(cepstrum_length),
    "single fit, one frame": estimator("single"),
    "composite fit": estimator("composite"),
    "joint": estimator("joint"),
}
