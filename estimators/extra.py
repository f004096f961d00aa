"""One Gauss-Newton step of a few positions beside known ones: the test behind acceleration, uneven frames and roll."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]


@kernel
def extra_step(score: Array, information: Array, factor: Array, known: Array, extra: Array, step: Array) -> float:
    """Step of extra parameters, with known ones free beside them, and its chi-square.

    Parameters
    ----------
    score, information
        Of the frames' positions in every strip, shapes (s, n) and (s, n, n).
    factor
        How much of the extra motion every strip sees, shape (s,).
    known, extra
        Positions per parameter, shapes (n, a) and (n, b).
    step
        Result [px], shape (b,).

    Returns
    -------
    float
        Chi-square of the step with b degrees of freedom; -1 if the likelihood has no maximum.
    """
    a, b = known.shape[1], extra.shape[1]
    size = a + b
    system = np.zeros((size, size + 1))
    for s in range(score.shape[0]):
        for i in range(score.shape[1]):
            for p in range(size):
                left = known[i, p] if p < a else extra[i, p - a] * factor[s]
                system[p, size] += left * score[s, i]
                for j in range(score.shape[1]):
                    entry = left * information[s, i, j]
                    for q in range(size):
                        system[p, q] += entry * (known[j, q] if q < a else extra[j, q - a] * factor[s])
    return _eliminate(system, a, step)


@kernel
def _eliminate(system: Array, known: int, step: Array) -> float:
    """Solve a positive definite system (m, m + 1) for all but its first unknowns; chi-square of those."""
    size = system.shape[0]
    chi2 = 0.0
    for p in range(size):
        if not system[p, p] > 0.0:
            return -1.0
        if p >= known:
            chi2 += system[p, size] * system[p, size] / system[p, p]
        for q in range(p + 1, size):
            share = system[q, p] / system[p, p]
            for k in range(p, size + 1):
                system[q, k] -= share * system[p, k]
    for p in range(size - 1, known - 1, -1):
        value = system[p, size]
        for q in range(p + 1, size):
            value -= system[p, q] * step[q - known]
        step[p - known] = value / system[p, p]
    return chi2
