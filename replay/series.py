"""Statistics of correlated series: whiteness, effective number of samples, chi-square band of a mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def lag1_autocorrelation(values: Array) -> float | None:
    """Correlation of a series with itself one sample later; None below three samples or without variation.

    A filter that is told the right noise has white innovations: the value stays within ``+-2 / sqrt(n)``.

    values : (n,) finite numbers.
    """
    if values.size < 3:
        return None
    centred = values - values.mean()
    power = float(centred @ centred)
    return float(centred[1:] @ centred[:-1]) / power if power > 0.0 else None


def autocorrelation(values: Array) -> Array:
    """Biased sample autocorrelation of a series about its mean, lags 0 .. n - 1.

    values : (n,) finite numbers, not all equal.
    """
    sums = _autocovariance_sums((values - values.mean())[:, None])[:, 0]
    normalised: Array = sums / sums[0]
    return normalised


def _autocovariance_sums(values: Array) -> Array:
    """``sum_t v_t v_(t+k)`` of each column for the lags k = 0 .. n - 1, by FFT; (n, m) -> (n, m)."""
    count = values.shape[0]
    spectrum = np.fft.rfft(values, n=1 << (2 * count - 1).bit_length(), axis=0)
    sums: Array = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, axis=0)[:count]
    return sums


def effective_samples_of_squares(whitened: Array, window: float = 5.0) -> float:
    r"""Number of independent samples whose mean square is as uncertain as that of this correlated series.

    Errors of a filter are correlated in time, so n of them are worth fewer.  For a zero-mean Gaussian series with m
    components of autocovariance :math:`c_i(k)` the autocovariance of the sum of squares is :math:`2 \sum_i c_i(k)^2`
    (Isserlis), hence

    .. math:: n_\mathrm{eff} = n / \tau, \qquad \tau = 1 + 2 \sum_{k=1}^{M} \sum_i c_i(k)^2 / \sum_i c_i(0)^2 .

    The sum ends at the first lag ``M >= window * tau(M)`` (A. Sokal, "Monte Carlo Methods in Statistical Mechanics",
    1997, section 3.3), because the tail of a sample autocorrelation is noise.  No mean is removed: under the hypothesis
    of a consistent filter it is zero, and a bias makes the answer smaller, which is the careful side.

    whitened : (n, m) errors divided by their standard deviation.  Returns a number in 1 .. n (0 for n = 0).
    """
    count = whitened.shape[0]
    squares = (_autocovariance_sums(whitened) ** 2).sum(axis=1) if count else np.zeros(1)
    if squares[0] == 0.0:
        return float(min(count, 1))
    tau = 2.0 * np.cumsum(squares / squares[0]) - 1.0
    enough = np.arange(count) >= window * tau
    last = int(np.argmax(enough)) if enough.any() else count - 1
    return float(np.clip(count / tau[last], 1.0, count))


def chi_square_mean_band(dof: int, samples: float, probability: float = 0.95) -> tuple[float, float]:
    """Band in which the mean of ``samples`` independent chi-square variables lies with the given probability.

    dof : degrees of freedom of each variable.  samples : their number, need not be whole.
    """
    from scipy.special import gammaincinv  # costs a third of a second: only when a band is asked for

    tail = 0.5 * (1.0 - probability)
    shape = 0.5 * dof * samples
    return 2.0 * float(gammaincinv(shape, tail)) / samples, 2.0 * float(gammaincinv(shape, 1.0 - tail)) / samples
