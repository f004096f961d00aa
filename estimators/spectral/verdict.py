"""Whether frames can be read at all, and whether the blur of a fitted spectrum is to be believed."""

from __future__ import annotations

import math
from itertools import pairwise

from axialnav.estimators.frames import Image, unusable
from axialnav.estimators.result import MotionReason
from axialnav.estimators.spectral.fit import Fit

MIN_MARGIN, MIN_LIGHT = 12.0, 3.0  # noise among all lengths wins by 7 in one picture of fifty
MAX_EXCESS = 10.0  # pictures that are no walls and codecs reach 8
MAX_SHARE, MAX_SIGMA_PX = 0.1, 0.5


def why_unusable(stack: list[Image]) -> str:
    """Why these frames cannot be read (black, saturated, constant, one delivered twice); "" if they can."""
    reason = next((why for why in map(unusable, stack) if why), "")
    if not reason and any(_same(a, b) for a, b in pairwise(stack)):
        reason = MotionReason.DUPLICATED
    return reason


def _same(a: Image, b: Image) -> bool:
    return bool((a[0] == b[0]).all() and (a == b).all())


def why_refused(fit: Fit, shortest_px: float) -> str:
    """Why a fit is not believed; "" if it is.

    It must beat every other length, no blur among them; show light beyond its first dark line; and be longer than what
    can be told from a lens.  What the model does not explain makes likelihoods count less.
    """
    if not (math.isfinite(fit.sigma_px) and math.isfinite(fit.blur_px)):
        return MotionReason.AMBIGUOUS
    deflated = max(1.0, fit.excess)
    if min(fit.margin / deflated - MIN_MARGIN, fit.light / deflated - MIN_LIGHT) < 0.0:
        return MotionReason.AMBIGUOUS
    if fit.excess > MAX_EXCESS:
        return MotionReason.MODEL
    if fit.blur_px < shortest_px:
        return MotionReason.SHORT
    return MotionReason.SIGMA if fit.sigma_px > min(MAX_SHARE * fit.blur_px, MAX_SIGMA_PX) else ""
