"""The paper's composite, read by maximum likelihood instead of by Hough lines.

The mean of N frames shows N copies of the wall, ``d`` px apart.  Their interference is a comb in the spectrum, and the
comb is fitted.  Its information is the displacement from frame to frame without the sign; the blur of the exposures
is only its envelope.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Frames, check_times, frame_stack
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.rows import bin_height
from axialnav.estimators.spectral.blocks import block_notches, blocky
from axialnav.estimators.spectral.fit import Fit, best_displacement, free_blur
from axialnav.estimators.spectral.picture import Spectra, composite_rows
from axialnav.estimators.spectral.strips import wall_spectra
from axialnav.estimators.spectral.verdict import MAX_CODED_EXCESS, MAX_EXCESS, why_refused, why_unusable
from axialnav.estimators.spectral.whittle import SHIFT

LEAST_FRAMES = 2
LARGEST_PX = 128.0
UNKNOWN_RATIOS = (0.05, 0.3, 0.7)
SHORTEST_PX = 0.45
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
    stack = frame_stack(frames, "x", LEAST_FRAMES)
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
    coded = blocky(rows)
    if coded:
        usable = block_notches(spectra.frequency, spectra.length)
    reach = min(LARGEST_PX, width / (2.0 * (len(stack) - 1)))
    ratio = None if exposure_s is None else exposure_s / frame_period_s
    fit = _fit(spectra, usable, len(stack), ratio, reach)
    displacement = float(fit.theta[SHIFT])
    reason = why_refused(fit, displacement, SHORTEST_PX, MAX_CODED_EXCESS if coded else MAX_EXCESS)
    if reason:
        return refused(reason, signed=False, window_s=span_s, method="composite")
    sigma = math.hypot(fit.sigma_px, SYSTEMATIC * displacement)
    return MotionEstimate(
        displacement, sigma, math.nan, True, MotionReason.GOOD, False, span_s, math.nan, 0.0, "composite"
    )


def _fit(spectra: Spectra, usable: NDArray[np.bool_], frames: int, ratio: float | None, reach_px: float) -> Fit:
    if ratio is not None:
        return best_displacement(spectra, usable, frames, ratio, reach_px)
    fits = [best_displacement(spectra, usable, frames, r, reach_px) for r in UNKNOWN_RATIOS]
    return free_blur(spectra, usable, frames, min(fits, key=lambda fit: fit.cost))
