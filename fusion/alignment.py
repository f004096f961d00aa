"""The first state: level from gravity, gyro bias from standing still, position from the first UWB readings."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Initial
from axialnav.fusion.errors import FlightError
from axialnav.fusion.events import Events
from axialnav.fusion.memory import Memory, the_imu
from axialnav.fusion.sources import Kind, Records, scale_sigma
from axialnav.models.rotations import quaternion_from_euler, rotation_matrix
from axialnav.models.state import (
    E_ACCEL_BIAS,
    E_ATT,
    E_BLUR_SCALE,
    E_GYRO_BIAS,
    E_POS,
    E_UWB_BIAS,
    E_VEL,
    E_WALL_OFFSET,
    GYRO_BIAS,
    N_ERROR,
    N_NOMINAL,
    POS,
    QUAT,
    VEL,
)

Array = NDArray[np.float64]
UWB_KINDS = (int(Kind.UWB_RANGE), int(Kind.UWB_TDOA), int(Kind.UWB_POSITION))
MIN_STILL_SAMPLES = 5
SIGMA_BIAS_FLOOR_RAD_S = 1e-3
SIGMA_FREE_PLACE_M = 1e-3
SIGMA_YAW_FREE_RAD = 1e-2  # without an absolute frame yaw 0 is where the vehicle looks at the start


class Level(NamedTuple):
    """Result of levelling: angles, mean rate and whether the vehicle stood still (for how long [s])."""

    roll_rad: float
    pitch_rad: float
    gyro_bias_rad_s: Array
    still_s: float


def align(config: Config, src: Records, events: Events, memory: Memory) -> None:
    """Set the first state and covariance in ``memory`` from the events of the first ``start.window_s``.

    Raises
    ------
    FlightError
        No inertial sample, or specific force that cannot be gravity.
    """
    is_imu = src["kind"][events.source] == int(Kind.IMU)
    if not is_imu.any():
        raise FlightError("no inertial samples: the filter is driven by them; check the IMU's data.csv")
    t0 = int(events.t_ns[is_imu][0])
    window = events.t_ns <= t0 + round(config.start.window_s * 1e9)
    source = int(events.source[is_imu][0])
    samples = events.values[is_imu & window]
    level = level_from_gravity(config, events.t_ns[is_imu & window], samples, src["R_BS"][source])
    initial = config.initial or initial_from_uwb(config, src, events, window, level)
    x = np.zeros(N_NOMINAL)
    x[POS : POS + 3] = initial.position_m
    x[VEL : VEL + 3] = initial.velocity_m_s
    x[QUAT : QUAT + 4] = quaternion_from_euler(level.roll_rad, level.pitch_rad, initial.yaw_rad)
    x[GYRO_BIAS : GYRO_BIAS + 3] = level.gyro_bias_rad_s
    memory.core["x"] = x
    memory.core["P"] = np.diag(_first_variances(config, initial, level))
    memory.core["path_variance"] = _free_place_sigma(config) ** 2
    memory.core["t_aid"] = memory.core["t_flow"] = t0
    memory.sources["t_trusted"] = t0


def level_from_gravity(config: Config, t_ns: NDArray[np.int64], samples: Array, R_BS: Array) -> Level:
    """Roll and pitch from the mean specific force; the mean rate is the gyro bias where the vehicle stands still.

    ``samples`` is (n, 6), rate and specific force in IMU axes.  The longest still stretch at the beginning is used
    (halving the window until it is still); without one, the whole window levels and the bias stays zero.
    """
    rate, force = samples[:, :3] @ R_BS.T, samples[:, 3:6] @ R_BS.T
    start = config.start
    for halvings in range(5):
        span_s = start.window_s / 2**halvings
        n = int(np.searchsorted(t_ns, t_ns[0] + round(span_s * 1e9), side="right"))
        still = (
            rate[:n].std(axis=0).max() < start.still_gyro_rad_s and force[:n].std(axis=0).max() < start.still_accel_m_s2
        )
        if n >= MIN_STILL_SAMPLES and still:
            return _level(force[:n].mean(axis=0), rate[:n].mean(axis=0), span_s, config.gravity_m_s2)
    return _level(force.mean(axis=0), np.zeros(3), 0.0, config.gravity_m_s2)


def _level(force: Array, bias: Array, still_s: float, gravity_m_s2: float) -> Level:
    size = float(np.linalg.norm(force))
    if not 0.5 * gravity_m_s2 < size < 1.5 * gravity_m_s2:
        raise FlightError(
            f"the mean specific force at the start is {size:.3g} m/s^2, gravity is {gravity_m_s2:.4g}; "
            f"check the accelerometer's unit (m/s^2, not g) and that the log does not start in a manoeuvre"
        )
    pitch = math.atan2(-force[0], math.hypot(force[1], force[2]))
    return Level(math.atan2(force[1], force[2]), pitch, bias, still_s)


def _first_variances(config: Config, initial: Initial, level: Level) -> Array:
    start = config.start
    imu = the_imu(config)
    tilt = start.sigma_tilt_still_rad if level.still_s else start.sigma_tilt_moving_rad
    bias = start.sigma_gyro_bias_rad_s
    if level.still_s:
        bias = min(bias, math.hypot(imu.gyro_noise_density / math.sqrt(level.still_s), SIGMA_BIAS_FLOOR_RAD_S))
    sigma = np.zeros(N_ERROR)
    sigma[E_POS : E_POS + 3] = initial.sigma_position_m
    sigma[E_VEL : E_VEL + 3] = initial.sigma_velocity_m_s
    sigma[E_ATT : E_ATT + 3] = tilt, tilt, initial.sigma_yaw_rad
    sigma[E_GYRO_BIAS : E_GYRO_BIAS + 3] = bias
    sigma[E_ACCEL_BIAS : E_ACCEL_BIAS + 3] = start.sigma_accel_bias_m_s2
    sigma[E_BLUR_SCALE] = scale_sigma(config)
    sigma[E_WALL_OFFSET] = config.range.offset_sigma_m
    sigma[E_UWB_BIAS:] = _free_place_sigma(config)
    variances: Array = sigma**2
    return variances


def _free_place_sigma(config: Config) -> float:
    """Of a bias that no path has yet: not zero, so that the covariance has an inverse."""
    return max(config.uwb.bias_sigma_m, SIGMA_FREE_PLACE_M)


def initial_from_uwb(config: Config, src: Records, events: Events, window: NDArray[np.bool_], level: Level) -> Initial:
    """First state of a flight that names none: where UWB says, or the origin; standing still; yaw 0."""
    start = config.start
    position, absolute = np.zeros(3), False
    for s in np.flatnonzero(np.isin(src["kind"], UWB_KINDS) & src["enabled"]):
        rows = events.values[window & (events.source == s)]
        if len(rows) >= 3:
            antenna = _locate(int(src["kind"][s]), rows, src["anchors"][s, : src["n_anchors"][s]])
            attitude = rotation_matrix(quaternion_from_euler(level.roll_rad, level.pitch_rad, 0.0))
            position, absolute = antenna - attitude @ src["lever_B"][s], True
            break
    x, y, z = (float(c) for c in position)
    return Initial(
        position_m=(x, y, z),
        sigma_position_m=start.sigma_position_m,
        sigma_velocity_m_s=start.sigma_velocity_m_s,
        sigma_yaw_rad=start.sigma_yaw_unknown_rad if absolute else SIGMA_YAW_FREE_RAD,
    )


def _locate(kind: int, rows: Array, anchors: Array) -> Array:
    """Robust position of the antenna [m] from the readings of one source in the first window."""
    from scipy.optimize import least_squares  # only here: costs 0.1 s to import

    if kind == int(Kind.UWB_POSITION):
        median: Array = np.median(rows[:, :3], axis=0)
        return median
    column = 1 if kind == int(Kind.UWB_RANGE) else 2
    good = np.isfinite(rows[:, column]) & (rows[:, :column] >= 0).all(axis=1)
    a, measured = rows[good, 0].astype(int), rows[good, column]

    def residual(p: Array) -> Array:
        """Differences of distance at a place (3,) less those measured [m]."""
        distance = np.linalg.norm(p - anchors, axis=1)
        if kind == int(Kind.UWB_RANGE):
            return np.asarray(distance[a] - measured)
        return np.asarray(distance[rows[good, 1].astype(int)] - distance[a] - measured)

    centre, span = anchors.mean(axis=0), np.ptp(anchors, axis=0).max()
    # anchors are often nearly coplanar: start on both sides of them and keep the better fit
    starts = [centre + np.array([0.0, 0.0, side * 0.25 * span]) for side in (1.0, -1.0)]
    fits = [least_squares(residual, p, loss="soft_l1", f_scale=0.3) for p in starts]
    best = min(fits, key=lambda fit: fit.cost)
    return np.asarray(best.x)
