"""The blur of one exposure, from one frame."""

from __future__ import annotations

import math

import numpy as np

from axialnav.estimators.frames import Frames, frame_stack
from axialnav.estimators.options import check_times
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.rows import bin_height
from axialnav.estimators.spectral.fit import best_blur
from axialnav.estimators.spectral.picture import Spectra, composite_rows
from axialnav.estimators.spectral.strips import wall_spectra
from axialnav.estimators.spectral.verdict import why_refused, why_unusable
from axialnav.models.camera import ExposureBlur

SHORTEST_PX = 3.0
LOWEST_PX = 0.8  # lengths below the shortest are looked at, so that they can be recognised
REACH = 8  # of the picture's width


def fit_single(
    frames: Frames, frame_period_s: float, exposure_s: float | None, highest_frequency: float = 0.5
) -> MotionEstimate:
    """Displacement per frame period from the blur of the exposure, ``l T / t_e``, without its sign.

    Parameters
    ----------
    frames
        One frame, or several whose spectra are averaged; (N, h, w) or a sequence, motion along the rows.
    frame_period_s, exposure_s
        Frame period and exposure [s]; without an exposure the blur says nothing about speed.
    highest_frequency
        Highest frequency to look at [cycles/px]: video codecs and pictures that were turned or enlarged hold no truth
        about the finest ones.

    Returns
    -------
    MotionEstimate
        Refused where the blur is shorter than 3 px, the texture too weak or the exposure unknown or 0.

    Raises
    ------
    FrameError
        If frames or times are not what this function takes.
    """
    check_times(frame_period_s, exposure_s)
    stack = frame_stack(frames, "x", 1, "single")
    if not exposure_s:
        return refused(MotionReason.NO_EXPOSURE, signed=False, window_s=0.0, method="single")
    reason = why_unusable(stack)
    if reason:
        return refused(reason, signed=False, window_s=exposure_s, method="single")
    gain = float(bin_height(*stack[0].shape))
    parts = [wall_spectra(composite_rows([frame]), gain) for frame in stack]
    seen = [part for part in parts if part is not None]
    if len(seen) < len(parts):
        return refused(MotionReason.BANDS, signed=False, window_s=exposure_s, method="single")
    spectra = averaged(seen)
    usable = np.asarray(spectra.frequency < highest_frequency)
    fit = best_blur(spectra, usable, LOWEST_PX, spectra.length / REACH)
    reason = why_refused(fit, SHORTEST_PX)
    if reason:
        return refused(reason, signed=False, window_s=exposure_s, method="single")
    displacement = ExposureBlur(fit.blur_px, exposure_s).displacement_px(frame_period_s)
    sigma = ExposureBlur(fit.sigma_px, exposure_s).displacement_px(frame_period_s)
    return MotionEstimate(displacement, sigma, math.nan, True, MotionReason.GOOD, False, exposure_s, method="single")


def averaged(spectra: list[Spectra]) -> Spectra:
    """Mean of the spectra of frames of one size; strips are counted from the top of what shows the wall."""
    power = np.mean([each.power for each in spectra], axis=0)
    rows = np.mean([each.rows for each in spectra], axis=0)
    return Spectra(power, rows, spectra[0].frequency, spectra[0].length)
