r"""Whether frames follow each other evenly, told by the frames themselves.

A slow comb, half a ridge in view, looks alike with a frame missing.  The frames do not: neighbours that are two periods
apart differ as much as every second frame does.  With :math:`a_k` the rows of frame k,

.. math::
    D_k = \sum (a_{k+1} - a_k)^2, \qquad D'_k = \sum (a_{k+2} - a_k)^2

are all alike if the motion is even, whatever the noise, and the mean of :math:`D'` exceeds that of D by what one period
more adds.  A missing frame lifts one D by two fifths of that on a wall that is smooth over a step, by half on one with
edges; on a wall without likeness over a step D' is no larger than D, and nothing is told.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.frames import Image
from axialnav.estimators.spectral.picture import composite_rows

Array = NDArray[np.float64]
MOST_UNLIKE = 0.2  # half of what a missing frame does
SURE = 4.0  # standard deviations
PARTS = 32


def surely_even(stack: list[Image]) -> bool:
    """Whether a missing frame is ruled out for three or more frames of one size, motion along the rows."""
    rows = [composite_rows([frame]).astype(np.float32) for frame in stack]
    rows = [row - row.mean(axis=1, keepdims=True) for row in rows]
    near, far = _differences(rows, 1), _differences(rows, 2)
    usual = near.mean(axis=0)
    unlike = near - usual
    room = MOST_UNLIKE * (far.mean(axis=0) - usual) - np.concatenate([unlike, -unlike])
    spread = np.sqrt(room.shape[1]) * room.std(axis=1, ddof=1)
    return bool((room.sum(axis=1) > SURE * spread).all())


def _differences(rows: list[NDArray[np.float32]], step: int) -> Array:
    """Squared differences of frames so many apart, summed over parts of the rows, shape (k, s)."""
    edges = np.linspace(0, len(rows[0]), min(PARTS, len(rows[0])) + 1).astype(np.int64)[:-1]
    squares = [np.square(b - a).sum(axis=1, dtype=np.float64) for a, b in zip(rows, rows[step:], strict=False)]
    return np.stack([np.add.reduceat(square, edges) for square in squares])
