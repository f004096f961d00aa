"""From the grid point of the search to a fit: follow the wall, level the camera, leave out what is not wall."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.drift import FAST_DRIFT_PX, Drift, hidden_drift_px
from axialnav.estimators.evenness import SURE_BEND, bend_significance, residual, short_bend
from axialnav.estimators.integrity import MAX_LOST_STRIPS, disturbed, quarrelling
from axialnav.estimators.joint import Fit, best_bend, fit_motion, refit_motion
from axialnav.estimators.pattern import SURE, pattern_power, without_pattern
from axialnav.estimators.products import Products
from axialnav.estimators.roll import roll_step, unrolled
from axialnav.estimators.window import FrameWindow

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MAX_ROLL_STEPS = 4
ENOUGH_FRAMES = 3  # to believe that what was cut out is an object
CLEARLY = 1.5  # ratio of two variances that ten strips hardly show by chance
JUMP_BINS = 2.0  # a drift that changes by more from window to window is asked again
SLOW_PX = 2.0  # per frame: below, what repeats is weighed anew without the pattern
UNMOVED = Drift(0.0, False)


def follow(
    window: FrameWindow, start_px: float, strips: Mask, exposure_ratio: float, reach: float
) -> tuple[Drift, Products]:
    """Products of some strips from windows that follow the wall, and the drift they follow across the rows.

    A drift with which the strips agree less is that of something else (a slanting cable, say) and is not followed.
    ``reach`` is the highest frequency that tells of the motion [cycles/px].  Strips that follow something else take
    part as well where an object was found and cut out: what is left in them is asked once more.

    Strips are asked when a drift begins, when it jumps, and now and then; in between the window remembers the answer.
    """

    def cut(drift_px: float) -> Products:
        """Products of windows that follow a drift [px per frame]."""
        products = window.following(start_px, drift_px, reach)
        return products.selected(strips | window.cleared if len(window.order) >= ENOUGH_FRAMES else strips)

    hidden_px, steps = hidden_drift_px(window.bin_height, len(window.order)), len(window.order) - 1
    harmless_px = hidden_px * steps / (steps + steps % 2)  # of two frames one keeps its place, the other moves twice
    drift = UNMOVED
    if hidden_px < FAST_DRIFT_PX:
        drift = window.drift(start_px)
    belief = window.drift_belief
    if abs(drift.cross_px) < harmless_px:
        belief.note(drift.cross_px)
        return drift, cut(0.0)
    if not belief.holds(drift.cross_px, JUMP_BINS * harmless_px):
        products = cut(0.0)
        still = _spread(products, start_px, exposure_ratio)
        products = cut(drift.cross_px)
        belief.renew(_spread(products, start_px, exposure_ratio) < CLEARLY * still)
        if belief.good:
            return drift, products
    if belief.good:
        return drift, cut(drift.cross_px)
    return UNMOVED, cut(0.0)


def _spread(products: Products, start_px: float, exposure_ratio: float) -> float:
    """Variance of the displacement [px^2] as the strips show it; infinite if there is no fit."""
    fit = fit_motion(products, np.array([start_px]), exposure_ratio)
    return float(fit.covariance[0, 0]) if fit is not None else np.inf


def fit_strips(products: Products, start_px: float, exposure_ratio: float, consensus: bool) -> tuple[Fit | None, int]:
    """Fit, leave out strips that are disturbed or quarrel with the others, fit again; also how many were left out.

    Parameters
    ----------
    products
        Products of windows that follow the wall.
    start_px
        Displacement per frame [px], to half a pixel.
    exposure_ratio
        Exposure over period.
    consensus
        Whether strips may be left out.
    """
    fit = fit_frames(products, np.array([start_px]), exposure_ratio)
    lost = 0
    if fit is not None and consensus:
        bad = disturbed(fit, products)
        lost = int(bad.sum())
        if bad.any() and lost <= MAX_LOST_STRIPS:
            products = products.selected(~bad)
            fit = fit_frames(products, fit.motion, exposure_ratio)
    if fit is None or lost > MAX_LOST_STRIPS:
        return fit, lost
    power, sigma = pattern_power(products, fit)
    if power <= SURE * sigma:
        if roll_step(fit, products.height) is None and not (consensus and quarrelling(fit, products).any()):
            return fit, lost
        level, quarrels = _levelled(products.weighted(fit.weight), fit, consensus)
        return level, lost + quarrels
    products, start = without_pattern(products, power), fit.motion
    if abs(float(start[0])) < SLOW_PX:
        fit = fit_frames(products, start, exposure_ratio)
        if fit is None:
            return None, lost
    weighted = products.weighted(fit.weight)
    clean = refit_frames(weighted, start, fit)
    if clean is None:
        return None, lost
    level, quarrels = _levelled(weighted, clean, consensus)
    return level, lost + quarrels


def _levelled(weighted: Products, fit: Fit, consensus: bool) -> tuple[Fit | None, int]:
    """The fit without the camera's roll and without strips that quarrel, and the number of these.

    Strips that quarrel with the others stay if a roll explains them.
    """
    bad = quarrelling(fit, weighted)
    lost = 0
    if consensus and bad.any():
        products, level = _unrolled(weighted, fit)
        lost = int(bad.sum())
        if products is not weighted and level is not None:
            lost = 0 if lost > MAX_LOST_STRIPS or not quarrelling(level, products).any() else lost
        if lost:
            if lost > MAX_LOST_STRIPS:
                return level, lost
            products = weighted.selected(~bad)
            again = refit_frames(products, fit.motion, fit)
            if again is None:
                return None, lost
            products, level = _unrolled(products, again)
    else:
        products, level = _unrolled(weighted, fit)
    if level is None or not consensus:
        return level, lost
    bad = quarrelling(level, products)
    lost += int(bad.sum())
    if not bad.any() or lost > MAX_LOST_STRIPS:
        return level, lost
    return refit_frames(products.selected(~bad), level.motion, level), lost


def _unrolled(weighted: Products, fit: Fit) -> tuple[Products, Fit | None]:
    """Products and fit without the camera's roll, taken out as long as it shows; the same ones if it never does."""
    products, level = weighted, fit
    for _ in range(MAX_ROLL_STEPS):
        shift = roll_step(level, products.height)
        if shift is None:
            break
        products = unrolled(products, shift)
        again = refit_frames(products, level.motion, level)
        if again is None:
            return products, None
        level = again
    return products, level


