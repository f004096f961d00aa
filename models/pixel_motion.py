r"""Pixel motion: how far the image of a static surface moves over a window, in pixels.

A wall point on the optical axis at distance Z moves in the image with

.. math::
    \dot u = -f_x \left( \frac{v_{S,x}}{Z} + \omega_{S,y} \right), \qquad
    \dot v = -f_y \left( \frac{v_{S,y}}{Z} - \omega_{S,x} \right)

(S: camera axes; v and omega of the camera itself, so the lever arm enters).  Beside the axis, where the ray through the
image has the slope a = x / f, it moves with

.. math::
    \dot u = -f_x \left( \frac{v_{S,x} - a v_{S,z}}{Z(a)} + (1 + a^2) \omega_{S,y} \right),
    \qquad
    \dot v = -f_y \left( \frac{v_{S,y}}{Z(a)} - \omega_{S,x} + a \, \omega_{S,z} \right)

Over a window T the content moves by ``(1 + k) T`` times that, with the blur scale k as a state.
The reading stays in pixels: dividing by a noisy distance first would correlate it with the range finder and make its
noise depend on speed.

Source: Longuet-Higgins and Prazdny (1980), eq. 2.7-2.8, on the image axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.faces import GRAZING
from axialnav.models.jit import Integer
from axialnav.models.ray import distance_along_ray
from axialnav.models.scalar_kernel import kernel
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
    slope: float,
    H: Array,
    work: Array,
) -> float:
    """Predict the displacement [px] along image axis 0 (x) or 1 (y) and write its Jacobian row into ``H`` (25,).

    The place in the image is on the x axis, where the ray has this ``slope`` against the optical axis.
    ``focal_window`` (2,) is focal length times window [px s] per image axis; ``work`` (11,) is scratch.  Returns NaN
    where the ray does not meet the surface (blind, not wrong).
    """
    ray_B = work[8:11]
    ray_B[0], ray_B[1], ray_B[2] = _mixed(R_BS, 2, 0, slope)
    limit = MIN_COSINE if slope == 0.0 else GRAZING
    if not distance_along_ray(p_W, R_WB, lever_B, ray_B, normal_W, offset_m, work) > limit:
        return np.nan
    distance = work[0]
    if distance < MIN_DISTANCE_M:
        return np.nan
    a0, a1, a2 = _mixed(R_BS, axis, 2, -slope * (1.0 - axis))
    b0, b1, b2 = _turned_about(R_BS, axis, slope)
    v0, v1, v2 = _in_body(R_WB, x[VEL], x[VEL + 1], x[VEL + 2])
    w0, w1, w2 = gyro_rad_s[0] - x[GYRO_BIAS], gyro_rad_s[1] - x[GYRO_BIAS + 1], gyro_rad_s[2] - x[GYRO_BIAS + 2]
    # (lever x a) appears both in the speed of the camera and in its derivative by the gyro bias
    l0, l1, l2 = _cross(lever_B[0], lever_B[1], lever_B[2], a0, a1, a2)
    speed = a0 * v0 + a1 * v1 + a2 * v2 + w0 * l0 + w1 * l1 + w2 * l2
    rate = b0 * w0 + b1 * w1 + b2 * w2
    gain = focal_window[axis] * (1.0 + x[BLUR_SCALE])
    per_speed = -gain / distance
    per_distance = gain * speed / (distance * distance)
    for i in range(3):
        H[E_POS + i] = per_distance * work[1 + i]
        H[E_VEL + i] = per_speed * (R_WB[i, 0] * a0 + R_WB[i, 1] * a1 + R_WB[i, 2] * a2)
        H[E_ATT + i] = per_distance * work[4 + i]
    t0, t1, t2 = _cross(a0, a1, a2, v0, v1, v2)
    H[E_ATT] += per_speed * t0
    H[E_ATT + 1] += per_speed * t1
    H[E_ATT + 2] += per_speed * t2
    H[E_GYRO_BIAS] = -per_speed * l0 + gain * b0
    H[E_GYRO_BIAS + 1] = -per_speed * l1 + gain * b1
    H[E_GYRO_BIAS + 2] = -per_speed * l2 + gain * b2
    flow = -gain * (speed / distance + rate)
    H[E_BLUR_SCALE] = flow / (1.0 + x[BLUR_SCALE])
    if offset_is_state:
        H[E_WALL_OFFSET] = per_distance * work[7]
    return float(flow)


@kernel
def _mixed(R_BS: Array, first: Integer, second: Integer, share: float) -> tuple[float, float, float]:
    """One of a sensor's axes plus a share of another, body coordinates."""
    return (
        R_BS[0, first] + share * R_BS[0, second],
        R_BS[1, first] + share * R_BS[1, second],
        R_BS[2, first] + share * R_BS[2, second],
    )


@kernel
def _turned_about(R_BS: Array, axis: Integer, slope: float) -> tuple[float, float, float]:
    """Rotation vector that an image axis sees, body coordinates.

    Image x sees rotation about sensor y; image y the opposite one about sensor x and, beside the axis, that about z.
    """
    x, y, z = -float(axis), (1.0 - axis) * (1.0 + slope * slope), axis * slope
    return (
        x * R_BS[0, 0] + y * R_BS[0, 1] + z * R_BS[0, 2],
        x * R_BS[1, 0] + y * R_BS[1, 1] + z * R_BS[1, 2],
        x * R_BS[2, 0] + y * R_BS[2, 1] + z * R_BS[2, 2],
    )


@kernel
def _in_body(R_WB: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Body coordinates of a world vector."""
    return (
        R_WB[0, 0] * x + R_WB[1, 0] * y + R_WB[2, 0] * z,
        R_WB[0, 1] * x + R_WB[1, 1] * y + R_WB[2, 1] * z,
        R_WB[0, 2] * x + R_WB[1, 2] * y + R_WB[2, 2] * z,
    )


@kernel
def _cross(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> tuple[float, float, float]:
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
