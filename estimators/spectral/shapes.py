r"""What the power spectra of a blurred, textured wall and of its copies are made of.

.. math:: M(f) = q(f) \, \mathrm{sinc}^2(f l) + s

with the blur l of one exposure.  The texture is a power law behind a lens, bent a little: :math:`\log q` is linear in
the columns of ``smooth_basis``.  N copies of it, d px apart, leave a comb, ``ratio.py``; two copies further apart than
the window is long do not interfere.

Source: a power law times sinc fitted to one blurred picture is due to Oliveira, Figueiredo and Bioucas-Dias, IEEE
Trans. Image Process. 23(1), 2014.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
SMALL_ANGLE, SAME_STEP = 1e-4, 1e-9
MIDDLE_FREQUENCY, TOP_FREQUENCY = 0.05, 0.45  # cycles per pixel


def smooth_basis(frequency: Array) -> Array:
    """Columns of ``log q``: level, slope and bend over ``log f``, lens; shape (f, 4)."""
    x = np.log(frequency / MIDDLE_FREQUENCY)
    return np.column_stack([np.ones_like(x), x, x * x, (frequency / TOP_FREQUENCY) ** 2])


@lru_cache(maxsize=64)
def pair_lags(times: Sequence[int]) -> Array:
    """Numbers of pairs of frames at every lag from 0 on, each pair twice, for frames at these whole ``times``."""
    distance = np.abs(np.subtract.outer(times, times)).ravel()
    return np.bincount(distance).astype(np.float64)


@kernel
def exposure_power(frequency: Array, blur_px: float, out: Array) -> None:
    """``sinc(f l)^2`` and its derivative to l at every frequency, columns 0 and 1 of ``out``."""
    step = frequency[1] - frequency[0] if frequency.shape[0] > 1 else 0.0
    step_re, step_im = math.cos(math.pi * step * blur_px), math.sin(math.pi * step * blur_px)
    cosine, sine, before = 1.0, 0.0, -math.inf
    for j in range(frequency.shape[0]):
        x = max(math.pi * frequency[j] * blur_px, SMALL_ANGLE)
        if x > SMALL_ANGLE and abs(frequency[j] - before - step) < SAME_STEP * step:  # a turn costs a tenth of a cosine
            cosine, sine = cosine * step_re - sine * step_im, cosine * step_im + sine * step_re
        else:
            cosine, sine = math.cos(x), math.sin(x)
        before = frequency[j] if x > SMALL_ANGLE else -math.inf
        sinc = sine / x
        out[j, 0] = sinc * sinc
        out[j, 1] = 2.0 * math.pi * frequency[j] * sinc * (cosine - sinc) / x


@kernel
def copies(displacement_px: float, lags: Array, window: Array) -> Array:
    """Share ``A(m d)`` times the number of pairs at lag m, over the number of all pairs, shape (m,)."""
    share = np.zeros(lags.shape[0])
    share[0] = lags[0]
    for m in range(1, lags.shape[0]):
        lag = m * displacement_px
        k = int(lag)
        if k + 1 < window.shape[0]:
            share[m] = lags[m] * (window[k] + (lag - k) * (window[k + 1] - window[k]))
    return share / np.sum(lags)
