"""The estimate as the messages that ArduPilot and PX4 accept.

ODOMETRY: pose in LOCAL_FRD (20), velocity in BODY_FRD (12), estimator type VIO (3), covariances of 21 numbers, diagonal
at 0, 6, 11, 15, 18, 20.  VISION_POSITION_DELTA: body FRD deltas, for ArduPilot where only the velocity is known.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.live.axes import (
    FLIP,
    cross_matrix,
    euler_from_body_errors,
    euler_of,
    local_from_corridor,
    quaternion_local_frd,
    upper_triangle,
)
from axialnav.fusion.live.core import Snapshot
from axialnav.fusion.live.dialect import Message, mavlink
from axialnav.fusion.outcome import AxialState
from axialnav.models.rotations import rotation_matrix
from axialnav.models.state import E_ATT, E_GYRO_BIAS, E_POS, E_VEL

Array = NDArray[np.float64]
Content = Literal["full", "velocity", "axial"]
FRAME_LOCAL_FRD: int = mavlink.MAV_FRAME_LOCAL_FRD
FRAME_BODY_FRD: int = mavlink.MAV_FRAME_BODY_FRD
ESTIMATOR_VIO: int = mavlink.MAV_ESTIMATOR_TYPE_VIO
SIGMA_FLOOR_M = 0.1
SIGMA_FLOOR_M_S = 0.05
SIGMA_FLOOR_RAD = math.radians(1.0)
SIGMA_RATE_RAD_S = 0.02
LATERAL_VARIANCE = 25.0  # [m^2/s^2] "not known" to PX4, which reads variances axis by axis
DELTA_SIGMA_MIN_M_S, DELTA_SIGMA_MAX_M_S = 0.1, 0.9  # ArduPilot's EK3_VIS_VERR_MIN and _MAX


def odometry(
    snapshot: Snapshot, axis: Array, heading_rad: float, content: Content, quality: int, reset_counter: int
) -> Message:
    """ODOMETRY of a snapshot.

    Parameters
    ----------
    snapshot
        Estimate at the instant of sending.
    axis
        Unit vector along the corridor, shape (3,).
    heading_rad
        Direction of the corridor's x axis in the local frame.
    content
        ``"full"``; ``"velocity"``: position NaN; ``"axial"``: position NaN and variances across the axis of 25 or more.
    quality
        0 .. 100 per cent.
    reset_counter
        0 .. 255.
    """
    state = snapshot.state
    R_WB = rotation_matrix(state.quaternion_WB)
    q = quaternion_local_frd(state.quaternion_WB, heading_rad)
    velocity = FLIP @ R_WB.T @ state.velocity_m_s
    if content == "full":
        x, y, z = (float(c) for c in local_from_corridor(heading_rad) @ state.position_m)
        pose = upper_triangle(pose_covariance(state, heading_rad, euler_of(q)))
    else:
        x = y = z = math.nan
        pose = [math.nan] * 21
    twist = np.zeros((6, 6))
    twist[:3, :3] = velocity_covariance(state, R_WB, axis if content == "axial" else None)
    twist[3:, 3:] = rate_covariance(state)
    rates = FLIP @ snapshot.rate_rad_s
    return mavlink.MAVLink_odometry_message(
        microseconds(state.t_ns),
        FRAME_LOCAL_FRD,
        FRAME_BODY_FRD,
        *(x, y, z),
        [float(c) for c in q],
        *(float(c) for c in velocity),
        *(float(c) for c in rates),
        pose,
        upper_triangle(twist),
        reset_counter=reset_counter,
        estimator_type=ESTIMATOR_VIO,
        quality=quality,
    )


def position_delta(before: Snapshot, now: Snapshot) -> Message:
    """VISION_POSITION_DELTA from one snapshot to the next.

    The displacement is the mean velocity times the time, not a difference of positions: a position that is corrected
    meanwhile must not look like motion.
    """
    seconds = (now.state.t_ns - before.state.t_ns) * 1e-9
    R_before, R_now = rotation_matrix(before.state.quaternion_WB), rotation_matrix(now.state.quaternion_WB)
    mean_W = 0.5 * (before.state.velocity_m_s + now.state.velocity_m_s)
    moved = FLIP @ (R_before.T @ mean_W) * seconds
    turned = FLIP @ rotation_vector(R_before.T @ R_now)
    return mavlink.MAVLink_vision_position_delta_message(
        microseconds(now.state.t_ns),
        microseconds(now.state.t_ns) - microseconds(before.state.t_ns),
        [float(c) for c in turned],
        [float(c) for c in moved],
        delta_confidence(now.state),
    )


def delta_confidence(state: AxialState) -> float:
    """Confidence [%] that makes ArduPilot assume the standard deviation of our worst velocity axis."""
    sigma = math.sqrt(float(np.linalg.eigvalsh(state.covariance[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3]).max()))
    share = (DELTA_SIGMA_MAX_M_S - sigma) / (DELTA_SIGMA_MAX_M_S - DELTA_SIGMA_MIN_M_S)
    return 100.0 * min(max(share, 0.0), 1.0)


def pose_covariance(state: AxialState, heading_rad: float, euler: tuple[float, float, float]) -> Array:
    """Covariance of x, y, z [m] in the local frame and roll, pitch, yaw [rad], shape (6, 6)."""
    J = np.zeros((6, state.covariance.shape[0]))
    J[:3, E_POS : E_POS + 3] = local_from_corridor(heading_rad)
    J[3:, E_ATT : E_ATT + 3] = euler_from_body_errors(euler[0], euler[1]) @ FLIP
    covariance: Array = J @ state.covariance @ J.T
    return floored(covariance, [SIGMA_FLOOR_M] * 3 + [SIGMA_FLOOR_RAD] * 3)


def velocity_covariance(state: AxialState, R_WB: Array, only_axis: Array | None = None) -> Array:
    """Covariance of the velocity in body FRD [m^2/s^2], shape (3, 3).

    With ``only_axis`` (unit vector, corridor frame) everything across it is declared unknown.
    """
    v_B = R_WB.T @ state.velocity_m_s
    J = np.zeros((3, state.covariance.shape[0]))
    J[:, E_VEL : E_VEL + 3] = R_WB.T
    J[:, E_ATT : E_ATT + 3] = cross_matrix(v_B)  # v_B turns against the body's own error
    covariance: Array = FLIP @ J @ state.covariance @ J.T @ FLIP
    if only_axis is not None:
        a = FLIP @ R_WB.T @ only_axis
        along = np.outer(a, a)
        covariance = along * float(a @ covariance @ a) + LATERAL_VARIANCE * (np.eye(3) - along)
    return floored(covariance, [SIGMA_FLOOR_M_S] * 3)


def rate_covariance(state: AxialState) -> Array:
    """Covariance of the angular rates in body FRD [rad^2/s^2], shape (3, 3)."""
    bias = state.covariance[E_GYRO_BIAS : E_GYRO_BIAS + 3, E_GYRO_BIAS : E_GYRO_BIAS + 3]
    covariance: Array = FLIP @ bias @ FLIP + SIGMA_RATE_RAD_S**2 * np.eye(3)
    return covariance


def floored(covariance: Array, sigmas: list[float]) -> Array:
    """Symmetric copy with no variance below its floor; raising a diagonal keeps a covariance a covariance."""
    even = 0.5 * (covariance + covariance.T)
    diagonal = np.arange(len(sigmas))
    even[diagonal, diagonal] = np.maximum(even[diagonal, diagonal], np.square(sigmas))
    return even


def rotation_vector(R: Array) -> Array:
    """Rotation vector [rad] of a rotation by less than half a turn, shape (3,)."""
    axial = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = float(np.linalg.norm(axial))
    angle = math.atan2(sine, 0.5 * (float(np.trace(R)) - 1.0))
    scaled: Array = axial * (angle / sine if sine > 1e-9 else 1.0)
    return scaled


def microseconds(t_ns: int) -> int:
    """Stamp of our one clock as the messages carry it."""
    return t_ns // 1000


def heartbeat() -> Message:
    """We are an onboard controller, and active."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
        0,
        0,
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


def message_interval(system: int, component: int, message_id: int, rate_hz: float) -> Message:
    """Ask for a message at a rate (MAV_CMD_SET_MESSAGE_INTERVAL)."""
    values: tuple[Any, ...] = (message_id, round(1e6 / rate_hz), 0, 0, 0, 0, 0)
    return mavlink.MAVLink_command_long_message(system, component, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *values)
