"""Objects fixed to the camera: found where the picture repeats without moving, and kept out of the windows.

In every cell (a strip of rows by a few columns) the frames are summed twice: as they are, and shifted so that the wall
stands still.  The wall is strong in the second sum, an object in the first.  What is hidden in any frame is left out of
the windows of all frames, so that they still show one and the same piece of wall.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import kernel

Plane = NDArray[np.float32]
Array = NDArray[np.float64]
CELL_PX = 16
FLANK_PX = 12
SURE = 5.0
LEAST_TRAVEL_PX = 1
LEAST_SHARE = 0.3


@kernel
def _cell_power(plane: Plane, edges: NDArray[np.int64], out: Array) -> None:
    """Sum of squares in every cell (s, b)."""
    column = np.empty(plane.shape[1], dtype=np.float32)
    for s in range(out.shape[0]):
        column[:] = np.float32(0.0)
        for r in range(edges[s], edges[s + 1]):
            line = plane[r]
            for c in range(column.shape[0]):
                column[c] += line[c] * line[c]
        for b in range(out.shape[1]):
            out[s, b] = column[b * CELL_PX : (b + 1) * CELL_PX].sum()


class OccluderFinder:
    """Buffers for binned frames of one size.

    Parameters
    ----------
    rows, width
        Size of the binned frames.
    edges
        First row of every strip and the end, shape (s + 1,).
    """

    def __init__(self, rows: int, width: int, edges: NDArray[np.int64]) -> None:
        self._edges, self._cells = edges, width // CELL_PX
        self._sum = np.zeros((rows, width), dtype=np.float32)

    def hidden(self, planes: list[Plane], offset: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Cells (s, b) in which something stands still before a wall that moves by ``offset`` [px] per frame (n,)."""
        none = np.zeros((len(self._edges) - 1, self._cells), dtype=np.bool_)
        if int(np.ptp(offset)) < LEAST_TRAVEL_PX:
            return none
        still = self._powers(planes, np.zeros_like(offset))
        moving = self._powers(planes, offset)
        one = np.empty(none.shape)
        _cell_power(planes[0], self._edges, one)
        samples = np.diff(self._edges)[:, None] * CELL_PX
        usual = float(np.median(one / samples)) * samples
        sure = SURE * usual * np.sqrt(2.0 / samples)
        return np.asarray((still - moving > sure) & (still - usual > sure))

    def _powers(self, planes: list[Plane], offset: NDArray[np.int64]) -> Array:
        """Power per cell of the sum of the shifted frames over the root of their number: noise keeps its power."""
        self._sum[:] = 0.0
        width = self._sum.shape[1]
        count = np.zeros(width, dtype=np.float32)
        for plane, shift in zip(planes, offset - (offset.min() + offset.max()) // 2, strict=True):
            low, high = max(0, -int(shift)), min(width, width - int(shift))
            self._sum[:, low:high] += plane[:, low + int(shift) : high + int(shift)]
            count[low:high] += 1.0
        self._sum /= np.sqrt(np.maximum(count, 1.0))
        out = np.empty((len(self._edges) - 1, self._cells))
        _cell_power(self._sum, self._edges, out)
        return out


def wall_window(hidden: NDArray[np.bool_], starts: NDArray[np.int64], window: Plane) -> tuple[Plane, Array]:
    """Windows of all strips without what is hidden in any frame, and the share of power they keep.

    Parameters
    ----------
    hidden
        Cells (s, b).
    starts
        First column of the window in every frame, shape (n,).
    window
        Window without gaps, shape (length,).

    Returns
    -------
    windows
        Shape (s, length).
    share
        Shape (s,).
    """
    columns = np.repeat(hidden, CELL_PX, axis=1)
    length, strips = len(window), len(hidden)
    blocked = np.zeros((strips, length), dtype=np.bool_)
    for start in starts.tolist():
        seen = columns[:, start : start + length]
        blocked[:, : seen.shape[1]] |= seen
    free = cv2.erode((~blocked).astype(np.float32), np.ones((1, 2 * FLANK_PX + 1), dtype=np.uint8))
    soft = cv2.blur(free, (2 * FLANK_PX + 1, 1))
    windows = np.asarray(soft * window[None], dtype=np.float32)
    share = np.sum(windows.astype(np.float64) ** 2, axis=1) / float(np.sum(window.astype(np.float64) ** 2))
    return windows, share
