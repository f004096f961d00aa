r"""Where the comb may be: a look at every displacement.

With weights that do not depend on the comb, least squares need nothing but two sums of the kind
:math:`\sum_f w(f) \cos(2 \pi f x)`: one inverse transform gives each for all x, and a displacement d reads them at the
multiples of d.  The share of the texture that the frames have in common is fitted at every displacement.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.copies import EDGE
from axialnav.estimators.spectral.picture import FIRST_BIN, row_window
from axialnav.estimators.spectral.ratio import COMMON, NOISE, PARAMETERS, SHIFT, TOP_FREQUENCY, Ratio
from axialnav.estimators.spectral.shapes import copies as shares
from axialnav.estimators.spectral.shapes import pair_lags
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
FINE = 4  # samples per pixel of the transforms
LOWEST_PX, GROWTH = 0.15, 1.05
PHASE_STEP = 0.25  # cycles between neighbouring displacements at the highest frequency and lag
DARK_BINS = 12  # whose least mean is as dark as the noise alone, or nearly
MOST = 3


@lru_cache(maxsize=16)
def grid(frames: int, length: int, reach_px: float) -> tuple[Array, Array]:
    """Displacements [px] (d,), as dense as combs demand, and their shares of pairs at every lag (d, N)."""
    found, at = [], LOWEST_PX
    while at < reach_px:
        found.append(at)
        at += min(PHASE_STEP / ((frames - 1) * TOP_FREQUENCY), (GROWTH - 1.0) * at)
    lags, window = pair_lags(tuple(range(frames))), row_window(length)[1]
    return np.array(found), np.array([shares(d, lags, window) for d in found])


@kernel
def read_at(sums: Plane, x: float) -> float:
    """Transform (m,) at ``x`` px, which is even and periodic."""
    place = abs(x) * FINE
    k = int(place)
    part = place - k
    return float(sums[k] + part * (sums[k + 1] - sums[k]))


@kernel
def scan(grid_px: Array, share: Array, sums: Plane, gain: Array) -> None:
    """Decrease of the squared misfit by the best share of the comb at every displacement (d,).

    ``sums`` (2, m) are the transforms of ``w t y`` and ``w t^2`` with t the share of the texture.
    """
    lags = share.shape[1]
    for i in range(grid_px.shape[0]):
        match, size = 0.0, 0.0
        for m in range(1, lags):
            match += share[i, m] * read_at(sums[0], m * grid_px[i])
            for n in range(1, m + 1):
                both = (1.0 if n < m else 0.5) * share[i, m] * share[i, n]
                size += both * (read_at(sums[1], (m + n) * grid_px[i]) + read_at(sums[1], (m - n) * grid_px[i]))
        gain[i] = match * match / size if match > 0.0 and size > 0.0 else 0.0


def transforms(ratio: Ratio, length: int) -> tuple[Plane, float]:
    """The sums that ``scan`` reads (2, m), and the noise that they take for granted, in units of the faintest bins.

    No frequency is darker than the noise: in a dark line of the composite there is nothing else.
    """
    share = 1.0 / ratio.frames
    darkest = (np.minimum(ratio.value * ratio.frames, ratio.single) / ratio.faint)[ratio.heard > 0.0]
    noise = min(1.0, float(np.convolve(darkest, np.full(DARK_BINS, 1.0 / DARK_BINS), "valid").min()))
    texture = 1.0 - np.minimum(noise * ratio.faint, 1.0)
    weight = ratio.heard * texture / ((1.0 - texture**2) * share + EDGE)
    half = FINE * length // 2
    padded = np.zeros((2, half + 1), dtype=np.complex64)
    padded[0, FIRST_BIN : FIRST_BIN + len(weight)] = weight * (ratio.value - share * ratio.single)
    padded[1, FIRST_BIN : FIRST_BIN + len(weight)] = weight * texture
    return (np.fft.irfft(padded) * half).astype(np.float32), noise


def candidates(ratio: Ratio, length: int, reach_px: float) -> tuple[list[Array], float]:
    """Parameters (p,) near the most promising displacements, best first, and the noise."""
    grid_px, share = grid(ratio.frames, length, reach_px)
    sums, noise = transforms(ratio, length)
    gain = np.empty(len(grid_px))
    scan(grid_px, share, sums, gain)
    padded = np.concatenate([[-math.inf], gain, [-math.inf]])
    top = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]))
    starts = np.zeros((min(MOST, len(top)), PARAMETERS))
    starts[:, SHIFT] = grid_px[top[np.argsort(-gain[top])][:MOST]]
    starts[:, COMMON] = 1.0
    starts[:, NOISE] = noise
    return list(starts), noise
