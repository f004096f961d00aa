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
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
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
    weight: Plane
    coherent: Array


def spectra_at(products: Products, position_px: Array, blur_px: float) -> tuple[Array, Plane]:
    """Smooth texture, smooth noise and raw coherent power per row and frame (3, c, f), and the weights (c, f)."""
    sums, omega = products.total, products.band.omega()
    family = sharp_family(products.band.first, products.band.count, products.band.length)
    out, weight = np.empty((3, *sums.power.shape)), np.empty_like(sums.power)
    _spectra(
        sums.re, sums.im, sums.power, sums.rows, omega, position_px, blur_px, products.independent, *family, out, weight
    )
    return out, weight


@kernel
def _spectra(
    re: Plane,
    im: Plane,
    power: Plane,
    rows: Array,
    omega: Array,
    position: Array,
    blur_px: float,
    independent: float,
    shapes: Array,
    family: Array,
    starts: Index,
    out: Array,
    weight: Plane,
) -> None:
    """See :func:`spectra_at`."""
    pairs, blur = np.empty(power.shape, dtype=np.float32), np.empty(omega.shape[0])
    coherent_power(re, im, omega, position, pairs)
    blur_power(blur_px, omega, blur)
    smooth_spectra(power, pairs, rows, position.shape[0], shapes, family, starts, blur, out)
    for c in range(weight.shape[0]):
        matched_weight(out[0, c], out[1, c], position.shape[0], independent, weight[c])


def evaluate(products: Products, weight: Plane, position_px: Array) -> tuple[Array, Array, Array]:
    """Score (s, n), information (s, n, n) and coherence (s, p) of every strip with weights (c, f)."""
    strips, frames = len(products.rows), products.frames
    score, information = np.empty((strips, frames)), np.empty((strips, frames, frames))
    coherence = np.empty((strips, pair_count(frames)))
    omega, place = products.band.omega(), products.place
    position_scores(products.re, products.im, place, weight, omega, position_px, score, information, coherence)
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
        spectra, weight = spectra_at(products, at - products.offset_px, exposure_ratio * abs(float(motion[0])))
        if not _climbed(products, weight, basis, motion):
            return None
        if not thorough and float(np.abs(basis @ motion - at).max()) < SAME_PX:
            break
    return _fit_at(products, weight, basis, motion, (spectra[0], spectra[1], weight, spectra[2]))


def refit_motion(weighted: Products, start: Array, known: Fit) -> Fit | None:
    """:func:`fit_motion` with the spectra and weights of a fit to nearly the same products, ``weighted`` by it."""
    basis, motion = motion_basis(weighted.frames, len(start) == 2), np.array(start, dtype=np.float64)
    one = np.ones((1, weighted.band.count), dtype=np.float32)
    if not _climbed(weighted, one, basis, motion):
        return None
    return _fit_at(weighted, one, basis, motion, (known.texture, known.noise, known.weight, known.coherent))


def _climbed(products: Products, weight: Plane, basis: Array, motion: Array) -> bool:
    """Newton steps on ``motion``, in place; whether the likelihood has a maximum there."""
    sums = products.total
    return climb(sums.re, sums.im, weight, products.band.omega(), basis, products.offset_px, motion, LIMITS)


def _fit_at(
    products: Products, weight: Plane, basis: Array, motion: Array, spectra: tuple[Array, Array, Plane, Array]
) -> Fit | None:
    score, information, coherence = evaluate(products, weight, basis @ motion - products.offset_px)
    covariance = np.empty((len(motion), len(motion)))
    if not parameter_covariance(score, information, basis, SHRINKAGE, covariance):
        return None
    return Fit(motion, covariance, score, information, coherence, *spectra)


def best_bend(products: Products, fit: Fit) -> float:
    """Change of the displacement per frame [px] from a coarse look around a fit without one."""
    known = len(fit.weight) == products.re.shape[1]
    weight = fit.weight if known else np.ones((1, products.band.count), dtype=np.float32)
    basis, sums = motion_basis(products.frames, True), products.total
    position = basis[:, 0] * fit.motion[0] + BENDS_PX[:, None] * basis[:, 1] - products.offset_px
    gain = np.empty(len(BENDS_PX))
    position_gains(sums.re, sums.im, weight, products.band.omega(), position, gain)
    return float(BENDS_PX[int(np.argmax(gain))])
