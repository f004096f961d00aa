r"""Whether frames follow each other evenly, told by the frames themselves.

A slow comb, half a ridge in view, looks alike with a frame missing.  The frames do not: neighbours that are two periods
apart differ as much as every second frame does.  With :math:`a_k` the
transforms of the rows of frame k,

.. math::
    D_k = \sum (a_{k+1} - a_k)^2, \qquad D'_k = \sum (a_{k+2} - a_k)^2

are all alike if the motion is even, whatever the noise, and the mean of :math:`D'` exceeds that of D by what one period
more adds.  A missing frame lifts one D by two fifths of that on a wall that is smooth over a step, by half on one with
edges; on a wall without likeness over a step D' is no larger than D, and nothing is told.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.copies import Copies
from axialnav.estimators.spectral.picture import FIRST_BIN
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
MOST_UNLIKE = 0.2  # half of what a missing frame does
SURE = 3.0  # standard deviations; with a frame missing it is -7 at best
PARTS = 32
LEAST_FRAMES = 3  # of two none can be missing


@kernel
def step_powers(packed: Plane, edges: NDArray[np.int64], first: int, count: int, near: Array, far: Array) -> None:
    """Squared differences of neighbours (N - 1, s) and of every second frame (N - 2, s) over parts of the rows.

    ``packed`` (N, r, l) are transforms as OpenCV packs them; ``count`` frequencies from ``first`` on take part.
    """
    low, high, frames = 2 * first - 1, 2 * (first + count) - 1, packed.shape[0]
    sums = np.empty((2 * frames - 3, high - low), dtype=np.float32)
    for s in range(edges.shape[0] - 1):
        sums[:, :] = np.float32(0.0)
        for r in range(edges[s], edges[s + 1]):
            for k in range(2 * frames - 3):
                step = 1 if k < frames - 1 else 2
                start = k if step == 1 else k - (frames - 1)
                one, other, out = packed[start, r, low:high], packed[start + step, r, low:high], sums[k]
                for c in range(high - low):
                    out[c] += (other[c] - one[c]) * (other[c] - one[c])
        for k in range(frames - 1):
            near[k, s] = sums[k].sum()
        for k in range(frames - 2):
            far[k, s] = sums[frames - 1 + k].sum()


def surely_even(copies: Copies) -> bool:
    """Whether a missing frame is ruled out."""
    if copies.frames < LEAST_FRAMES:
        return True
    frames, rows, _ = copies.packed.shape
    edges = np.linspace(0, rows, min(PARTS, rows) + 1).astype(np.int64)
    near, far = np.empty((frames - 1, len(edges) - 1)), np.empty((frames - 2, len(edges) - 1))
    step_powers(copies.packed, edges, FIRST_BIN, len(copies.frequency), near, far)
    usual = near.mean(axis=0)
    unlike = near - usual
    room = MOST_UNLIKE * (far.mean(axis=0) - usual) - np.concatenate([unlike, -unlike])
    spread = np.sqrt(room.shape[1]) * room.std(axis=1, ddof=1)
    return bool((room.sum(axis=1) > SURE * spread).all())
