r"""The power spectrum of a blurred, textured wall.

.. math:: M(f) = q(f) \, G(f; d, l) + s, \qquad
    G = \mathrm{sinc}^2(f l) \, \frac{1}{N^2} \Big[ N + 2 \sum_{m=1}^{N-1} (N - m) \, A(m d) \cos(2 \pi m f d) \Big]

with the displacement d per frame period, the blur l of one exposure and the N frames of the composite.  With A = 1 the
bracket is the squared Dirichlet kernel :math:`\sin^2(\pi N f d) / \sin^2(\pi f d)`: the comb that N shifted copies of
one picture leave.  A, the autocorrelation of the window, is what a window of finite length makes of it: two copies
further apart than the window is long do not interfere.  One frame is N = 1.  Where frames are not evenly spaced the
numbers of pairs at every lag take the place of N and 2 (N - m).

The texture is a power law behind a lens, bent a little: :math:`\log q` is linear in the columns of ``smooth_basis``.

Source: composite as in Drones 2024, 8(7), 306, equations 10 and 21; a power law times sinc fitted to one blurred
picture is due to Oliveira, Figueiredo and Bioucas-Dias, IEEE Trans. Image Process. 23(1), 2014.
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


@kernel
def comb(
    displacement_px: float, blur_px: float, lags: Array, frequency: Array, window: Array, floor: float, out: Array
) -> None:
    """``G`` and its derivatives to d and l at every frequency, ``out`` (f, 3).

    ``lags`` are the numbers of pairs; ``window`` is A at lags 0, 1 ... px; ``floor`` fills the dark lines of the comb,
    which groups of frequencies blur.
    """
    exposure_power(frequency, blur_px, out)
    share = copies(displacement_px, lags, window)
    step = frequency[1] - frequency[0] if frequency.shape[0] > 1 else 0.0
    step_re, step_im = (
        math.cos(2.0 * math.pi * step * displacement_px),
        math.sin(2.0 * math.pi * step * displacement_px),
    )
    turn_re, turn_im, before = 1.0, 0.0, -math.inf
    for j in range(frequency.shape[0]):
        angle = 2.0 * math.pi * frequency[j]
        if abs(frequency[j] - before - step) < SAME_STEP * step:  # a turn costs a tenth of a cosine
            turn_re, turn_im = turn_re * step_re - turn_im * step_im, turn_re * step_im + turn_im * step_re
        else:
            turn_re, turn_im = math.cos(angle * displacement_px), math.sin(angle * displacement_px)
        before = frequency[j]
        re, im, total, slope = 1.0, 0.0, share[0], 0.0
        for m in range(1, lags.shape[0]):
            re, im = re * turn_re - im * turn_im, re * turn_im + im * turn_re
            total += share[m] * re
            slope -= share[m] * m * im
        total = max(total, 0.0) + floor
        blur, dblur = out[j, 0], out[j, 1]
        out[j, 0] = total * blur
        out[j, 1] = slope * angle * blur
        out[j, 2] = total * dblur
