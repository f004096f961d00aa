r"""Whether coarse and fine texture of two frames tell of the same displacement.

A camera that changes its speed within an exposure draws every point into a streak that is brighter where it was slow.
Two such streaks that differ in skewness do not only shift the phases of the cross-spectrum but bend them,

.. math:: \varphi(\omega) = \omega d - \omega^3 (\kappa_3' - \kappa_3) / 6 + \dots

with the third cumulants of the two paths: fine texture follows the bright ends, coarse texture the means.  Three and
more frames are asked for an even motion; of two, only this tells that there was none.

Source: cumulants of the path as Taylor coefficients of the logarithm of its transfer function, as in any text on
characteristic functions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import SHRINKAGE, WINDOW_VARIANCE, Fit, evaluate
from axialnav.estimators.positions import motion_basis
from axialnav.estimators.products import Products

Array = NDArray[np.float64]
USUAL = 3.0  # standard deviations by which both differ by chance
SHORT_PX = 1.0  # streaks have no shape


def skew_variance(fit: Fit, products: Products, exposure_ratio: float) -> float:
    """Variance that the difference between coarse and fine texture adds to the displacement of a pair [px^2].

    Both have half of the information.  0 for more than two frames, for
    short exposures, and where both differ by no more than by chance.

    Parameters
    ----------
    fit
        Of the pair.
    products
        Of the windows it was fitted to, all strips.
    exposure_ratio
        Exposure over frame period; 0 where it is unknown.
    """
    if products.frames != 2 or 0.0 < exposure_ratio * abs(float(fit.motion[0])) < SHORT_PX:
        return 0.0
    omega = products.band.omega()
    told = np.cumsum(np.sum(fit.weight * np.maximum(fit.coherent, 0.0), axis=0) * omega**2)
    coarse = told < 0.5 * told[-1]
    basis = motion_basis(2, False)[:, 0]
    position = basis * float(fit.motion[0]) - products.offset_px
    parts = [_influence(fit, products, position, basis, half) for half in (coarse, ~coarse)]
    if any(own <= 0.0 for _, own in parts):
        return 0.0
    apart = parts[0][0] - parts[1][0]
    strips = len(apart)
    freedom, prior = strips - 1, WINDOW_VARIANCE * sum(1.0 / own for _, own in parts)
    spread = strips * float(np.sum((apart - apart.mean()) ** 2))
    chance = float((spread + SHRINKAGE[0] * prior) / (freedom + SHRINKAGE[0]))
    return max(0.0, float(apart.sum()) ** 2 - USUAL**2 * chance)


def _influence(
    fit: Fit, products: Products, position: Array, basis: Array, half: NDArray[np.bool_]
) -> tuple[Array, float]:
    """Every strip's part (s,) in the displacement [px] that some of the frequencies tell, and their information."""
    score, information, _ = evaluate(products, fit.weight * half, position)
    own = float(basis @ information.sum(axis=0) @ basis)
    return score @ basis / own if own > 0.0 else score @ basis, own
