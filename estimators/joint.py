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


def fit_motion(products: Products, start: Array, exposure_ratio: float, passes: int = 2) -> Fit | None:
    """Maximise the likelihood of a displacement (and its change, if ``start`` has two numbers).

    Parameters
    ----------
    products
        Products of windows that follow the wall, the strips to be used.
    start
        Displacement per frame [px] (and its change), within half a pixel of the answer, shape (1 or 2,).
    exposure_ratio
        Exposure over frame period; 0 where it is unknown (it only shapes the weights).
    passes
        How often the weights are computed anew.

    Returns
    -------
    Fit or None
        None if the likelihood has no maximum there.
    """
    basis = motion_basis(products.frames, len(start) == 2)
    motion, sums, omega = np.array(start, dtype=np.float64), products.total, products.band.omega()
    for _ in range(passes):
        position = basis @ motion - products.offset_px
        texture, noise, coherent = spectra_at(products, position, exposure_ratio * abs(float(motion[0])))
        weight = matched_weight(texture, noise, products.frames) * products.independent
        if not climb(sums.re, sums.im, weight.astype(np.float32), omega, basis, products.offset_px, motion, LIMITS):
            return None
    score, information, coherence = evaluate(products, weight, basis @ motion - products.offset_px)
    covariance = np.empty((len(motion), len(motion)))
    if not parameter_covariance(score, information, basis, SHRINKAGE, covariance):
        return None
    return Fit(motion, covariance, score, information, coherence, texture, noise, weight, coherent)


def best_bend(products: Products, fit: Fit) -> float:
    """Change of the displacement per frame [px] from a coarse look around a fit without one."""
    basis, sums = motion_basis(products.frames, True), products.total
    position = basis[:, 0] * fit.motion[0] + BENDS_PX[:, None] * basis[:, 1] - products.offset_px
    gain = np.empty(len(BENDS_PX))
    position_gains(sums.re, sums.im, fit.weight.astype(np.float32), products.band.omega(), position, gain)
    return float(BENDS_PX[int(np.argmax(gain))])
