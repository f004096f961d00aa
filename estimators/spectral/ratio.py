r"""The comb that moving copies leave, read from a composite's spectrum over that of its frames.

With :math:`P_1` the mean power of the frames, of which ``s`` is noise, and :math:`P_N` that of their sum over N,

.. math::
    P_N / N = (P_1 - s) \, \big[ a \, G(f; d) + (1 - a) / N + b \big] + s / N + c, \qquad
    G = \frac{1}{N^2} \Big[ N + 2 \sum_{m=1}^{N-1} (N - m) \, A(m d) \cos(2 \pi m f d) \Big]

The texture, the lens and the blur of the exposures are in both, and need no model: not even the frames' rows have to be
a typical piece of wall.  What is left besides the displacement d are the shares of the texture that all frames have in
common (a) and that does not move (b), the noise, and the part of it that does not move either (c).  A, the
autocorrelation of the window, is what a window of finite length makes of the comb.  Where frames are not evenly spaced
the numbers of pairs at every lag take the place of N and 2 (N - m).

A ratio :math:`r = P_N / N P_1` lies between 0 and 1 and scatters like a share: by :math:`\varphi \, r (1 - r)`, with
:math:`\varphi = (1 - (1 - s / P_1)^2) / N` and little more.

Source: composite as in Drones 2024, 8(7), 306, equations 10 and 21.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.copies import EDGE, FLAT, Copies
from axialnav.estimators.spectral.picture import row_window
from axialnav.estimators.spectral.shapes import copies as shares
from axialnav.estimators.spectral.shapes import pair_lags, smooth_basis
from axialnav.estimators.spectral.whittle import solve_spd
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
SHIFT, COMMON, NOISE, STATIC, WHITE, PARAMETERS = 0, 1, 2, 3, 4, 5
STILL_PX = 1e-3
SMOOTH = 15  # bins: the frames' own noise must not choose the weights
USUAL = (0.0, 1.0, 0.0, 0.0, 0.0)
ROOM = (math.inf, 0.02, math.inf, 0.006, 0.01)  # standard deviations; those of noise in units of the faintest bins
TOP_FREQUENCY = 0.45
RIDGE, NEAR, ENOUGH = 1e-12, 0.1, 1e-6
CURVE_LAG, SMALL = 20, 1e-5
MOST_NOISE, CODEC_NOISE = 1.1, 8.0  # of the faintest bins, which codecs make fainter than others


@dataclass(frozen=True)
class Ratio:
    """A composite's spectrum over the smoothed one of its frames, with all that its likelihood needs; (f,) each.

    Parameters
    ----------
    value
        Power of the composite over N times the smoothed power of the frames.
    single
        Power of the frames over their smoothed power.
    faint
        The faintest smoothed power over that of every frequency.
    heard
        1 for frequencies to use, 0 for others.
    frequency, offset
        [cycles/px], and what the mean frequency behind a bin is off by because textures are steep.
    lags
        Numbers of pairs of frames at every lag, as ``pair_lags`` counts them.
    window
        Autocorrelation of the window.
    prior
        Mean and inverse variance per row of every parameter, shape (2, p).
    most_noise
        Bound for the noise, in units of the faintest bins.
    faintest
        The faintest smoothed power.
    """

    value: Array
    single: Array
    faint: Array
    heard: Array
    frequency: Array
    offset: Array
    lags: Array
    window: Array
    prior: Array
    most_noise: float
    faintest: float

    @cached_property
    def frames(self) -> int:
        """N."""
        return round(math.sqrt(float(np.sum(self.lags))))

    def uneven(self, times: tuple[int, ...]) -> Ratio:
        """The same for frames at these whole times."""
        return replace(self, lags=pair_lags(times))

    def climb(self, start: Array, steps: int, moving: bool = True) -> Array:
        """Parameters (p,) of the best model near ``start``."""
        return climb(
            start, moving, steps, self.most_noise, self.lags, self.frequency, self.offset, self.window, self.value,
            self.single, self.faint, self.heard, self.prior,
        )  # fmt: skip

    def comb(self, theta: Array) -> Array:
        """``G - 1 / N``, shape (f,)."""
        shape = np.empty((len(self.value), 2))
        comb_shape(theta[SHIFT], self.lags, self.frequency, self.offset, self.window, shape)
        return shape[:, 0]

    def model(self, theta: Array) -> tuple[Array, Array, Array]:
        """Residual (f,), weight (f,) and derivatives of the model (f, p)."""
        count = len(self.value)
        residual, weight, gradient = np.empty(count), np.empty(count), np.empty((count, PARAMETERS))
        misfit(
            theta, self.lags, self.frequency, self.offset, self.window, self.value, self.single, self.faint,
            self.heard, np.empty((count, 2)), residual, weight, gradient,
        )  # fmt: skip
        return residual, weight, gradient


@lru_cache(maxsize=16)
def _curve(length: int, count: int, first: float) -> tuple[Array, Array]:
    """What fits a smooth spectrum's logarithm (4, f), and what gives its slope's effect on frequencies (f, 4).

    A window takes in what is beside a frequency f.  With a steep spectrum q more of it comes from below: the mean
    frequency is off by the variance of the window's own spectrum times ``d log q / d f``.
    """
    frequency = first + np.arange(count) / length
    basis, root = smooth_basis(frequency), 1.0 / np.sqrt(frequency)
    fit = np.linalg.pinv(basis * root[:, None]) * root
    above, below = smooth_basis(frequency * (1.0 + SMALL)), smooth_basis(frequency * (1.0 - SMALL))
    variance = 2.0 * (1.0 - row_window(length)[1][CURVE_LAG]) / (2.0 * math.pi * CURVE_LAG) ** 2
    return fit, variance * (above - below) / (2.0 * SMALL * frequency[:, None])


def smoothed(power: Array) -> Array:
    """Mean over ``SMOOTH`` neighbouring bins (f,), over fewer at the ends."""
    total = np.concatenate([[0.0], np.cumsum(power)])
    at = np.arange(len(power))
    half = np.minimum(np.minimum(at, len(power) - 1 - at), SMOOTH // 2)
    return np.asarray((total[at + half + 1] - total[at - half]) / (2 * half + 1))


def ratio_of(copies: Copies, usable: Mask) -> Ratio:
    """The ratio of all rows; frequencies that are not usable do not count."""
    together, apart = copies.means
    level = smoothed(apart)
    faintest = float(level[usable].min())
    fit, slope = _curve(copies.length, len(level), float(copies.frequency[0]))
    room = np.array(ROOM)
    prior = np.array([USUAL, 1.0 / (room**2 * float(copies.rows.sum()))])
    return Ratio(
        together / copies.frames / level,
        apart / level,
        faintest / level,
        usable.astype(np.float64),
        copies.frequency,
        slope @ (fit @ np.log(level)),
        pair_lags(tuple(range(copies.frames))),
        row_window(copies.length)[1],
        prior,
        MOST_NOISE if usable.all() else CODEC_NOISE,
        faintest,
    )


@kernel
def comb_shape(displacement_px: float, lags: Array, frequency: Array, offset: Array, window: Array, out: Array) -> None:
    """``G - 1 / N`` and its derivative to d at evenly spaced frequencies plus small offsets, ``out`` (f, 2)."""
    share = shares(displacement_px, lags, window)
    step = 2.0 * math.pi * (frequency[1] - frequency[0]) * displacement_px
    step_re, step_im = math.cos(step), math.sin(step)
    angle = 2.0 * math.pi * frequency[0] * displacement_px
    even_re, even_im = math.cos(angle), math.sin(angle)
    for j in range(frequency.shape[0]):
        small = 2.0 * math.pi * offset[j] * displacement_px
        cosine, sine = 1.0 - 0.5 * small * small, small * (1.0 - small * small / 6.0)
        turn_re, turn_im = even_re * cosine - even_im * sine, even_re * sine + even_im * cosine
        even_re, even_im = even_re * step_re - even_im * step_im, even_re * step_im + even_im * step_re
        re, im, total, slope = 1.0, 0.0, 0.0, 0.0
        for m in range(1, lags.shape[0]):
            re, im = re * turn_re - im * turn_im, re * turn_im + im * turn_re
            total += share[m] * re
            slope -= share[m] * m * im
        out[j, 0] = total
        out[j, 1] = slope * 2.0 * math.pi * (frequency[j] + offset[j])


@kernel
def misfit(
    theta: Array,
    lags: Array,
    frequency: Array,
    offset: Array,
    window: Array,
    value: Array,
    single: Array,
    faint: Array,
    heard: Array,
    shape: Array,
    residual: Array,
    weight: Array,
    gradient: Array,
) -> None:
    """Residual (f,), its inverse variance but for a factor (f,) and the model's expected derivatives (f, p)."""
    share = 1.0 / math.sqrt(np.sum(lags))
    comb_shape(theta[SHIFT], lags, frequency, offset, window, shape)
    common, noise = theta[COMMON], theta[NOISE]
    for j in range(value.shape[0]):
        comb, u, e = shape[j, 0], faint[j], single[j]
        quiet = min(noise * u, MOST_NOISE)
        model = share * e + comb * (common * e - quiet) + theta[STATIC] * e + theta[WHITE] * u
        residual[j] = value[j] - model
        dark = min(max(quiet, 0.0), 1.0)
        bright = min(max(share + comb * (1.0 - dark) * min(common, 1.0), 0.0), 1.0)
        spread = (1.0 - (1.0 - dark) ** 2) * share + EDGE
        weight[j] = heard[j] / (spread * max(bright * (1.0 - bright), FLAT))
        gradient[j, SHIFT] = shape[j, 1] * (common - quiet)
        gradient[j, COMMON] = comb
        gradient[j, NOISE] = -comb * u if quiet < MOST_NOISE else 0.0
        gradient[j, STATIC] = 1.0
        gradient[j, WHITE] = u


