"""How much faster one side of the picture moves than the other: a slanting wall, seen before it spoils the sigma.

A camera at an angle to the wall sees one side move faster.  The fit answers with a mean over the columns in which those
with fine texture count more, and which these are is the wall's secret.  All rows share the columns, so that strips of
rows agree about it: it does not show in their spread.  The two halves of the picture are asked one by one instead, with
the smooth rows of the first, the middle and the last frame.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import LIMITS, WINDOW_VARIANCE, Fit
from axialnav.estimators.positions import climb, motion_basis, position_scores
from axialnav.estimators.spectrum import Band
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
SHARE = 0.12  # of the difference of the halves: standard deviation of what the texture makes of it
FLANK = 0.04  # of the window: half of the width over which one half fades into the other


class Stretch:
    """What the halves last said, for as long as windows hold some of the frames that they were asked about."""

    def __init__(self) -> None:
        self.variance, self._left = 0.0, 0

    def forget(self) -> None:
        """Begin anew."""
        self._left = 0

    def stale(self) -> bool:
        """Whether the halves have to be asked for one more window."""
        self._left -= 1
        return self._left < 0

    def renew(self, variance: float, windows: int) -> None:
        """Take note of a variance [px^2] that is good for so many windows."""
        self.variance, self._left = variance, windows - 1


@lru_cache(maxsize=64)
def half_windows(length: int) -> Plane:
    """Left and right half of a window (2, length) that fade into each other; their squares sum to one.

    Shared: not to be written to.
    """
    flank = max(1.0, FLANK * length)
    rise = np.clip((np.arange(length) - 0.5 * (length - 1)) / (2.0 * flank) + 0.5, 0.0, 1.0)
    return np.stack([np.cos(0.5 * np.pi * rise), np.sin(0.5 * np.pi * rise)]).astype(np.float32)


@kernel
def apply_half_windows(rows: Plane, spans: Index, start: int, windows: Plane, halves: Plane, out: Plane) -> None:
    """Rows of ``spans`` (s, 2) under the windows (s, length) of their strips, left halves first, then zeros.

    ``rows`` (r, w) are read from column ``start`` on; ``out`` (2 m, l) takes the m rows of all spans twice.
    """
    length, many = windows.shape[1], out.shape[0] // 2
    at = 0
    for s in range(spans.shape[0]):
        for r in range(spans[s, 0], spans[s, 1]):
            for half in range(2):
                line = out[half * many + at]
                _multiply(rows[r, start : start + length], windows[s], halves[half], line)
                line[length:] = np.float32(0.0)
            at += 1


@kernel
def _multiply(line: Plane, window: Plane, half: Plane, out: Plane) -> None:
    for c in range(window.shape[0]):
        out[c] = line[c] * window[c] * half[c]


def outer_frames(frames: int) -> Index:
    """Numbers of the first, the middle and the last of some frames, each once."""
    return np.unique(np.array([0, (frames - 1) // 2, frames - 1], dtype=np.int64))


def stretch_variance(re: Plane, im: Plane, band: Band, offset_px: Array, fit: Fit) -> float:
    """Variance of the displacement per frame [px^2] that comes of halves of the picture moving differently.

    Parameters
    ----------
    re, im
        Pair products of both halves, of the frames of :func:`outer_frames`, shape (2, 1, p, f).
    band
        Their frequencies, those of ``fit``.
    offset_px
        Where the windows of these frames start [px], shape (k,).
    fit
        Of the whole picture; its weights of smooth rows are taken.
    """
    frames = fit.score.shape[1]
    basis = np.ascontiguousarray(motion_basis(frames, len(fit.motion) == 2)[outer_frames(frames)])
    weight, many = fit.weight[:1].astype(np.float32), len(basis)
    place, omega = np.arange(re.shape[2]), band.omega()
    level = basis[:, 1:] @ fit.motion[1:]
    found, variance = np.empty(2), 0.0
    score, information = np.empty((1, many)), np.empty((1, many, many))
    for half in range(2):
        motion = fit.motion[:1].copy()
        if not climb(re[half], im[half], weight, omega, basis[:, :1].copy(), offset_px - level, motion, LIMITS):
            return 0.0
        position = basis[:, 0] * motion[0] + level - offset_px
        whole, coherence = slice(half, half + 1), np.empty((1, len(place)))
        position_scores(re[whole], im[whole], place, weight, omega, position, score, information, coherence)
        found[half] = motion[0]
        variance += WINDOW_VARIANCE / max(float(basis[:, 0] @ information[0] @ basis[:, 0]), 1e-12)
    return SHARE**2 * max(0.0, float(found[1] - found[0]) ** 2 - variance)
