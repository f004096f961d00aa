"""The paper's composite, read by maximum likelihood instead of by Hough lines.

The mean of N frames shows N copies of the wall, ``d`` px apart.  Their interference is a comb in the spectrum, and the
comb is fitted, to the composite's spectrum over that of its frames.  Its information is the displacement from frame to
frame without the sign; the blur of the exposures is in the frames as well and is not asked.
"""

from __future__ import annotations

import math

from axialnav.estimators.frames import Frames, frame_stack
from axialnav.estimators.options import check_times
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.spectral.copies import Copies, wall_copies
from axialnav.estimators.spectral.reading import Reading, read_comb
from axialnav.estimators.spectral.standing import columns_stand
from axialnav.estimators.spectral.steps import surely_even
from axialnav.estimators.spectral.verdict import why_unusable

LEAST_FRAMES = 2
LARGEST_PX, SHORTEST_PX = 128.0, 0.45
SHORTEST_CODED_PX = 1.0  # where a codec leaves only the lower frequencies
MIN_MARGIN = 100.0  # noise with a pattern fixed to the camera reaches 70
RIVAL_SHARE = 0.08  # of what motion gains: on a wall that repeats itself, another displacement loses hardly more
MAX_EXCESS, MIN_COMMON = 6.0, 0.85  # frames of one wall, moving evenly, have 1 and 1
MAX_GAP = 50.0  # slow combs fit a missing frame as well or, by chance, better by 20: then the frames are asked
EVEN, EVEN_SHARE = 10.0, 0.005  # least loss by a missing frame that rules it out: absolutely, and of what motion gains
MAX_STANDING, SURE = 0.02, 4.0  # share of the texture that does not move with the wall; standard deviations
PLAIN = 1000.0  # log-likelihood of motion on a wall with texture, be it periodic
MAX_SHARE, MAX_SIGMA_PX = 0.1, 0.5
SYSTEMATIC = 1e-4  # of the displacement: what the smearing of the comb by the window is not known better than


def fit_composite(frames: Frames, frame_period_s: float) -> MotionEstimate:
    """Displacement per frame period from the mean of N frames, without its sign.

    Parameters
    ----------
    frames
        N >= 2 evenly spaced frames, (N, h, w) or a sequence, uint8 or uint16, motion along the rows.
    frame_period_s
        Time from frame to frame [s].

    Returns
    -------
    MotionEstimate
        Refused with a reason where the frames do not tell; displacements from 0.45 px (1 px behind a codec) up to
        128 px or half the picture's width over N - 1, whichever is less.

    Raises
    ------
    FrameError
        If the frames or their period are not what this function takes.
    """
    check_times(frame_period_s, None)
    stack = frame_stack(frames, "x", LEAST_FRAMES, "composite")
    span_s = (len(stack) - 1) * frame_period_s
    reason = why_unusable(stack)
    if reason:
        return refused(reason, signed=False, window_s=span_s, method="composite")
    copies, usable = wall_copies(stack)
    if copies is None:
        return refused(MotionReason.BANDS, signed=False, window_s=span_s, method="composite")
    reading = read_comb(copies, usable, min(LARGEST_PX, stack[0].shape[1] / (2.0 * (len(stack) - 1))))
    reason = why_not(reading, copies, SHORTEST_PX if usable.all() else SHORTEST_CODED_PX)
    if reason:
        return refused(reason, signed=False, window_s=span_s, method="composite")
    displacement = reading.displacement_px
    sigma = math.hypot(reading.sigma_px, SYSTEMATIC * displacement)
    return MotionEstimate(
        displacement, sigma, math.nan, True, MotionReason.GOOD, False, span_s, math.nan, 0.0, "composite"
    )


def why_not(reading: Reading, copies: Copies, shortest_px: float = SHORTEST_PX) -> str:
    """Why a reading is not believed; "" if it is.

    It must beat no motion and every other displacement; be what copies of one wall leave; not be explained better by a
    missing frame, which would change it by a fifth or more; and where the comb does not rule that out, half a ridge
    being in view, the frames themselves must.  What the model does not explain makes likelihoods count less.
    """
    deflated = max(1.0, reading.excess)
    doubtful = not min(reading.still, reading.rival) > MIN_MARGIN * deflated
    if doubtful or not reading.rival > RIVAL_SHARE * reading.still or not math.isfinite(reading.sigma_px):
        return MotionReason.PERIODIC if reading.still > PLAIN * deflated else MotionReason.AMBIGUOUS
    if reading.gap > MAX_GAP * deflated:
        return MotionReason.UNEVEN
    if reading.standing[0] > MAX_STANDING and reading.standing[1] > SURE:
        return MotionReason.BANDS
    if reading.excess > MAX_EXCESS or reading.common < MIN_COMMON:
        return MotionReason.MODEL
    if reading.displacement_px < shortest_px:
        return MotionReason.SHORT
    if reading.sigma_px > min(MAX_SHARE * reading.displacement_px, MAX_SIGMA_PX):
        return MotionReason.SIGMA
    if reading.gap < -EVEN * deflated - EVEN_SHARE * reading.still:
        return ""
    if not surely_even(copies):
        return MotionReason.UNEVEN
    return MotionReason.BANDS if columns_stand(copies, reading.noise) else ""