@kernel
def climb(
    start: Array,
    moving: bool,
    steps: int,
    most_noise: float,
    lags: Array,
    frequency: Array,
    offset: Array,
    window: Array,
    value: Array,
    single: Array,
    faint: Array,
    heard: Array,
    prior: Array,
) -> Array:
    """Parameters (p,) by steps of weighted least squares, none longer than where the comb is straight."""
    count = value.shape[0]
    shape, residual, weight = np.empty((count, 2)), np.empty(count), np.empty(count)
    gradient = np.empty((count, PARAMETERS))
    theta = start.copy()
    straight = 0.1 / ((lags.shape[0] - 1) * TOP_FREQUENCY)
    for _ in range(steps):
        misfit(theta, lags, frequency, offset, window, value, single, faint, heard, shape, residual, weight, gradient)
        step = least_squares_step(theta, residual, weight, gradient, prior, moving)
        reach = straight + NEAR * theta[SHIFT]
        if not np.all(np.isfinite(step)):
            break
        if abs(step[SHIFT]) > reach:
            step *= reach / abs(step[SHIFT])
        theta += step
        theta[SHIFT] = max(theta[SHIFT], STILL_PX)
        theta[NOISE] = min(max(theta[NOISE], 0.0), most_noise)
        if abs(step[SHIFT]) < ENOUGH:
            break
    return theta


@kernel
def least_squares_step(
    theta: Array, residual: Array, weight: Array, gradient: Array, prior: Array, moving: bool
) -> Array:
    """Gauss-Newton step (p,) towards less of the squared residuals and of the distance from the prior."""
    A, b = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
    for j in range(residual.shape[0]):
        for p in range(PARAMETERS):
            part = weight[j] * gradient[j, p]
            b[p] += part * residual[j]
            for q in range(p + 1):
                A[p, q] += part * gradient[j, q]
    for p in range(PARAMETERS):
        for q in range(p):
            A[q, p] = A[p, q]
        A[p, p] += prior[1, p] + RIDGE * A[p, p]
        b[p] += prior[1, p] * (prior[0, p] - theta[p])
    if not moving:
        A[SHIFT, :] = 0.0
        A[:, SHIFT] = 0.0
        A[SHIFT, SHIFT], b[SHIFT] = 1.0, 0.0
    return solve_spd(A, b)
