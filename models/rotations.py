"""Rotations: Hamilton quaternions, scalar first, body to world.

Reference: J. Sola, Quaternion kinematics for the error-state Kalman filter (2017), eq. 101 (exponential), 115 (matrix).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
SMALL_ANGLE_SQUARED = 1e-8  # below, the series is exact to float64


@kernel
def matrix_from_quaternion(w: float, x: float, y: float, z: float, R: Array) -> None:
    """Write the rotation matrix of a unit quaternion into ``R`` (3, 3)."""
    R[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[0, 1] = 2.0 * (x * y - w * z)
    R[0, 2] = 2.0 * (x * z + w * y)
    R[1, 0] = 2.0 * (x * y + w * z)
    R[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[1, 2] = 2.0 * (y * z - w * x)
    R[2, 0] = 2.0 * (x * z - w * y)
    R[2, 1] = 2.0 * (y * z + w * x)
    R[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def rotate_in_body(q: Array, rx: float, ry: float, rz: float) -> None:
    """Right-multiply the quaternion ``q`` (4,) in place by the rotation vector (rx, ry, rz) [rad] and normalise."""
    angle2 = rx * rx + ry * ry + rz * rz
    if angle2 > SMALL_ANGLE_SQUARED:
        angle = math.sqrt(angle2)
        c = math.cos(0.5 * angle)
        s = math.sin(0.5 * angle) / angle
    else:
        c = 1.0 - angle2 / 8.0
        s = 0.5 - angle2 / 48.0
    bx, by, bz = s * rx, s * ry, s * rz
    w, x, y, z = q[0], q[1], q[2], q[3]
    nw = w * c - x * bx - y * by - z * bz
    nx = w * bx + x * c + y * bz - z * by
    ny = w * by - x * bz + y * c + z * bx
    nz = w * bz + x * by - y * bx + z * c
    scale = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    q[0], q[1], q[2], q[3] = nw * scale, nx * scale, ny * scale, nz * scale


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Array:
    """Quaternion of yaw, then pitch, then roll (aerospace order) [rad]; shape (4,), scalar first."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def rotation_matrix(q: Array) -> Array:
    """Rotation matrix of a unit quaternion, shape (3, 3)."""
    R = np.empty((3, 3))
    matrix_from_quaternion(q[0], q[1], q[2], q[3], R)
    return R


def quaternion_from_vector(rotation_rad: Array) -> Array:
    """Quaternion of a rotation vector [rad], shape (4,)."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    rotate_in_body(q, float(rotation_rad[0]), float(rotation_rad[1]), float(rotation_rad[2]))
    return q
