r"""Joint maximum likelihood: one displacement from all frames at once.

The frames show one wall, shifted by ``k d``.  Search by inverse transforms of the lag sums (:mod:`.search`), then
windows that follow the wall, then Newton steps on the exact likelihood (:mod:`.positions`) with smooth weights
(:mod:`.texture`).  Learning the common picture from all frames is what lets it reach the Cramer-Rao bound, which
shifting one frame onto another cannot.

Source: likelihood and bound as in Robinson and Milanfar, IEEE Trans. Image Process. 13(9), 2004, and Aguerrebere et
al., arXiv 1602.01541 (2016), for N frames on a line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.positions import (
    climb,
    coherent_power,
    motion_basis,
    parameter_covariance,
    position_gains,
    position_scores,
)
from axialnav.estimators.products import Products
from axialnav.estimators.spectrum import pair_count
from axialnav.estimators.texture import blur_power, matched_weight, sharp_family, smooth_spectra

Array = NDArray[np.float64]
LIMITS = np.array([0.3, 1e-4, 4.0])  # longest Newton step and the one that ends the climb [px], number of steps
MAX_PASSES, SAME_PX = 2, 0.15  # how often weights are computed, and how far no frame may move for them to stay good
BENDS_PX = 0.125 * np.arange(-16, 17)
WINDOW_VARIANCE = 1.6
SHRINKAGE = np.array([6.0, WINDOW_VARIANCE])  # pseudo degrees of freedom, and variance towards which they draw


@dataclass(frozen=True)
class Fit:
    """Result of the Newton steps for one set of strips.

    Parameters
    ----------
    motion
        Displacement per frame [px], and its change per frame if it was fitted, shape (1 or 2,).
    covariance
        Of ``motion``, from the spread of the strips, shape like ``(m, m)``.
    score, information
        Of the frames' positions, per strip, shapes (s, n) and (s, n, n), at ``motion``.
    coherence
        ``sum_f w Re E`` per strip and pair, shape (s, p).
    texture, noise, weight
        Power per row and frame, and the weights used, shape (c, f).
    coherent
        Raw power that moves as fitted, noise taken off, shape (c, f).
    """

    motion: Array
    covariance: Array
    score: Array
    information: Array
    coherence: Array
    texture: Array
    noise: Array
    weight: Array
    coherent: Array


def spectra_at(products: Products, position_px: Array, blur_px: float) -> Array:
    """Smooth texture, smooth noise and raw coherent power per row and frame at these positions, shape (3, c, f)."""
    band, sums = products.band, products.total
    shapes, family, starts = sharp_family(band.first, band.count, band.length)
    pairs, out = np.empty(sums.power.shape, dtype=np.float32), np.empty((3, *sums.power.shape))
    coherent_power(sums.re, sums.im, band.omega(), position_px, pairs)
    blur = blur_power(blur_px, band.frequency())
    smooth_spectra(sums.power, pairs, sums.rows, products.frames, shapes, family, starts, blur, out)
    return out


def evaluate(products: Products, weight: Array, position_px: Array) -> tuple[Array, Array, Array]:
    """Score (s, n), information (s, n, n) and coherence (s, p) of every strip with weights (c, f)."""
    strips, frames = len(products.rows), products.frames
    score, information = np.empty((strips, frames)), np.empty((strips, frames, frames))
    coherence, factor = np.empty((strips, pair_count(frames))), weight.astype(np.float32)
    position_scores(products.re, products.im, factor, products.band.omega(), position_px, score, information, coherence)
    return score, information, coherence


def fit_motion(products: Products, start: Array, exposure_ratio: float, thorough: bool = False) -> Fit | None:
    """Maximise the likelihood of a displacement (and its change, if ``start`` has two numbers).

    Parameters
    ----------
    products
        Products of windows that follow the wall, the strips to be used.
    start
        Displacement per frame [px] (and its change), within half a pixel of the answer, shape (1 or 2,).
    exposure_ratio
        Exposure over frame period; 0 where it is unknown (it only shapes the weights).
    thorough
        Compute the weights anew at the first answer even if it lies so near the start that it will hardly change.

    Returns
    -------
    Fit or None
        None if the likelihood has no maximum there.
    """
    basis = motion_basis(products.frames, len(start) == 2)
    motion = np.array(start, dtype=np.float64)
    for _ in range(MAX_PASSES):
        at = basis @ motion
        spectra = spectra_at(products, at - products.offset_px, exposure_ratio * abs(float(motion[0])))
        weight = matched_weight(spectra[0], spectra[1], products.frames) * products.independent
        if not _climbed(products, weight, basis, motion):
            return None
        if not thorough and float(np.abs(basis @ motion - at).max()) < SAME_PX:
            break
    return _fit_at(products, weight, basis, motion, (spectra[0], spectra[1], weight, spectra[2]))


def refit_motion(weighted: Products, start: Array, known: Fit) -> Fit | None:
    """:func:`fit_motion` with the spectra and weights of a fit to nearly the same products, ``weighted`` by it."""
    basis, motion = motion_basis(weighted.frames, len(start) == 2), np.array(start, dtype=np.float64)
    one = np.ones((1, weighted.band.count))
    if not _climbed(weighted, one, basis, motion):
        return None
    return _fit_at(weighted, one, basis, motion, (known.texture, known.noise, known.weight, known.coherent))


def _climbed(products: Products, weight: Array, basis: Array, motion: Array) -> bool:
    """Newton steps on ``motion``, in place; whether the likelihood has a maximum there."""
    sums, narrow = products.total, weight.astype(np.float32)
    return climb(sums.re, sums.im, narrow, products.band.omega(), basis, products.offset_px, motion, LIMITS)


def _fit_at(
    products: Products, weight: Array, basis: Array, motion: Array, spectra: tuple[Array, Array, Array, Array]
) -> Fit | None:
    score, information, coherence = evaluate(products, weight, basis @ motion - products.offset_px)
    covariance = np.empty((len(motion), len(motion)))
    if not parameter_covariance(score, information, basis, SHRINKAGE, covariance):
        return None
    return Fit(motion, covariance, score, information, coherence, *spectra)


def best_bend(products: Products, fit: Fit) -> float:
    """Change of the displacement per frame [px] from a coarse look around a fit without one."""
    weight = fit.weight if len(fit.weight) == products.re.shape[1] else np.ones((1, products.band.count))
    basis, sums = motion_basis(products.frames, True), products.total
    position = basis[:, 0] * fit.motion[0] + BENDS_PX[:, None] * basis[:, 1] - products.offset_px
    gain = np.empty(len(BENDS_PX))
    position_gains(sums.re, sums.im, weight.astype(np.float32), products.band.omega(), position, gain)
    return float(BENDS_PX[int(np.argmax(gain))])
