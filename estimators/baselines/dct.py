"""Blur length from the first null of the cosine transform (Cortes-Osorio)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dct

from axialnav.estimators.baselines.darkline import MAX_LENGTH_PX
from axialnav.estimators.baselines.dips import prominent_dips
from axialnav.estimators.baselines.reading import BlurReading, grey, missing, unusable


def dct_length(image: ArrayLike) -> BlurReading:
    r"""Blur length from the first null of the rows' cosine transform.

    The transform of a box of length ``l`` in a row of ``W`` pixels is proportional to

    .. math:: \frac{\sin(\pi k l / 2W)}{\pi k l / 2W},

    whose first null lies at :math:`k_0 = 2W / l`; hence :math:`l = 2W / k_0` (the paper's equations 8 and 9). The
    squared transforms of all rows are averaged and the first prominent dip is taken for ``k_0``.

    Known failure: as every method that looks for nulls, below about 4 px and at low contrast; on a composite
    the ridges hide the first nulls, and it reads ``N d`` only while that is short (some 60 px).

    Parameters
    ----------
    image
        One grey picture (h, w).

    References
    ----------
    .. [1] J. A. Cortes-Osorio, J. B. Gomez-Mendoza, J. C. Riano-Rojas, "Velocity estimation from a single linear
       motion blurred image using discrete cosine transform", IEEE Trans. Instrum. Meas. 68(10), 2019.
    """
    reason = unusable(image)
    if reason:
        return missing(reason)
    picture = grey(image)
    window = np.hanning(picture.shape[1]).astype(np.float32)
    power = np.mean(dct(picture * window, axis=1).astype(np.float64) ** 2, axis=0)
    width = picture.shape[1]
    dips = prominent_dips(np.log(power + 1e-12 * power.max() + np.finfo(float).tiny), 2 * width // MAX_LENGTH_PX)
    if not dips.size:
        return missing("no null stands out of the cosine transform's scatter")
    return BlurReading(2.0 * width / float(dips[0]), True)
