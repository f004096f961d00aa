"""Find the nulls that motion blur leaves in a one-dimensional log spectrum."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SMOOTHING = np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0  # texture dips are narrower than the nulls of a short blur
MAX_SHARE = 0.9  # of the highest bin: above it there is only noise
NOISE_MULTIPLE = 8.0  # a null must be this much deeper than the scatter; white noise reaches 6
COMPARABLE = 0.5  # of the greatest prominence: what counts as a null beside it
RUNG_TOLERANCE = 0.15  # of a spacing
MAX_RUNG = 6  # a first null a tenth of a rung off must not count later ones to the wrong rung
REFINEMENTS = 3
MAD_TO_SIGMA = 1.4826


def null_ladder(profile: Array, min_bin: int) -> float | None:
    """Spacing of the nulls at ``s, 2 s, 3 s ...`` of a log spectrum (n,) [bins], or None if none stands out.

    A null is a minimum whose prominence (the height of the lower of the two crests between it and deeper ground)
    exceeds the profile's scatter and half of the greatest prominence; ground below the level of the highest
    frequencies is noise and counts as that level. The first null gives the spacing, the others on its rungs refine it.

    Parameters
    ----------
    profile
        Log power against bins.
    min_bin
        Nulls are looked for above this bin: below it the profile is the texture's own.
    """
    dips = prominent_dips(profile, min_bin)
    if not dips.size:
        return None
    spacing = float(dips[0])
    for _ in range(REFINEMENTS):
        rung = np.maximum(np.round(dips / spacing), 1.0)
        on_rung = (np.abs(dips / spacing - rung) < RUNG_TOLERANCE) & (rung <= MAX_RUNG)
        spacing = float(dips[on_rung] @ rung[on_rung] / (rung[on_rung] @ rung[on_rung]))
    return spacing


def prominent_dips(profile: Array, min_bin: int) -> Array:
    """Positions of the nulls [bins, interpolated], rising, shape (k,)."""
    last = int(MAX_SHARE * len(profile))
    inner = np.convolve(profile, SMOOTHING, mode="same")[:last]
    raised = np.maximum(inner, float(np.median(profile[last:])))
    minima = np.flatnonzero((inner[1:-1] < inner[:-2]) & (inner[1:-1] <= inner[2:])) + 1
    minima = minima[minima >= min_bin]
    depth = np.array([_prominence(raised, int(k)) for k in minima])
    scatter = NOISE_MULTIPLE * _scatter(profile[min_bin:last])
    strong = depth > max(scatter, COMPARABLE * float(depth.max(initial=0.0)))
    return np.array([_vertex(inner, int(k)) for k in minima[strong]])


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
    return sigma * math.sqrt(float(SMOOTHING @ SMOOTHING))


def _vertex(profile: Array, k: int) -> float:
    a, b, c = profile[k - 1], profile[k], profile[k + 1]
    bend = a - 2.0 * b + c
    return k + (0.5 * float((a - c) / bend) if bend > 0.0 else 0.0)
