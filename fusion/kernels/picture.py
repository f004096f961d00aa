r"""What a camera's picture says of its motion as a whole: its columns do not all move alike.

Rotation moves the rim of a wide picture more than its middle, a wall seen at an angle moves less where it is farther
away, and in a corner two walls are in view.  An estimator that aligns frames follows the columns that move alike and
lets go of those that leave them by more than the texture's coherence.  The prediction does the same with the motions
:math:`u_k` of some columns,

.. math::
    u = \frac{\sum_k g_k u_k}{\sum_k g_k}, \qquad g_k = c_k \exp \left( -\frac{(u_k - u)^2}{2 s^2} \right)

solved from the middle column outwards; :math:`c_k` is the share of a column that stays in view over the window.  The
coherence s comes with the reading: it is where the pull of a column that moves otherwise is the strongest.  How far the
columns in use are apart is how little such a mean can be trusted.  What the picture does across is seen in the columns
that the rows follow: the mean with the same weights.

Source: location by weighted means as in Huber and Ronchetti, Robust Statistics (2009), section 4.8, with Welsch's
weight; the shares of the view and of the spread were measured on rendered turns (docs/filter/pixel-motion.md).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.memory import COLUMNS
from axialnav.models.faces import nearest_face
from axialnav.models.jit import Integer, Record
from axialnav.models.pixel_motion import pixel_motion
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import N_ERROR, WALL_OFFSET

Array = NDArray[np.float64]
ROUNDS = 6
VIEW = 0.85  # of what stays in view: windows of frames end in flanks
LEAST_VIEW = 0.5  # stays in view of what an estimator can follow
SPREAD_SHARE = 0.5


@kernel
def look_at_surface(s: Record, x: Array, slope: float, w: Record) -> bool:
    """Write the plane in view: its normal into ``w.normal``, offset and roughness [m] into ``w.plane``.

    It is looked for along the ray with this slope along the image's x axis, which is written into ``w.look``.
    """
    for i in range(3):
        w.look[i] = s.R_BS[i, 2] + slope * s.R_BS[i, 0]
    if s.n_faces == 0:
        for i in range(3):
            w.normal[i] = s.normal_W[i]
        w.plane[0] = x[WALL_OFFSET] if s.offset_is_state else s.offset_m
        w.plane[1] = 0.0
        return True
    face = nearest_face(s.faces, s.n_faces, w.p, w.R, s.lever_B, w.look, w.ray)
    if face < 0:
        return False
    for i in range(3):
        w.normal[i] = s.faces[face, i]
    w.plane[0] = s.faces[face, 3]
    w.plane[1] = s.faces[face, 10]
    return True


@kernel
def motion_at_slope(s: Record, window_s: float, axis: Integer, slope: float, w: Record) -> float:
    """Predict the motion [px] along an image axis at one place on the x axis; its Jacobian row into ``w.H[axis]``."""
    for i in range(2):
        w.focal_window[i] = s.focal_px[i] * window_s
    if not look_at_surface(s, w.x, slope, w):
        return np.nan
    return pixel_motion(
        w.x, w.p, w.R, w.rate, s.R_BS, s.lever_B, w.normal, w.plane[0], s.offset_is_state,
        w.focal_window, axis, slope, w.H[axis], w.ray,
    )  # fmt: skip


@kernel
def motion_of_picture(s: Record, window_s: float, coherence_px: float, axis: Integer, w: Record) -> float:
    """Predict the motion [px] of the whole picture, its Jacobian row, and add to ``w.variance[axis]`` for its spread.

    The columns that count along the rows (axis 0, to be asked first) are those that count across them (axis 1).
    Sensors without a width (flow chips, blur meters) are compared with their optical axis.
    """
    middle = COLUMNS // 2
    centre = motion_at_slope(s, window_s, axis, 0.0, w)
    if s.half_view == 0.0 or not np.isfinite(centre):
        return centre
    w.column[middle] = centre
    for i in range(N_ERROR):
        w.column_H[middle, i] = w.H[axis, i]
    for k in range(COLUMNS):
        if k == middle:
            continue
        w.column[k] = motion_at_slope(s, window_s, axis, s.half_view * (2.0 * k - (COLUMNS - 1)) / COLUMNS, w)
        for i in range(N_ERROR):
            w.column_H[k, i] = w.H[axis, i]
    if axis == 0:
        left = s.periods * abs(centre) / (2.0 * s.half_view * s.focal_px[0])
        motion, variance = _together(coherence_px, VIEW * max(1.0 - left, LEAST_VIEW), w)
    else:
        motion, variance = _weighted(w)
    for i in range(N_ERROR):
        w.H[axis, i] = 0.0
        for k in range(COLUMNS):
            if w.weight[k] > 0.0:  # a column that meets no surface has left no row
                w.H[axis, i] += w.weight[k] * w.column_H[k, i]
    w.variance[axis] += SPREAD_SHARE**2 * variance
    return motion


@kernel
def _weighted(w: Record) -> tuple[float, float]:
    """Mean motion [px] of the columns and the variance among them, with the weights in ``w.weight``."""
    motion, spread = 0.0, 0.0
    for k in range(COLUMNS):
        if w.weight[k] > 0.0:
            motion += w.weight[k] * w.column[k]
    for k in range(COLUMNS):
        if w.weight[k] > 0.0:
            spread += w.weight[k] * (w.column[k] - motion) ** 2
    return motion, spread


@kernel
def _together(coherence_px: float, kept: float, w: Record) -> tuple[float, float]:
    """Motion [px] of the columns that move alike and the variance among them; weights of sum 1 into ``w.weight``.

    ``kept`` is the share of the picture that counts, around its middle.
    """
    motion, spread = w.column[COLUMNS // 2], 0.0
    for _ in range(ROUNDS):
        total, first, second = 0.0, 0.0, 0.0
        for k in range(COLUMNS):
            apart = w.column[k] - motion
            in_view = 0.5 * (COLUMNS * kept + 1.0 - abs(2.0 * k - (COLUMNS - 1)))  # columns are 2 / COLUMNS wide
            alike = math.exp(-0.5 * (apart / coherence_px) ** 2) if np.isfinite(apart) else 0.0
            w.weight[k] = alike * min(max(in_view, 0.0), 1.0)
            if w.weight[k] > 0.0:
                total += w.weight[k]
                first += w.weight[k] * apart
                second += w.weight[k] * apart * apart
        motion += first / total
        spread = second / total
    for k in range(COLUMNS):
        w.weight[k] /= total
    return motion, spread
