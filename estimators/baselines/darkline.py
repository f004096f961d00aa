"""Blur length from the dark lines of the collapsed spectrum (Moghaddam and Jamzad)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from axialnav.estimators.baselines.dips import null_ladder
from axialnav.estimators.baselines.reading import BlurReading, grey, missing, unusable

MAX_LENGTH_PX = 80  # the authors measured 10 to 50 px; a longer blur's lines drown in the texture's own low frequencies


def darkline_length(image: ArrayLike) -> BlurReading:
    r"""Blur length from the first dark line of the row spectrum.

    A uniform blur of length ``l`` along the rows multiplies the spectrum by :math:`\mathrm{sinc}(f l)`; with ``W``
    columns its dark lines are :math:`s = W / l` bins apart, so

    .. math:: l = W / s.

    The power of all rows is collapsed onto the frequency axis (the Radon projection at the known direction) and the
    prominent dips taken for the lines. The authors' fuzzy-set detector and fitted constants are replaced by
    this ideal law, because their fit describes their own test pictures.

    Known failure: below about 4 px the first line leaves the band, at low contrast the noise floor fills it, and the
    texture's own dips imitate it; on a composite the ridges hide the
    first nulls, and it reads ``N d`` only while that is short (some 60 px).

    Parameters
    ----------
    image
        One grey picture (h, w).

    References
    ----------
    .. [1] M. E. Moghaddam, M. Jamzad, "Motion blur identification in noisy images using mathematical models and
       statistical measures", EURASIP J. Adv. Signal Process. 2007, 68985.
    """
    reason = unusable(image)
    if reason:
        return missing(reason)
    width = np.shape(image)[1]
    spacing = null_ladder(log_power(grey(image)), width // MAX_LENGTH_PX)
    if spacing is None:
        return missing("no dark line stands out of the spectrum's scatter")
    return BlurReading(width / spacing, True)


def log_power(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """Log of the rows' mean power under a Hann window, shape (w // 2 + 1,) [nepers]."""
    window = np.hanning(picture.shape[1]).astype(np.float32)
    spectrum = np.fft.rfft(picture * window, axis=1)
    power = np.mean(spectrum.real**2 + spectrum.imag**2, axis=0, dtype=np.float64)
    return np.asarray(np.log(power + 1e-12 * power.max() + np.finfo(float).tiny))
