"""The autopilot's own attitude and its barometer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.flight import SensorTable
from axialnav.replay.simulate.streams import stamps
from axialnav.replay.simulate.vehicle import Motion

Array = NDArray[np.float64]
ATTITUDE_HZ, ATTITUDE_SIGMA_RAD = 20.0, 0.004
ATTITUDE_DRIFT_RAD, ATTITUDE_DRIFT_S = 0.010, 15.0  # 0.6 degrees that come and go
COMPASS_RAD = 0.05  # indoors
BARO_HZ, BARO_SIGMA_M = 10.0, 0.10
BARO_DOOR_M, BARO_DRIFT_S = 0.15, 30.0  # pressure that follows doors and propellers
BARO_DATUM_M = 87.0
NORTH_OF_X_RAD = 0.6  # heading of the corridor's x axis in the autopilot's north-east-down frame


def tilt_sigma_rad(drifts: bool) -> float:
    """Standard deviation of roll and pitch [rad], drift included."""
    return round(math.hypot(ATTITUDE_SIGMA_RAD, ATTITUDE_DRIFT_RAD if drifts else 0.0), 4)


def barometer_sigma_m(doors: bool) -> float:
    """Standard deviation of the height [m], slow error included."""
    return round(math.hypot(BARO_SIGMA_M, BARO_DOOR_M if doors else 0.0), 3)


def read_attitude(motion: Motion, drifts: bool, rng: np.random.Generator) -> SensorTable:
    """Roll, pitch and yaw in aerospace order (forward-right-down to north-east-down) [rad]."""
    count = len(motion.t_s)
    R = motion.rotation_WB.as_matrix()
    noise = ATTITUDE_SIGMA_RAD * rng.normal(size=(count, 3))
    if drifts:
        drift = np.column_stack([gauss_markov(motion.t_s, ATTITUDE_DRIFT_S, rng) for _ in range(3)])
        noise += drift * np.array([ATTITUDE_DRIFT_RAD, ATTITUDE_DRIFT_RAD, COMPASS_RAD])
    yaw = NORTH_OF_X_RAD - np.arctan2(R[:, 1, 0], R[:, 0, 0]) + noise[:, 2]
    columns = {
        "roll_rad": np.arctan2(R[:, 2, 1], R[:, 2, 2]) + noise[:, 0],
        "pitch_rad": np.arcsin(np.clip(R[:, 2, 0], -1.0, 1.0)) + noise[:, 1],
        "yaw_rad": np.mod(yaw + np.pi, 2.0 * np.pi) - np.pi,
    }
    return SensorTable(stamps(motion.t_s), columns)


def read_barometer(motion: Motion, doors: bool, rng: np.random.Generator) -> SensorTable:
    """Height above an unknown datum [m]."""
    height = BARO_DATUM_M + motion.position_m[:, 2] + BARO_SIGMA_M * rng.normal(size=len(motion.t_s))
    if doors:
        height = height + BARO_DOOR_M * gauss_markov(motion.t_s, BARO_DRIFT_S, rng)
    return SensorTable(stamps(motion.t_s), {"height_m": np.round(height, 2)})


def gauss_markov(t_s: Array, time_s: float, rng: np.random.Generator) -> Array:
    """First-order Gauss-Markov sequence of unit variance at evenly spaced instants, shape (n,)."""
    from scipy.signal import lfilter

    count = len(t_s)
    if count < 2:
        return rng.normal(size=count)
    keep = float(np.exp(-(t_s[1] - t_s[0]) / time_s))
    drive = np.sqrt(1.0 - keep**2) * rng.normal(size=count)
    drive[0] = rng.normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], drive))
