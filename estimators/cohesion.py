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
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
OFFSETS, STEP_PX = 48, 0.2  # the step is that of the outermost frames
COARSEST = 240  # frequencies that are enough; those of long windows are taken together


def coherence_px(fit: Fit, products: Products) -> float:
    """Offset [px per frame] at which a part of the picture pulls the hardest at a fit to these products."""
    size = max(1, products.band.length // COARSEST)
    offset, basis = _pulls(products.band.length, size, products.frames)
    pull = np.empty(OFFSETS)
    _pull(products.rows, fit.weight, fit.texture, size, basis, pull)
    k = int(np.argmax(pull))
    if not 0 < k < OFFSETS - 1:
        return float(offset[k])
    return parabola(offset[k - 1 : k + 2], -pull[k - 1 : k + 2])[0]


@kernel
def _pull(rows: Array, weight: Plane, texture: Array, size: int, basis: Array, pull: Array) -> None:
    """Pull (d,) of weighted texture (c, f) in ``rows`` (s, c) rows; ``basis`` (g, d) is that of unit power."""
    pull[:] = 0.0
    for g in range(weight.shape[1] // size):
        power = 0.0
        for c in range(weight.shape[0]):
            many = np.sum(rows[:, c])
            for f in range(g * size, (g + 1) * size):
                power += many * weight[c, f] * texture[c, f]
        _add_weighted(basis[g], power, pull)


@kernel
def _add_weighted(line: Array, factor: float, total: Array) -> None:
    for d in range(total.shape[0]):
        total[d] += factor * line[d]


@lru_cache(maxsize=64)
def _pulls(length: int, size: int, frames: int) -> tuple[Array, Array]:
    """Offsets (d,) [px per frame] and the pull of unit power there at every ``size`` frequencies (g, d).

    Not to be written to.
    """
    omega = Band(length).omega()
    omega = omega[: len(omega) // size * size].reshape(-1, size).mean(axis=1)
    offset = np.arange(1, OFFSETS + 1) * STEP_PX / (frames - 1)
    angle = np.outer(omega, offset)
    lags = range(1, frames)
    return offset, omega[:, None] * sum((frames - lag) * lag * np.sin(lag * angle) for lag in lags)
