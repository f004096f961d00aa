r"""Roll of the camera from frame to frame: it moves the upper strips one way and the lower ones the other.

A small roll :math:`\phi_k` of frame k about the optical axis adds :math:`y_s \phi_k` to the position of a strip at the
height :math:`y_s`.  It is found from the strips' scores, and taken out of the products by a turn of their phases.

Scores only tell of a fraction of a pixel.  A camera that rolls steadily puts the peaks of the search's bands on a line
over their height; that line is where the steps begin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.extra import extra_step
from axialnav.estimators.joint import WINDOW_VARIANCE, Fit
from axialnav.estimators.positions import free_positions, motion_basis, relative_turn, turns
from axialnav.estimators.products import Products
from axialnav.estimators.search import SOFTENING, TINY, Profiles
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Index = NDArray[np.int64]
CHI2_OFFSET, CHI2_PER_DOF = 16.0, 3.5
MAX_STEP_PX = 0.6
ENOUGH_BANDS, SURE_BAND = 4, 6.0  # bands that must have a peak, in standard deviations of unrelated frames
LEAST_SPREAD_PX, OFF_LINE_PX = 0.2, 0.2
BETTER = 8.0  # softened log-likelihood that the line must gain


def roll_step(fit: Fit, height: Array) -> Array | None:
    """Gauss-Newton step of the shift that roll gives a strip at height 1, per frame [px]; None if not significant.

    ``height`` (s,) is the place of every strip, from -1 at the top to 1 at the bottom.
    """
    frames = fit.score.shape[1]
    known, free = motion_basis(frames, len(fit.motion) == 2), free_positions(frames, 0)
    step = np.zeros(frames - 1)
    chi2 = extra_step(fit.score, fit.information, height, known, free, step) / WINDOW_VARIANCE
    if chi2 < CHI2_OFFSET + CHI2_PER_DOF * (frames - 1):
        return None
    shift = free @ step
    return np.asarray(shift * min(1.0, MAX_STEP_PX / float(np.abs(shift).max())))


def steady_roll(found: Profiles, index: int, height: Array) -> float:
    """Displacement per frame at height 1 less that in the middle [px], where the bands' peaks lie on a line; else 0.

    Parameters
    ----------
    found
        Likelihoods of the bands.
    index
        Grid point that was chosen for all of them.
    height
        Place of every band, from -1 at the top to 1 at the bottom, shape (b,).
    """
    gain, best = found.gain, found.gain.max(axis=1)
    sure = best > SURE_BAND * found.spread
    if int(sure.sum()) < ENOUGH_BANDS or float((best - gain[:, index])[sure].sum()) < BETTER * SOFTENING:
        return 0.0
    gain, place, step = gain[sure], gain[sure].argmax(axis=1), float(found.grid_px[1] - found.grid_px[0])
    if place.min() == 0 or place.max() == gain.shape[1] - 1:
        return 0.0
    left, middle, right = (gain[np.arange(len(gain)), place + k].astype(np.float64) for k in (-1, 0, 1))
    peak = found.grid_px[place] + 0.5 * step * (right - left) / np.maximum(2.0 * middle - left - right, TINY)
    lever = height[sure] - height[sure].mean()
    slope = float(lever @ peak / (lever @ lever))
    if np.ptp(peak) < LEAST_SPREAD_PX or np.abs(peak - peak.mean() - slope * lever).max() > OFF_LINE_PX:
        return 0.0
    level = replace(found, gain=gain).sheared(slope * lever).everyone.max() - gain.sum(axis=0).max()
    return slope if level > BETTER * SOFTENING else 0.0


def unrolled(products: Products, shift_px: Array) -> Products:
    """The products as if frame k had not been rolled by ``shift_px[k]`` at height 1."""
    re, im = products.re.copy(), products.im.copy()
    _turn(re, im, products.place, products.band.omega(), products.height, shift_px)
    return replace(products, re=re, im=im, known=None)


@kernel
def _turn(re: Plane, im: Plane, place: Index, omega: Array, height: Array, shift: Array) -> None:
    """Multiply products (s, c, p, f) by ``exp(i w y_s (x_i - x_j))``."""
    frames, count = shift.shape[0], omega.shape[0]
    cosine, sine = np.empty((frames, count), dtype=np.float32), np.empty((frames, count), dtype=np.float32)
    c, d = np.empty(count, dtype=np.float32), np.empty(count, dtype=np.float32)
    for s in range(re.shape[0]):
        turns(omega, height[s] * shift, cosine, sine)
        p = 0
        for i in range(frames):
            for j in range(i + 1, frames):
                relative_turn(cosine, sine, i, j, c, d)
                for k in range(re.shape[1]):
                    _rotate(re[s, k, place[p]], im[s, k, place[p]], c, d)
                p += 1


@kernel
def _rotate(re: Plane, im: Plane, c: Plane, d: Plane) -> None:
    """Multiply ``re + i im`` (f,) by ``c + i d``."""
    for f in range(c.shape[0]):
        a, b = re[f], im[f]
        re[f] = a * c[f] - b * d[f]
        im[f] = a * d[f] + b * c[f]
