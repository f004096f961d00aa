"""Whether some columns of a slow picture stand still before the wall.

An upright bar that is fixed to the camera darkens the lines of the comb no more than slower motion would, and all
strips of rows see it alike.  Columns do not: the first and the last frame differ more than neighbours do where the wall
is seen, by the same share of its texture's power everywhere, and no more than neighbours do on the bar.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.copies import Copies
from axialnav.estimators.spectral.picture import row_window
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
BLOCKS, FLANK = 48, 8  # of columns; the outer ones are hardly in the window
LEAST_MOVING = 0.4  # of the usual share
SURE = 3.0  # standard deviations
EVERY = 2  # rows are plenty


@kernel
def block_powers(rows: Plane, edges: NDArray[np.int64], texture: Array, moved: Array) -> None:
    """Power of frames (N, r, l) in blocks of columns, and how much more the first and the last differ than neighbours.

    (r, b) both.
    """
    frames, count, _ = rows.shape
    for r in range(count):
        for b in range(edges.shape[0] - 1):
            power, far, near = 0.0, 0.0, 0.0
            for c in range(edges[b], edges[b + 1]):
                far += (rows[frames - 1, r, c] - rows[0, r, c]) ** 2
                power += rows[0, r, c] ** 2
                for k in range(1, frames):
                    near += (rows[k, r, c] - rows[k - 1, r, c]) ** 2
                    power += rows[k, r, c] ** 2
            texture[r, b] = power / frames
            moved[r, b] = far - near / (frames - 1)


def columns_stand(copies: Copies, noise: float) -> bool:
    """Whether a block of columns moves less than the others; ``noise`` is the power of white noise in ``copies``."""
    length = copies.length
    thin = np.ascontiguousarray(copies.packed[:, ::EVERY])
    flat = thin.reshape(-1, length)
    cv2.dft(flat, dst=flat, flags=cv2.DFT_INVERSE | cv2.DFT_ROWS | cv2.DFT_SCALE)
    edges = np.linspace(0, length, BLOCKS + 1).astype(np.int64)[FLANK : BLOCKS - FLANK + 1]
    texture, moved = np.empty((2, thin.shape[1], len(edges) - 1))
    block_powers(thin, edges, texture, moved)
    level = np.add.reduceat(np.square(row_window(length)[0], dtype=np.float64), edges)[:-1]
    level *= copies.variance_gain * noise
    texture -= level
    usual = float(np.median(moved.sum(axis=0) / np.maximum(texture.sum(axis=0), level)))
    missing = LEAST_MOVING * usual * texture - moved
    spread = np.sqrt(len(missing)) * missing.std(axis=0, ddof=1)
    return bool((missing.sum(axis=0) > SURE * spread).any())
