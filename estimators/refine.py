"""From the grid point of the search to a fit: follow the wall, level the camera, leave out what is not wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.drift import Drift
from axialnav.estimators.evenness import SURE_BEND, bend_significance
from axialnav.estimators.integrity import MAX_LOST_STRIPS, disturbed, quarrelling
from axialnav.estimators.joint import Fit, best_bend, fit_motion
from axialnav.estimators.pattern import SURE, pattern_power, without_pattern
from axialnav.estimators.products import Products
from axialnav.estimators.roll import roll_step, unrolled
from axialnav.estimators.window import FrameWindow

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MAX_ROLL_STEPS = 4
DRIFT_SHARE = 1.0  # of a bin: drift over the whole window that is worth following
FAST_DRIFT_PX = 12.0  # per frame: faster than anything that flies beside a wall; bins that hide it need no look
UNMOVED = Drift(0.0, False)


def follow(window: FrameWindow, start_px: float, strips: Mask, exposure_ratio: float) -> tuple[Drift, Products]:
    """Products of some strips from windows that follow the wall, and the drift they follow across the rows.

    A drift with which the strips agree less is that of something else (a slanting cable, say) and is not followed.
    """
    harmless_px = DRIFT_SHARE * window.bin_height / (len(window.order) - 1)
    drift = UNMOVED
    if harmless_px < FAST_DRIFT_PX:
        drift = window.drift.measure([window.images[slot] for slot in window.order], start_px)
    products = window.following(start_px).selected(strips)
    if abs(drift.cross_px) < harmless_px:
        return drift, products
    still = _spread(products, start_px, exposure_ratio)
    products = window.following(start_px, drift.cross_px).selected(strips)
    if _spread(products, start_px, exposure_ratio) < still:
        return drift, products
    return UNMOVED, window.following(start_px).selected(strips)


def _spread(products: Products, start_px: float, exposure_ratio: float) -> float:
    """Variance of the displacement [px^2] as the strips show it; infinite if there is no fit."""
    fit = fit_motion(products, np.array([start_px]), exposure_ratio, passes=1)
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
    fit = fit_frames(products, np.array([start_px]), exposure_ratio, passes=2)
    lost = 0
    for doubt in (_undisturbed, _unrolled) if consensus else ():
        if fit is None:
            return fit, lost
        products, fit, bad = doubt(products, fit, exposure_ratio)
        lost += int(bad.sum())
        if fit is None or lost > MAX_LOST_STRIPS:
            return fit, lost
        if bad.any():
            products = products.selected(~bad)
            fit = fit_frames(products, fit.motion, exposure_ratio)
    products, fit = _level(products, fit, exposure_ratio)
    products, fit = _unpatterned(products, fit, exposure_ratio)
    bad = quarrelling(fit, products) if fit is not None and consensus else np.zeros(0, dtype=np.bool_)
    lost += int(bad.sum())
    if fit is None or not bad.any() or lost > MAX_LOST_STRIPS:
        return fit, lost
    return fit_frames(products.selected(~bad), fit.motion, exposure_ratio), lost


def _undisturbed(products: Products, fit: Fit, exposure_ratio: float) -> tuple[Products, Fit | None, Mask]:
    """Products and fit as they are, and the strips that something fixed to the camera disturbs."""
    return products, fit, disturbed(fit, products)


def _unrolled(products: Products, fit: Fit, exposure_ratio: float) -> tuple[Products, Fit | None, Mask]:
    """Strips that quarrel with the others; if a roll explains them, none, and products and fit without it."""
    bad = quarrelling(fit, products)
    if not bad.any() or roll_step(fit, products.height) is None:
        return products, fit, bad
    levelled, level = _level(products, fit, exposure_ratio)
    explained = level is not None and not quarrelling(level, levelled).any()
    if explained or int(bad.sum()) > MAX_LOST_STRIPS:
        return levelled, level, np.zeros_like(bad)
    return products, fit, bad


def _level(products: Products, fit: Fit | None, exposure_ratio: float) -> tuple[Products, Fit | None]:
    """Take out the camera's roll as long as it shows."""
    for _ in range(MAX_ROLL_STEPS):
        shift = roll_step(fit, products.height) if fit is not None else None
        if fit is None or shift is None:
            break
        products = unrolled(products, shift)
        fit = fit_frames(products, fit.motion, exposure_ratio)
    return products, fit


def _unpatterned(products: Products, fit: Fit | None, exposure_ratio: float) -> tuple[Products, Fit | None]:
    """Take out a white pattern of the pixels if there is one."""
    if fit is None:
        return products, fit
    power, sigma = pattern_power(products, fit)
    if power <= SURE * sigma:
        return products, fit
    products = without_pattern(products, power)
    return products, fit_frames(products, fit.motion, exposure_ratio)


def fit_frames(products: Products, start: Array, exposure_ratio: float, passes: int = 1) -> Fit | None:
    """Displacement alone, or with an acceleration if that is significant.

    ``start`` is that of :func:`~axialnav.estimators.joint.fit_motion`; an acceleration in it was significant in a fit
    to nearly the same products, and is fitted at once.
    """
    if len(start) == 2:
        fit = fit_motion(products, start, exposure_ratio, passes)
        if fit is not None and bend_significance(fit) >= SURE_BEND:
            return fit
    fit = fit_motion(products, start[:1], exposure_ratio, passes)
    if fit is None or bend_significance(fit) < SURE_BEND:
        return fit
    bent = np.array([float(fit.motion[0]), best_bend(products, fit)])
    return fit_motion(products, bent, exposure_ratio) or fit
