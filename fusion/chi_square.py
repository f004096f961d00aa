"""Gate thresholds: quantiles of the chi-square distribution for one to three axes, from the standard library.

scipy.special has them too, but its import takes longer than everything else the filter needs on a companion computer.
"""

from __future__ import annotations

import math
from statistics import NormalDist

TOLERANCE = 1e-13
MAX_STEPS = 60


def chi_square_threshold(dof: int, probability: float) -> float:
    """Value that a chi-square variable with ``dof`` (1, 2 or 3) degrees of freedom stays below with ``probability``.

    Raises
    ------
    ValueError
        Another number of degrees of freedom, or a probability outside (0, 1).
    """
    if dof not in (1, 2, 3) or not 0.0 < probability < 1.0:
        raise ValueError(f"chi-square threshold needs dof 1..3 and 0 < probability < 1, got {dof} and {probability}")
    if dof == 1:
        return NormalDist().inv_cdf(0.5 * (1.0 - probability)) ** 2  # the lower tail keeps its digits
    if dof == 2:
        return -2.0 * math.log1p(-probability)
    return _threshold_3(probability)


def _tail_3(x: float) -> float:
    """Probability that a chi-square variable with three degrees of freedom exceeds ``x``."""
    return math.erfc(math.sqrt(0.5 * x)) + math.sqrt(2.0 * x / math.pi) * math.exp(-0.5 * x)


def _threshold_3(probability: float) -> float:
    """Newton's method on the logarithm of the tail, which is nearly straight."""
    target = math.log1p(-probability)
    x = chi_square_threshold(2, probability) + 1.0
    for _ in range(MAX_STEPS):
        tail = _tail_3(x)
        density = math.sqrt(x / (2.0 * math.pi)) * math.exp(-0.5 * x)
        step = (math.log(tail) - target) * tail / density
        x = max(x + step, 0.5 * x)
        if abs(step) <= TOLERANCE * x:
            break
    return x
