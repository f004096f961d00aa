"""Blur over displacement: an integrity channel that needs no second opinion from outside.

The blur of one exposure is ``l = d t_e / T``; measured in the common picture of the aligned frames and divided by what
the displacement says, it is 1 for a healthy camera, 1/2 when a frame was dropped, and off by the same factor as a wrong
exposure or frame period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import Fit
from axialnav.estimators.positions import turns
from axialnav.estimators.spectrum import Band
from axialnav.estimators.whittle import parabola, whittle_costs
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
MIN_LENGTH_PX = 2.0
RATIOS = np.linspace(0.3, 2.2, 39)
GROUPS_PER_RIPPLE = 12.0
SURE = 4.0
TOLERANCE = 0.25
MISMATCH = 0.05  # relative error of power laws and Gaussian lenses as spectra of real ones
UNSURE = 12.0  # log-likelihood by which another ratio must win
LOWEST_SHARE = 0.2  # of 1 / l: below, stains and lamps spoil the power law
MIN_GROUPS = 12
SHAPE_STRIDE = 2
TINY = 1e-9
SLOPES = (1.0, 1.5, 2.0, 2.5, 3.0)
LENS_SIGMAS_PX = (0.4, 0.8, 1.4)


@dataclass(frozen=True)
class Kappa:
    """Ratio and its standard deviation [-]; both NaN where the blur is too short or too faint."""

    value: float
    sigma: float

    @property
    def alarming(self) -> bool:
        """Whether the blur is too short for the displacement: a frame was dropped, or period or exposure are wrong.

        Blur that is too long raises no alarm: a codec or a soft lens looks like that and does no harm.
        """
        return 1.0 - self.value > SURE * self.sigma + TOLERANCE


UNKNOWN = Kappa(math.nan, math.nan)


@lru_cache(maxsize=8)
def blur_shapes(band: Band) -> Array:
    """Power laws behind Gaussian lenses, candidate spectra of texture, shape (m, f)."""
    f = band.frequency()
    family = [(f / f[0]) ** -a * np.exp(-((2.0 * np.pi * s * f) ** 2)) for a in SLOPES for s in LENS_SIGMAS_PX]
    return np.array(family)


def blur_ratio(fit: Fit, band: Band, rows: Array, exposure_ratio: float) -> Kappa:
    """Blur length in the common picture over the one expected.

    Parameters
    ----------
    fit
        Joint fit.
    band
        Its frequencies.
    rows
        Rows behind its spectra, per class, shape (c,).
    exposure_ratio
        Exposure over frame period.
    """
    expected_px = abs(float(fit.motion[0])) * exposure_ratio
    if expected_px < MIN_LENGTH_PX:
        return UNKNOWN
    frames = fit.score.shape[1]
    power = np.average(fit.coherent + fit.noise / frames, axis=0, weights=rows)
    size = max(1, int(band.length / (GROUPS_PER_RIPPLE * 2.0 * expected_px)))
    first = int(np.searchsorted(band.frequency(), LOWEST_SHARE / expected_px))
    count = (band.count - first) // size
    if count < MIN_GROUPS:
        return UNKNOWN

    def grouped(values: Array) -> Array:
        """Means of neighbouring frequencies (..., f), shape (..., count)."""
        used = values[..., first : first + count * size]
        return np.ascontiguousarray(used.reshape(*values.shape[:-1], count, size).mean(axis=-1))

    tables, cost = np.empty((len(RATIOS), count)), np.empty(len(RATIOS))
    blur_transfers(RATIOS * expected_px, band.omega()[first:], size, tables)
    number = np.empty(len(RATIOS), dtype=np.int64)
    whittle_costs(np.maximum(grouped(power), TINY), tables, grouped(blur_shapes(band)[::SHAPE_STRIDE]), cost, number)
    looks = 1.0 / (1.0 / (float(rows.sum()) * size) + MISMATCH**2)
    return _read(cost * looks)


@kernel
def blur_transfers(length_px: Array, omega: Array, size: int, out: Array) -> None:
    """Power transfer of blurs (m,) [px], means over ``size`` neighbouring frequencies (f,) [rad/px], shape (m, g)."""
    cosine, sine = np.empty((1, omega.shape[0]), dtype=np.float32), np.empty((1, omega.shape[0]), dtype=np.float32)
    half = np.empty(1)
    for m in range(out.shape[0]):
        half[0] = 0.5 * length_px[m]
        turns(omega, half, cosine, sine)
        for g in range(out.shape[1]):
            total = 0.0
            for f in range(g * size, (g + 1) * size):
                ratio = sine[0, f] / (half[0] * omega[f])
                total += ratio * ratio
            out[m, g] = total / size


def _read(cost: Array) -> Kappa:
    """The ratio near 1 if it is nearly as good as any other, else the best one."""
    healthy = np.abs(RATIOS - 1.0) <= TOLERANCE
    best = int(np.argmin(cost))
    near = int(np.flatnonzero(healthy)[np.argmin(cost[healthy])])
    k = int(np.clip(near if cost[near] - cost[best] < UNSURE else best, 1, len(RATIOS) - 2))
    value, bend = parabola(RATIOS[k - 1 : k + 2], cost[k - 1 : k + 2])
    return Kappa(value, math.sqrt(1.0 / bend)) if bend > 0.0 else UNKNOWN
