"""The attitude that an autopilot would have logged: the truth with a tilt error of stated size that wanders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.fusion.made_flights import Table

TILT_RAD = np.radians(0.6)
TILT_TIME_S = 5.0


def logged_attitude(
    t_ns: NDArray[np.int64], attitude: Rotation, seed: int, tilt_rad: float = TILT_RAD, yaw_rad: float = 0.0
) -> Table:
    """Roll, pitch and yaw (FRD to NED, north along the world's x axis) of body-to-world attitudes.

    The tilt errors are first-order Gauss-Markov with the deviation ``tilt_rad`` per axis, the yaw error is constant.
    """
    rng = np.random.default_rng(seed)
    error = np.zeros((len(t_ns), 3))
    error[0] = rng.normal(0, tilt_rad, 3)
    keep = np.exp(-np.diff(t_ns) * 1e-9 / TILT_TIME_S)
    for k, share in enumerate(keep, start=1):
        error[k] = share * error[k - 1] + np.sqrt(1.0 - share**2) * rng.normal(0, tilt_rad, 3)
    error[:, 2] = yaw_rad
    wrong = Rotation.from_rotvec(error) * attitude  # world axes: tilt about x and y, heading about z
    yaw, pitch, roll = wrong.as_euler("ZYX").T
    return Table(t_ns, {"roll_rad": roll, "pitch_rad": -pitch, "yaw_rad": -yaw})
