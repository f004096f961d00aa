"""Find the nulls that motion blur leaves in a one-dimensional log spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MIN_BIN = 3  # below it the profile is the picture's own shading
MAX_SHARE = 0.9  # of the highest bin: above it there is only noise
NOISE_MULTIPLE = 6.0  # a null must be this much deeper than the profile's scatter
COMPARABLE = 0.4  # of the deepest prominence: what counts as a null beside it
MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True)
class Dip:
    """A local minimum: its position [bins, interpolated] and how deep it lies under its surroundings [nepers]."""

    position: float
    depth: float


def first_null(profile: Array) -> Dip | None:
    """The first prominent minimum of a log spectrum (n,), or None if none stands out of the scatter.

    The prominence of a minimum is the height of the lower of the two crests between it and deeper ground. In a real
    picture the first null of a sinc is the most prominent one, because the crests fall with frequency and the noise
    floor fills the later nulls; without noise the others are as deep, so the first comparable one is taken.
    """
    last = int(MAX_SHARE * len(profile))
    inner = np.convolve(profile, [0.25, 0.5, 0.25], mode="same")[:last]
    minima = np.flatnonzero((inner[1:-1] < inner[:-2]) & (inner[1:-1] <= inner[2:])) + 1
    minima = minima[minima >= MIN_BIN]
    if not minima.size:
        return None
    depths = [_prominence(inner, int(k)) for k in minima]
    needed = max(NOISE_MULTIPLE * _scatter(profile[MIN_BIN:last]), COMPARABLE * max(depths))
    for k, depth in zip(minima, depths, strict=True):
        if depth >= needed:
            return Dip(_vertex(inner, int(k)), depth)
    return None


def _prominence(profile: Array, k: int) -> float:
    level = profile[k]
    left, right = profile[:k][::-1], profile[k + 1 :]
    crests = []
    for side in (left, right):
        lower = np.flatnonzero(side < level)
        reach = side[: int(lower[0])] if lower.size else side
        crests.append(float(reach.max()) if reach.size else float(level))
    return min(crests) - float(level)


def _scatter(profile: Array) -> float:
    """Standard deviation of the smoothed profile's noise, from second differences that ignore slow curves."""
    curvature = np.diff(profile, 2)
    sigma = MAD_TO_SIGMA * float(np.median(np.abs(curvature - np.median(curvature)))) / math.sqrt(6.0)
    return sigma * math.sqrt(0.375)  # what the (1, 2, 1) / 4 smoothing leaves


def _vertex(profile: Array, k: int) -> float:
    a, b, c = profile[k - 1], profile[k], profile[k + 1]
    bend = a - 2.0 * b + c
    return k + (0.5 * float((a - c) / bend) if bend > 0.0 else 0.0)