def fit_frames(products: Products, start: Array, exposure_ratio: float) -> Fit | None:
    """Displacement alone, or with an acceleration if that is significant.

    ``start`` is that of :func:`~axialnav.estimators.joint.fit_motion`; an acceleration in it was significant in a fit
    to nearly the same products, and is fitted at once.
    """
    return _with_bend(products, start, partial(fit_motion, products, exposure_ratio=exposure_ratio))


def refit_frames(weighted: Products, start: Array, known: Fit) -> Fit | None:
    """:func:`fit_frames` with the spectra and weights of a fit to nearly the same products, ``weighted`` by it."""
    return _with_bend(weighted, start, lambda motion, thorough=False: refit_motion(weighted, motion, known))


def _with_bend(products: Products, start: Array, solve: Callable[..., Fit | None]) -> Fit | None:
    if len(start) == 2:
        fit = solve(start)
        if fit is not None and bend_significance(fit) >= SURE_BEND:
            return fit
    fit = solve(start[:1])
    if fit is None or bend_significance(fit) < SURE_BEND:
        return fit
    short = short_bend(fit)
    bent = solve(short) if short is not None else None
    if bent is None or residual(bent).significant:  # a missing frame looks like any bend, and best like a strong one
        bent = solve(np.array([float(fit.motion[0]), best_bend(products, fit)]), thorough=True)
    return bent or fit
