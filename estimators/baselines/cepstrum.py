"""Blur length from the negative peak of the cepstrum."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from axialnav.estimators.baselines.darkline import log_power
from axialnav.estimators.baselines.reading import BlurReading, grey, missing, unusable

MIN_LAG_PX = 3
MAX_SHARE = 0.25  # of the width: longer lags have too few periods in the spectrum
NOISE_MULTIPLE = 6.0
TREND_ORDER = 4
MAD_TO_SIGMA = 1.4826


def cepstrum_length(image: ArrayLike) -> BlurReading:
    r"""Blur length from the cepstrum of the rows.

    The nulls of :math:`\mathrm{sinc}(f l)` repeat every :math:`1 / l`, so the inverse transform of the log spectrum
    has a negative peak at lag ``l``:

    .. math:: c(x) = \mathcal{F}^{-1} \log |F(f)|^2.

    The smooth fall of the texture's spectrum is removed first by a polynomial in log frequency.

    Known failure: the peak drowns in the texture's own cepstrum for short blurs (errors of the length itself below
    about 6 px); on a composite it reads ``N d``.

    Parameters
    ----------
    image
        One grey picture (h, w).

    References
    ----------
    .. [1] I. Rekleitis, "Steerable filters and cepstral analysis for optical flow calculation from a single blurred
       image", Vision Interface, 1996.
    """
    reason = unusable(image)
    if reason:
        return missing(reason)
    cepstrum = _cepstrum(log_power(grey(image)))
    limit = int(MAX_SHARE * np.shape(image)[1])
    part = cepstrum[MIN_LAG_PX:limit]
    k = int(np.argmin(part))
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(part - np.median(part))))
    if not -part[k] > NOISE_MULTIPLE * scatter:
        return missing("no negative peak stands out of the cepstrum's scatter")
    lag = k + MIN_LAG_PX
    a, b, c = cepstrum[lag - 1 : lag + 2]
    bend = float(a - 2.0 * b + c)
    return BlurReading(lag + (0.5 * float(a - c) / bend if bend > 0.0 else 0.0), True)


def _cepstrum(log_spectrum: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real cepstrum of a log spectrum (m,) with its power-law trend removed; lags 0 .. 2m - 3 [px]."""
    octave = np.log(np.arange(1, len(log_spectrum)))
    trend = np.polynomial.Polynomial.fit(octave, log_spectrum[1:], TREND_ORDER)
    flat = np.concatenate([[0.0], log_spectrum[1:] - trend(octave)])
    return np.asarray(np.fft.irfft(flat))
