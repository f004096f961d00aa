r"""Pixel motion: how far the image of a static surface moves over a window, in pixels.

A wall point on the optical axis at distance Z moves in the image with

.. math::
    \dot u = -f_x \left( \frac{v_{S,x}}{Z} + \omega_{S,y} \right), \qquad
    \dot v = -f_y \left( \frac{v_{S,y}}{Z} - \omega_{S,x} \right)

(S: camera axes; v and omega of the camera itself, so the lever arm enters).  Over a window T the content moves by
``(1 + k) T`` times that, with the blur scale k as a state.  The reading stays in pixels: dividing by a noisy distance
first would correlate it with the range finder and make its noise depend on speed.

Source: Longuet-Higgins and Prazdny (1980), eq. 2.7-2.8, at the image centre.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Integer, kernel
from axialnav.models.ray import distance_along_ray
from axialnav.models.state import (
    BLUR_SCALE,
    E_ATT,
    E_BLUR_SCALE,
    E_GYRO_BIAS,
    E_POS,
    E_VEL,
    E_WALL_OFFSET,
    GYRO_BIAS,
    VEL,
)

Array = NDArray[np.float64]
MIN_COSINE = 0.5  # beyond 60 degrees from the normal the surface is not the one in view
MIN_DISTANCE_M = 0.03


@kernel
def pixel_motion(
    x: Array,
    p_W: Array,
    R_WB: Array,
    gyro_rad_s: Array,
    R_BS: Array,
    lever_B: Array,
    normal_W: Array,
    offset_m: float,
    offset_is_state: bool,
    focal_window: Array,
    axis: Integer,
    H: Array,
    work: Array,
) -> float:
    """Predict the displacement [px] along image axis 0 (x) or 1 (y) and write its Jacobian row into ``H`` (18,).

    ``focal_window`` (2,) is focal length times window [px s] per image axis; ``work`` (8,) is scratch.  Returns NaN
    where the optical axis does not meet the surface (blind, not wrong).
    """
    if not distance_along_ray(p_W, R_WB, lever_B, R_BS[:, 2], normal_W, offset_m, work) > MIN_COSINE:
        return np.nan
    distance = work[0]
    if distance < MIN_DISTANCE_M:
        return np.nan
    # image x sees rotation about sensor y, image y the opposite rotation about sensor x
    along = R_BS[:, axis]
    about = R_BS[:, 1 - axis]
    turn = 1.0 - 2.0 * axis
    v0 = R_WB[0, 0] * x[VEL] + R_WB[1, 0] * x[VEL + 1] + R_WB[2, 0] * x[VEL + 2]
    v1 = R_WB[0, 1] * x[VEL] + R_WB[1, 1] * x[VEL + 1] + R_WB[2, 1] * x[VEL + 2]
    v2 = R_WB[0, 2] * x[VEL] + R_WB[1, 2] * x[VEL + 1] + R_WB[2, 2] * x[VEL + 2]
    w0 = gyro_rad_s[0] - x[GYRO_BIAS]
    w1 = gyro_rad_s[1] - x[GYRO_BIAS + 1]
    w2 = gyro_rad_s[2] - x[GYRO_BIAS + 2]
    # (lever x along) appears both in the speed of the camera and in its derivative by the gyro bias
    l0 = lever_B[1] * along[2] - lever_B[2] * along[1]
    l1 = lever_B[2] * along[0] - lever_B[0] * along[2]
    l2 = lever_B[0] * along[1] - lever_B[1] * along[0]
    speed = along[0] * v0 + along[1] * v1 + along[2] * v2 + w0 * l0 + w1 * l1 + w2 * l2
    rate = about[0] * w0 + about[1] * w1 + about[2] * w2
    gain = focal_window[axis] * (1.0 + x[BLUR_SCALE])
    per_speed = -gain / distance
    per_distance = gain * speed / (distance * distance)
    for i in range(3):
        H[E_POS + i] = per_distance * work[1 + i]
        H[E_VEL + i] = per_speed * (R_WB[i, 0] * along[0] + R_WB[i, 1] * along[1] + R_WB[i, 2] * along[2])
        H[E_ATT + i] = per_distance * work[4 + i]
    H[E_ATT] += per_speed * (along[1] * v2 - along[2] * v1)
    H[E_ATT + 1] += per_speed * (along[2] * v0 - along[0] * v2)
    H[E_ATT + 2] += per_speed * (along[0] * v1 - along[1] * v0)
    H[E_GYRO_BIAS] = -per_speed * l0 + gain * turn * about[0]
    H[E_GYRO_BIAS + 1] = -per_speed * l1 + gain * turn * about[1]
    H[E_GYRO_BIAS + 2] = -per_speed * l2 + gain * turn * about[2]
    flow = -gain * (speed / distance + turn * rate)
    H[E_BLUR_SCALE] = flow / (1.0 + x[BLUR_SCALE])
    if offset_is_state:
        H[E_WALL_OFFSET] = per_distance * work[7]
    return float(flow)
