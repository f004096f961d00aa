"""What recovery from lock-out is made of: how far a source is trusted, and moving the position to it.

Only the position is moved, its covariance opened and its correlations cut; velocity and tilt are never reset by UWB.
When and where to is the supervisor's to say (:mod:`.supervise`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_POS, N_ERROR, POS

Array = NDArray[np.float64]
SILENCE_S = 1.0
TRUST_TIME_S = 0.5
TRUSTED = 0.2  # mean weight below which a source counts as refused
FLOW_FRESH_S = 1.0
MAX_CONDITION = 1e6


@kernel
def note_trust(t_ns: int, gap_s: float, time_s: float, weight: float, seen: Record) -> None:
    """Add one reading to the mean weight of its source, time constant ``time_s``."""
    blend = min(min(max(gap_s, 0.0), 1.0) / time_s, 1.0)
    seen.trust += blend * (weight - seen.trust)
    if seen.trust > TRUSTED or gap_s > SILENCE_S:
        seen.t_trusted = t_ns  # silence is no refusal: patience starts with the first reading after it


@kernel
def move_position(t_ns: int, offset: Array, m: Record) -> None:
    """Shift the position of both filters by ``offset`` (3,) [m]; count it and keep it for those who ask."""
    for row in range(2):
        _move(offset, m.x[row], m.P[row])
    for a in range(3):
        m.last_reset_m[a] = offset[a]
    m.resets += 1
    m.t_reset = t_ns


@kernel
def _move(offset: Array, x: Array, P: Array) -> None:
    """Shift the position and forget what it was correlated with; variance at least a quarter of the jump squared."""
    for a in range(3):
        x[POS + a] += offset[a]
        i = E_POS + a
        variance = max(P[i, i], 0.25 * offset[a] * offset[a])
        for k in range(N_ERROR):
            P[i, k] = 0.0
            P[k, i] = 0.0
        P[i, i] = variance


@kernel
def solve_symmetric(A: Array, b: Array, x: Array) -> bool:
    """Solve the symmetric positive definite 3x3 system ``A x = b``; False where ``A`` is close to singular.

    Cholesky factors by hand: the library's solver takes two seconds to compile for three unknowns.
    """
    largest = max(A[0, 0], max(A[1, 1], A[2, 2]))
    d0 = A[0, 0]
    if not d0 * MAX_CONDITION > largest:
        return False
    l10, l20 = A[1, 0] / d0, A[2, 0] / d0
    d1 = A[1, 1] - l10 * A[1, 0]
    if not d1 * MAX_CONDITION > largest:
        return False
    l21 = (A[2, 1] - l20 * A[1, 0]) / d1
    d2 = A[2, 2] - l20 * A[2, 0] - l21 * l21 * d1
    if not d2 * MAX_CONDITION > largest:
        return False
    y1 = b[1] - l10 * b[0]
    y2 = b[2] - l20 * b[0] - l21 * y1
    x[2] = y2 / d2
    x[1] = y1 / d1 - l21 * x[2]
    x[0] = b[0] / d0 - l10 * x[1] - l20 * x[2]
    return True
