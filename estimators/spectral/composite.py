"""The paper's composite, read by maximum likelihood instead of by Hough lines.

The mean of N frames shows N copies of the wall, ``d`` px apart.  Their interference is a comb in the spectrum, and the
comb is fitted.  Its information is the displacement from frame to frame without the sign; the blur of the exposures
is only its envelope.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Frames, frame_stack
from axialnav.estimators.options import check_times
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.rows import bin_height
from axialnav.estimators.spectral.blocks import block_notches, blocky
from axialnav.estimators.spectral.fit import Fit, best_displacement, free_blur
from axialnav.estimators.spectral.picture import Spectra, composite_rows, row_window
from axialnav.estimators.spectral.shapes import comb, pair_lags
from axialnav.estimators.spectral.steps import surely_even
from axialnav.estimators.spectral.strips import wall_spectra
from axialnav.estimators.spectral.verdict import may_be_uneven, why_refused, why_unusable
from axialnav.estimators.spectral.whittle import SHIFT

LEAST_FRAMES = 2
LARGEST_PX = 128.0
FLOOR_PART, LOUD, MIN_LOUD, FLAT = 10, 3.0, 24, 0.02
UNKNOWN_RATIOS = (0.05, 0.3, 0.7)
SHORTEST_PX = 0.45
PLAIN_EXCESS, MIN_COMB = 1.45, 0.5  # spectra further from smooth are asked whether one frame has that comb already
SYSTEMATIC = 5e-4  # of the displacement: what the smearing of the comb by the window is not known better than


def fit_composite(frames: Frames, frame_period_s: float, exposure_s: float | None = None) -> MotionEstimate:
    """Displacement per frame period from the mean of N frames, without its sign.

    Parameters
    ----------
    frames
        N >= 2 evenly spaced frames, (N, h, w) or a sequence, uint8 or uint16, motion along the rows.
    frame_period_s
        Time from frame to frame [s].
    exposure_s
        Exposure [s]; None if unknown, which takes longer.

    Returns
    -------
    MotionEstimate
        Refused with a reason where the frames do not tell; displacements from 0.45 px up to 128 px or half the
        picture's width over N - 1, whichever is less.

    Raises
    ------
    FrameError
        If frames or times are not what this function takes.
    """
    check_times(frame_period_s, exposure_s)
    stack = frame_stack(frames, "x", LEAST_FRAMES, "composite")
    span_s = (len(stack) - 1) * frame_period_s
    reason = why_unusable(stack)
    if reason:
        return refused(reason, signed=False, window_s=span_s, method="composite")
    height, width = stack[0].shape
    rows = composite_rows(stack)
    spectra = wall_spectra(rows, float(len(stack) * bin_height(height, width)))
    if spectra is None:
        return refused(MotionReason.BANDS, signed=False, window_s=span_s, method="composite")
    usable = np.ones(len(spectra.frequency), dtype=np.bool_)
    if blocky(rows):
        usable = block_notches(spectra.frequency, spectra.length)
    reach = min(LARGEST_PX, width / (2.0 * (len(stack) - 1)))
    ratio = None if exposure_s is None else exposure_s / frame_period_s
    fit = _fit(spectra, usable, len(stack), ratio, reach)
    displacement = float(fit.theta[SHIFT])
    reason = why_refused(fit, displacement, SHORTEST_PX)
    if not reason and fit.excess > PLAIN_EXCESS and comb_share(stack, spectra, displacement) < MIN_COMB:
        reason = MotionReason.PERIODIC
    if not reason and may_be_uneven(fit) and not surely_even(stack):
        reason = MotionReason.AMBIGUOUS
    if reason:
        return refused(reason, signed=False, window_s=span_s, method="composite")
    sigma = math.hypot(fit.sigma_px, SYSTEMATIC * displacement)
    return MotionEstimate(
        displacement, sigma, math.nan, True, MotionReason.GOOD, False, span_s, math.nan, 0.0, "composite"
    )


def comb_share(stack: list[NDArray[np.unsignedinteger[Any]]], spectra: Spectra, displacement_px: float) -> float:
    """How much of the structure in the composite's spectrum over that of one frame is the comb [-]: a correlation.

    Bricks and planks have a comb of their own, in every frame; motion makes one that single frames lack.
    """
    one = wall_spectra(composite_rows([stack[len(stack) // 2]]), float(bin_height(*stack[0].shape)))
    if one is None:
        return 0.0
    comb_power = np.empty((len(spectra.frequency), 3))
    window = row_window(spectra.length)[1]
    comb(displacement_px, 0.0, pair_lags(tuple(range(len(stack)))), spectra.frequency, window, 0.0, comb_power)
    floor = float(np.median(one.mean[-len(one.mean) // FLOOR_PART :]))
    loud = one.mean > LOUD * floor
    if int(loud.sum()) < MIN_LOUD:
        return 0.0
    ratio = np.log(spectra.mean[loud] / one.mean[loud])
    return float(np.corrcoef(ratio, np.log(comb_power[loud, 0] + FLAT))[0, 1])


def _fit(spectra: Spectra, usable: NDArray[np.bool_], frames: int, ratio: float | None, reach_px: float) -> Fit:
    if ratio is not None:
        return best_displacement(spectra, usable, frames, ratio, reach_px)
    fits = [best_displacement(spectra, usable, frames, r, reach_px) for r in UNKNOWN_RATIOS]
    return free_blur(spectra, usable, frames, min(fits, key=lambda fit: fit.cost))
