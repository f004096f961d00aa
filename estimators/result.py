"""What an image-motion estimate says: a displacement with its sigma, and whether to believe it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum


class MotionReason(StrEnum):
    """Why an estimate was accepted or refused; every member is a sentence for a person."""

    GOOD = "accepted"
    NO_TEXTURE = "no texture: the frames hold the same grey value almost everywhere"
    SATURATED = "too many pixels are saturated: shorten the exposure or lower the gain"
    DARK = "the frames are black: open the shutter longer or light the wall"
    DUPLICATED = "two frames are identical: the camera or its driver delivered one twice"
    AMBIGUOUS = "no displacement stands out from the noise"
    PERIODIC = "the wall repeats itself, several displacements fit alike: pass a prior that tells them apart"
    PRIOR_BORDER = "the best displacement lies at the border of the range that the prior allows"
    PRIOR_OUTSIDE = "the prior expects more motion than these frames can show: they would hardly overlap"
    BANDS = "the row bands disagree: something that does not move with the wall fills too much of the picture"
    STATIC = "only a pattern fixed to the camera repeats from frame to frame"
    UNEVEN = "the frames are not evenly spaced along the motion: one was dropped or repeated, or the camera shook"
    PAIR = "one frame does not fit between its neighbours: dropped, repeated or of something else"
    KAPPA = "exposure blur and displacement contradict each other: wrong period, wrong exposure or a dropped frame"
    SIGMA = "the uncertainty is too large for the displacement to be of use"
    NO_EXPOSURE = "the exposure is not known, and without it the blur of one frame says nothing about speed"
    SHORT = "the blur is too short to be read"
    MODEL = "the spectrum of the picture does not look like a blurred texture"


@dataclass(frozen=True, slots=True)
class MotionEstimate:
    """Displacement of the picture's content per frame period.

    Parameters
    ----------
    displacement_px
        Along the axis, per frame period [px]; signed for ``joint`` (positive: the content moves towards larger pixel
        numbers), >= 0 otherwise; NaN when refused.
    sigma_px
        Standard deviation of ``displacement_px`` [px]; NaN when refused.
    cross_px
        Displacement across the axis per frame period [px]; NaN where the method does not see it.
    accepted
        Whether the value may be used at all.
    reason
        ``"accepted"``, or why not.
    signed
        Whether the sign of ``displacement_px`` is known.
    window_s
        Time over which the displacement is a mean [s]; its middle is the time the estimate belongs to.
    kappa
        Blur length over the one expected from the displacement [-]; NaN where it was not measured (a stream of three
        or more frames measures it once per N - 1 windows). 1 is healthy, 0.5 says that a frame was dropped.
    acceleration_px
        Change of the displacement per frame period [px]; 0 where it was not significant.
    method
        Name of the method.
    bands
        Row bands that agree, and row bands asked; (0, 0) where the method has none.
    t_ns
        Middle of the window [ns]; None where the frames came without stamps.
    note
        What happened to the window (a gap that emptied the ring), or "".
    cross_sigma_px
        Standard deviation of ``cross_px`` [px]; NaN where that is.
    coherence_px
        How far apart parts of the picture may move per frame period and still be taken for one [px]; NaN where the
        method does not tell.
    """

    displacement_px: float
    sigma_px: float
    cross_px: float
    accepted: bool
    reason: str
    signed: bool
    window_s: float
    kappa: float = math.nan
    acceleration_px: float = 0.0
    method: str = "joint"
    bands: tuple[int, int] = (0, 0)
    t_ns: int | None = None
    note: str = ""
    cross_sigma_px: float = math.nan
    coherence_px: float = math.nan

    def __post_init__(self) -> None:
        if self.accepted and not (math.isfinite(self.displacement_px) and 0.0 < self.sigma_px < math.inf):
            raise ValueError(f"an accepted estimate needs a finite displacement and a positive sigma, got {self}")

    def stamped(self, t_ns: int, note: str = "") -> MotionEstimate:
        """The same estimate with the middle of its window and a note."""
        return replace(self, t_ns=t_ns, note=note)


def refused(
    reason: str, *, signed: bool, window_s: float, method: str, kappa: float = math.nan, bands: tuple[int, int] = (0, 0)
) -> MotionEstimate:
    """An estimate that gives no number, and says why."""
    nan = math.nan
    return MotionEstimate(nan, nan, nan, False, reason, signed, window_s, kappa, 0.0, method, bands)
