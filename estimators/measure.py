"""The joint estimate from a full window of frames: search, follow, solve, doubt."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.cohesion import coherence_px
from axialnav.estimators.drift import cross_or_nan
from axialnav.estimators.evenness import (
    Residual,
    residual,
    shake_variance,
    stranger,
    uneven,
)
from axialnav.estimators.integrity import (
    MAX_LOST_STRIPS,
    STATIC_PX,
    Choice,
    choose,
    white,
)
from axialnav.estimators.joint import Fit
from axialnav.estimators.kappa import UNKNOWN, Kappa, blur_ratio
from axialnav.estimators.layout import BANDS, STRIPS
from axialnav.estimators.positions import centred_times
from axialnav.estimators.products import Products
from axialnav.estimators.refine import fit_strips, follow
from axialnav.estimators.result import MotionEstimate, MotionReason, refused
from axialnav.estimators.roll import steady_roll, unrolled
from axialnav.estimators.search import Profiles, search_step
from axialnav.estimators.skew import skew_variance
from axialnav.estimators.spectrum import LAST_FREQUENCY
from axialnav.estimators.stretch import stretch_variance
from axialnav.estimators.window import FrameWindow

Array = NDArray[np.float64]
ENOUGH_BANDS = 3
ENOUGH_FRAMES = 3  # for peaks of bands to be sharp enough to lie on a line
MAX_OUTSIDE_MASS = 0.01
MIN_SIGNIFICANCE = 6.0
MAX_RIVAL_SHARE = 0.75
MAX_SIGMA_PX = 0.3
SURELY_MOVING_PX = 2.0 * STATIC_PX  # slower motion needs the fine detail in which patterns of the pixels are seen
STRETCH_WINDOWS = 4  # a wall's slant changes slowly
PRIOR_SIGMAS = 5.0
PRIOR_MARGIN_PX = 1.0
LEAST_STEPS = 3  # of the search: a top between two neighbours


@dataclass(frozen=True)
class JointOptions:
    """What the joint estimate is told, and which of its doubts are switched on.

    Parameters
    ----------
    frame_period_s, exposure_s
        Period and exposure [s]; the exposure may be unknown (None).
    prior_px
        Expected displacement per frame and its standard deviation [px]; narrows the search and nothing else, so that a
        filter may pass its own prediction without counting it twice.
    consensus
        Ask the row bands one by one.
    evenness
        Refuse windows in which a frame was dropped or repeated.
    kappa
        Measure blur over displacement; refuse two frames for which it is too short.  With more it is only reported:
        a dropped frame shows in their spacing, and a codec that eats fine detail must not silence the estimate.
    """

    frame_period_s: float
    exposure_s: float | None = None
    prior_px: tuple[float, float] | None = None
    consensus: bool = True
    evenness: bool = True
    kappa: bool = True

    @property
    def exposure_ratio(self) -> float:
        """Exposure over period, 0 where it is unknown."""
        return (self.exposure_s or 0.0) / self.frame_period_s


def search_grid(width: int, frames: int, prior_px: tuple[float, float] | None) -> Array:
    """Displacements to look at [px]: as far as half of the content stays in view, or around the prior."""
    reach = min(width / 4.0, width / (2.0 * (frames - 1)))
    low, high = -reach, reach
    if prior_px is not None:
        margin = PRIOR_SIGMAS * prior_px[1] + PRIOR_MARGIN_PX
        low, high = max(low, prior_px[0] - margin), min(high, prior_px[0] + margin)
    step = search_step(frames)
    return _steps(math.floor(low / step), math.ceil(high / step), step)


@lru_cache(maxsize=8)
def _steps(first: int, last: int, step: float) -> Array:
    """Grid of displacements [px], shared: not to be written to."""
    return np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)


def measure_joint(window: FrameWindow, options: JointOptions) -> MotionEstimate:
    """Estimate the displacement of the frames in the window.

    Parameters
    ----------
    window
        At least two frames.
    options
        See :class:`JointOptions`.
    """
    frames = len(window.order)
    span_s = (frames - 1) * options.frame_period_s
    grid = search_grid(window.coarse.band.length, frames, options.prior_px)
    if len(grid) < LEAST_STEPS:
        return refused(MotionReason.PRIOR_OUTSIDE, signed=True, window_s=span_s, method="joint")
    found = window.coarse.profiles(window.order, grid)
    choice, roll_px = choose(found, options.consensus), 0.0
    if options.consensus and frames >= ENOUGH_FRAMES:
        found, choice, roll_px = _levelled(found, choice, window.layout.band_height)
    votes = (int(choice.agree.sum()), BANDS)
    reason = doubt_search(found, choice, options)
    if reason:
        return refused(reason, signed=True, window_s=span_s, method="joint", bands=votes)
    start_px = found.peak_px(choice.index, choice.agree)
    strips = np.repeat(choice.agree, STRIPS // BANDS)
    slow = abs(start_px) < SURELY_MOVING_PX
    reach = LAST_FREQUENCY if slow and window.coarse.repeats(window.order) else found.reach
    drift, products = follow(window, start_px, strips, options.exposure_ratio, reach)
    products = unrolled(products, roll_px * centred_times(frames)) if roll_px else products
    fit, lost = fit_strips(products, start_px, options.exposure_ratio, options.consensus)
    if lost + STRIPS - len(products.rows) > MAX_LOST_STRIPS:
        return refused(MotionReason.BANDS, signed=True, window_s=span_s, method="joint", bands=votes)
    left = residual(fit) if fit is not None else None
    reason = doubt_fit(fit, left, products, options)
    if fit is None or left is None or reason:
        return refused(reason, signed=True, window_s=span_s, method="joint", bands=votes)
    kappa = UNKNOWN
    if options.kappa:
        kappa = blur_ratio(fit, products.band, products.rows.sum(axis=0), options.exposure_ratio)
    skew = skew_variance(fit, products, options.exposure_ratio)
    reason = doubt_pair(kappa, skew) if frames == 2 else ""
    if reason:
        return refused(reason, signed=True, window_s=span_s, method="joint", kappa=kappa.value, bands=votes)
    _compare_halves(window, products, fit)
    cross_px, cross_sigma_px = cross_or_nan(drift)
    return MotionEstimate(
        float(fit.motion[0]),
        math.sqrt(float(fit.covariance[0, 0]) + shake_variance(left, frames) + window.stretch.variance + skew),
        cross_px,
        True,
        MotionReason.GOOD,
        True,
        span_s,
        kappa.value,
        acceleration_px=float(fit.motion[1]) if len(fit.motion) == 2 else 0.0,
        bands=votes,
        cross_sigma_px=cross_sigma_px,
        coherence_px=coherence_px(fit, products),
    )


def _compare_halves(window: FrameWindow, products: Products, fit: Fit) -> None:
    """Ask the halves of the picture how far their displacements are apart, now and then."""
    if window.stretch.stale():
        re, im, offset = window.halves(products.band)
        apart = stretch_variance(re, im, products.band, offset.astype(np.float64), fit)
        window.stretch.renew(apart, max(products.frames - 1, STRETCH_WINDOWS))


def doubt_pair(kappa: Kappa, skew_px2: float) -> str:
    """Why two frames are not believed, of which nothing but their blur tells whether the motion was even."""
    if kappa.alarming:
        return MotionReason.KAPPA
    return MotionReason.SIGMA if skew_px2 > MAX_SIGMA_PX**2 else ""


def _levelled(found: Profiles, choice: Choice, height: Array) -> tuple[Profiles, Choice, float]:
    """Likelihoods and choice without a steady roll, and what it moves a band at height 1 by [px per frame]."""
    roll_px = steady_roll(found, choice.index, height)
    if not roll_px:
        return found, choice, roll_px
    found = found.sheared(roll_px * height)
    return found, choose(found), roll_px


def doubt_fit(fit: Fit | None, left: Residual | None, products: Products, options: JointOptions) -> str:
    """Why the fit is not believed; "" if it is."""
    if fit is None or left is None:
        return MotionReason.AMBIGUOUS
    if options.evenness and stranger(fit, products.rows.sum(axis=0), products.band.omega()):
        return MotionReason.PAIR
    if options.evenness and uneven(fit, left):
        return MotionReason.UNEVEN
    still = abs(float(fit.motion[0])) < STATIC_PX and products.band.reach == LAST_FREQUENCY
    if still and white(fit, products.rows.sum(axis=0)):
        return MotionReason.STATIC
    if not math.sqrt(float(fit.covariance[0, 0]) + shake_variance(left, products.frames)) <= MAX_SIGMA_PX:
        return MotionReason.SIGMA
    return ""


def doubt_search(found: Profiles, choice: Choice, options: JointOptions) -> str:
    """Why the search alone already refuses; "" if it does not."""
    if int(choice.agree.sum()) < ENOUGH_BANDS:
        return MotionReason.BANDS
    near_zero = abs(float(found.grid_px[choice.index])) < STATIC_PX
    if near_zero and int(choice.opposed.sum()) > 1:
        return MotionReason.BANDS
    if found.significance(choice.index, choice.agree) < MIN_SIGNIFICANCE:
        return MotionReason.AMBIGUOUS
    outside_mass, rival_share = found.rivals(choice.index, choice.agree)
    if outside_mass > MAX_OUTSIDE_MASS:
        return MotionReason.AMBIGUOUS
    if rival_share > MAX_RIVAL_SHARE:
        return MotionReason.PERIODIC
    if options.prior_px is not None and choice.index in (0, len(found.grid_px) - 1):
        return MotionReason.PRIOR_BORDER
    return ""
