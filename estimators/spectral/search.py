r"""Where the likelihood of a composite may have its maximum: a look at every displacement.

A smooth spectrum B without motion is fitted first.  With :math:`\rho = 1 - s / B`, the share of the texture in it, a
displacement predicts :math:`M = B \, (1 - \rho + \rho \, \tilde G)`, where :math:`\tilde G` is the comb less whatever a
smooth spectrum can imitate.  These combs are tables.  Where the comb is as wide as the whole spectrum that
approximation is worthless, and the smooth spectrum is fitted anew at every displacement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import row_window
from axialnav.estimators.spectral.problem import Problem
from axialnav.estimators.spectral.shapes import TOP_FREQUENCY, comb, pair_lags, smooth_basis
from axialnav.estimators.spectral.whittle import BLUR, NOISE, PARAMETERS, SHIFT
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
PHASE_STEP = 0.25  # cycles between neighbouring displacements at the highest useful frequency and lag
LOBES = 1.5  # useful lobes of the exposure's sinc
FLOOR = 0.05
LEAST_MANTISSA = np.int32(0x3F3504F3)  # the bits of sqrt(1/2)
SERIES = (np.float32(2.0), np.float32(2.0 / 3.0), np.float32(2.0 / 5.0), np.float32(2.0 / 7.0))  # of 2 artanh z
LOG_2 = np.float32(math.log(2.0))
CLIMB_STEPS = 5


@lru_cache(maxsize=64)
def displacements(low_px: float, high_px: float, frames: int, ratio: float) -> Array:
    """Displacements to look at [px], as dense as the ripples they cause demand."""
    grid, at = [], low_px
    while at < high_px:
        grid.append(at)
        useful = min(TOP_FREQUENCY, LOBES / max(ratio * at, 1e-9))
        at += PHASE_STEP / (max(frames - 1 + ratio, 1.0) * useful)
    return np.array(grid)


@dataclass(frozen=True)
class Table:
    """Combs of a range of displacements [px] over groups of frequencies, shape (d, g)."""

    displacement_px: Array
    comb: Plane


@lru_cache(maxsize=64)
def comb_table(
    low_px: float, high_px: float, frames: int, ratio: float, length: int, frequency: bytes, weight: bytes
) -> Table:
    """Combs less their smooth part; frequencies and weights as bytes of float64 arrays (g,)."""
    grid = displacements(low_px, high_px, frames, ratio)
    f, w = np.frombuffer(frequency), np.frombuffer(weight)
    window, basis, shape = row_window(length)[1], smooth_basis(f), np.empty((len(f), 3))
    out = np.empty((len(grid), len(f)), dtype=np.float32)
    for row, d in zip(out, grid, strict=True):
        comb(d, ratio * d, pair_lags(tuple(range(frames))), f, window, 0.0, shape)
        heard = w * (f * ratio * d < LOBES)
        normal = basis.T @ (basis * heard[:, None]) + 1e-6 * np.eye(basis.shape[1])
        smooth = basis @ np.linalg.solve(normal, basis.T @ (heard * np.log(shape[:, 0] + FLOOR)))
        flat = shape[:, 0] * np.exp(np.clip(-smooth, -20.0, 20.0)) * (heard > 0.0)
        total = float(heard @ flat)  # nothing in small pictures of long blurs
        row[:] = flat * (heard.sum() / total) if total > 0.0 else 1.0
    return Table(grid, out)


@kernel
def rank(table: Plane, share: Plane, relative: Plane, weight: Plane, out: Array) -> None:
    """Gain in log-likelihood per row of every comb (d, g) over no motion, ``out`` (d,).

    The logarithm is that of the mantissa by its series plus the exponent, which a processor does for many numbers at
    once; good to 1e-7.
    """
    groups = share.shape[0]
    still = np.float32(0.0)
    for g in range(groups):
        still += weight[g] * relative[g]
    model, power, part = np.empty((3, groups), dtype=np.float32)
    bits = model.view(np.int32)
    for i in range(table.shape[0]):
        line = table[i]
        for g in range(groups):
            model[g] = np.float32(1.0 + FLOOR) + share[g] * (line[g] - np.float32(1.0))
            part[g] = relative[g] / model[g]
        for g in range(groups):
            above = bits[g] - LEAST_MANTISSA
            power[g] = np.float32(above >> np.int32(23))
            bits[g] = (above & np.int32(0x007FFFFF)) + LEAST_MANTISSA
        for g in range(groups):
            z = (model[g] - np.float32(1.0)) / (model[g] + np.float32(1.0))
            s = z * z
            logarithm = z * (SERIES[0] + s * (SERIES[1] + s * (SERIES[2] + s * SERIES[3]))) + power[g] * LOG_2
            part[g] = weight[g] * (part[g] + logarithm)
        out[i] = still - part.sum()


def smooth_fit(problem: Problem, steps: int = 12) -> tuple[Array, float]:
    """Parameters and misfit of a spectrum without motion, from scratch."""
    free = np.ones(PARAMETERS, dtype=np.bool_)
    free[[SHIFT, BLUR]] = False
    return problem.climb(problem.prior[0].copy(), 0.0, free, steps, fresh=True)


def look(
    problem: Problem, smooth: Array, low_px: float, high_px: float, ratio: float, length: int
) -> tuple[Array, Array]:
    """Displacements of a range and their gain in log-likelihood per row over no motion, from tables."""
    table = comb_table(
        low_px, high_px, problem.frames, ratio, length, problem.frequency.tobytes(), problem.weight.tobytes()
    )
    level, _ = problem.model(smooth, 0.0)
    share = np.clip(1.0 - math.exp(smooth[NOISE]) / level, 0.0, 1.0)
    gain = np.empty(len(table.displacement_px))
    rank(table.comb, _plane(share), _plane(problem.power / level), _plane(problem.weight), gain)
    return table.displacement_px, gain


def _plane(values: Array) -> Plane:
    return values.astype(np.float32)


def climb_all(problem: Problem, smooth: Array, grid_px: Array, tie: float, which: int = SHIFT) -> tuple[Array, Array]:
    """Parameters (d, p) and misfit per row (d,) after short climbs from every value of a grid."""
    free = np.ones(PARAMETERS, dtype=np.bool_)
    free[BLUR if which == SHIFT else SHIFT] = False
    thetas, cost = np.empty((len(grid_px), PARAMETERS)), np.empty(len(grid_px))
    for i, value in enumerate(grid_px):
        start = smooth.copy()
        start[which] = value
        thetas[i], cost[i] = problem.climb(start, tie, free, CLIMB_STEPS, fresh=True)
    return thetas, cost


def peaks(grid_px: Array, gain: Array, most: int) -> Array:
    """The highest local maxima of ``gain``, at most so many, highest first [px]."""
    padded = np.concatenate([[-math.inf], gain, [-math.inf]])
    top = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]))
    return np.asarray(grid_px[top[np.argsort(-gain[top])][:most]])
