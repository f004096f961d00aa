r"""How far apart two parts of the picture may move and still be taken for one.

A part that moves by :math:`\delta` per frame beside the fit pulls at it with the derivative of its share of the
likelihood,

.. math::
    \psi(\delta) = \sum_\omega w(\omega) \, q(\omega) \, \omega \sum_{m=1}^{N-1} (N - m) \, m \sin(m \omega \delta)

with the weights w and the power q of the texture.  Near 0 it pulls like a spring; beyond the offset at which it pulls
the hardest it lets go.  That offset is what one who predicts the motion of a picture has to know whose columns do not
all move alike: fine texture in good light holds together less than half of what a nearly blank wall does.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import Fit
from axialnav.estimators.products import Products
from axialnav.estimators.spectrum import Band
from axialnav.estimators.whittle import parabola

Array = NDArray[np.float64]
OFFSETS, STEP_PX = 48, 0.2  # the step is that of the outermost frames
COARSEST = 480  # frequencies that are enough; those of long windows are taken together


def coherence_px(fit: Fit, products: Products) -> float:
    """Offset [px per frame] at which a part of the picture pulls the hardest at a fit to these products."""
    power = products.rows.sum(axis=0) @ (fit.weight * fit.texture)
    size = max(1, products.band.length // COARSEST)
    power = power[: len(power) // size * size].reshape(-1, size).sum(axis=1)
    offset, basis = _pulls(products.band.length, size, products.frames)
    pull = basis[:, : len(power)] @ power
    k = int(np.argmax(pull))
    if not 0 < k < OFFSETS - 1:
        return float(offset[k])
    return parabola(offset[k - 1 : k + 2], -pull[k - 1 : k + 2])[0]


@lru_cache(maxsize=64)
def _pulls(length: int, size: int, frames: int) -> tuple[Array, Array]:
    """Offsets (d,) [px per frame] and the pull of unit power there at every ``size`` frequencies (d, g).

    Not to be written to.
    """
    omega = Band(length).omega()
    omega = omega[: len(omega) // size * size].reshape(-1, size).mean(axis=1)
    offset = np.arange(1, OFFSETS + 1) * STEP_PX / (frames - 1)
    angle = np.outer(offset, omega)
    lags = range(1, frames)
    return offset, omega * sum((frames - lag) * lag * np.sin(lag * angle) for lag in lags)
