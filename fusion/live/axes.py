"""The MAVLink edge: our axes (body FLU, corridor x along, y left, z up) to and from FRD and NED, and nowhere else.

The corridor's heading psi is the direction of its x axis, clockwise from north [rad]; psi = 0 makes the local frame
of the messages the corridor's own (x along, y right, z down).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]
FLIP = np.diag([1.0, -1.0, -1.0])  # FLU <-> FRD, its own inverse
UPPER = np.triu_indices(6)


def flipped(x: float, y: float, z: float) -> Vector3:
    """A vector in FRD axes given in FLU axes, or the other way round."""
    return float(x), -float(y), -float(z)


def local_from_corridor(heading_rad: float) -> Array:
    """Matrix that takes corridor coordinates to the local frame of the messages (NED where the heading is stated)."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])


def quaternion_local_frd(q_WB: Array, heading_rad: float) -> Array:
    """Attitude of body FRD in the local frame, Hamilton, scalar first, unit length; shape (4,)."""
    w, x, y, z = (float(c) for c in q_WB)
    y, z = -y, -z
    c, s = math.cos(0.5 * heading_rad), math.sin(0.5 * heading_rad)
    q = np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])
    unit: Array = q / np.linalg.norm(q)
    return unit


def euler_of(q: Array) -> Vector3:
    """Roll, pitch and yaw [rad] of a quaternion, aerospace order."""
    w, x, y, z = (float(c) for c in q)
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def euler_from_body_errors(roll_rad: float, pitch_rad: float) -> Array:
    """Matrix from a small rotation in body axes to the change of roll, pitch and yaw, shape (3, 3)."""
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    cp = math.cos(pitch_rad)
    cp = math.copysign(max(abs(cp), 1e-3), cp)  # straight up or down, yaw is not defined
    t = math.sin(pitch_rad) / cp
    return np.array([[1.0, s * t, c * t], [0.0, c, -s], [0.0, s / cp, c / cp]])


def cross_matrix(v: Array) -> Array:
    """Matrix of the cross product with ``v``, shape (3, 3)."""
    x, y, z = (float(c) for c in v)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def upper_triangle(covariance: Array) -> list[float]:
    """The 21 numbers in which MAVLink sends a symmetric 6x6 matrix."""
    return [float(v) for v in covariance[UPPER]]
