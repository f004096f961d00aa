"""Video compressed in blocks leaves a comb at multiples of an eighth, which looks like motion by 8 pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
BLOCK_PX = 8
FIRM = 1.15
EVERY = 4  # rows are plenty
NOTCH_BINS = 2
LAST_FREQUENCY = 0.3


@kernel
def step_power(rows: NDArray[np.float32], out: Array) -> None:
    """Mean squared difference of neighbouring columns for every column modulo the block, ``out`` (8,)."""
    count = np.zeros(BLOCK_PX)
    out[:] = 0.0
    for r in range(rows.shape[0]):
        for c in range(rows.shape[1] - 1):
            step = rows[r, c + 1] - rows[r, c]
            out[c % BLOCK_PX] += step * step
            count[c % BLOCK_PX] += 1.0
    out /= count


def blocky(rows: NDArray[np.float32]) -> bool:
    """Whether the steps between columns (r, w) are larger at the borders of blocks of 8 px.

    A wall has no reason to prefer one column in eight, whatever its texture and its motion; a codec has.
    """
    steps = np.empty(BLOCK_PX)
    step_power(rows, steps)
    ordered = np.sort(steps)
    return bool(ordered[-1] > FIRM * ordered[-2])


def block_notches(frequency: Array, length: int) -> Mask:
    """Frequencies that a block codec leaves usable, shape (f,): not at k / 8, not the finest ones."""
    distance = np.abs(frequency * BLOCK_PX - np.rint(frequency * BLOCK_PX)) / BLOCK_PX
    return np.asarray((distance * length > NOTCH_BINS) & (frequency < LAST_FREQUENCY))
