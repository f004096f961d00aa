"""Random states, and what "plus" and "minus" mean on them: the error state of the filter in plain scipy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from axialnav.models.state import N_ERROR, N_NOMINAL, QUAT, zero_state

Array = NDArray[np.float64]


def rotation_of(x: Array) -> Rotation:
    """Attitude of a nominal state."""
    return Rotation.from_quat(x[QUAT : QUAT + 4], scalar_first=True)


def with_attitude(x: Array, attitude: Rotation) -> Array:
    """Copy of a nominal state with another attitude."""
    out = x.copy()
    out[QUAT : QUAT + 4] = attitude.as_quat(scalar_first=True)
    return out


def plus(x: Array, error: Array) -> Array:
    """Nominal state (26,) plus an error state (25,): attitude right-multiplied (body axes), the rest added."""
    out = with_attitude(x, rotation_of(x) * Rotation.from_rotvec(error[6:9]))
    out[:6] += error[:6]
    out[10:] += error[9:]
    return out


def minus(a: Array, b: Array) -> Array:
    """Error state (25,) that takes nominal state ``b`` to ``a``."""
    error = np.empty(N_ERROR)
    error[:6] = a[:6] - b[:6]
    error[6:9] = (rotation_of(b).inv() * rotation_of(a)).as_rotvec()
    error[9:] = a[10:] - b[10:]
    return error


def random_state(rng: np.random.Generator, tilt_rad: float = 0.4) -> Array:
    """State in the room above the floor: tilted up to about ``tilt_rad``, any heading, all biases in use."""
    x = zero_state()
    x[:3] = rng.uniform([-4, -4, 0.8], [4, 4, 3])
    x[3:6] = rng.normal(0, 1.5, 3)
    roll, pitch = rng.uniform(-tilt_rad, tilt_rad, 2)
    x = with_attitude(x, Rotation.from_euler("ZYX", [rng.uniform(-np.pi, np.pi), pitch, roll]))
    x[10:13] = rng.normal(0, 0.05, 3)
    x[13:16] = rng.normal(0, 0.3, 3)
    x[16:18] = rng.normal(0, [0.05, 0.1])
    x[18:] = rng.normal(0, 0.2, N_NOMINAL - 18)
    assert x.shape == (N_NOMINAL,)
    return x


def central_differences(function, x: Array, step: float = 1e-6) -> Array:
    """Jacobian (m, 25) of ``function`` (nominal state to (m,)) with respect to the error state at ``x``."""
    columns = []
    for k in range(N_ERROR):
        error = np.zeros(N_ERROR)
        error[k] = step
        columns.append(
            (np.atleast_1d(function(plus(x, error))) - np.atleast_1d(function(plus(x, -error)))) / (2 * step)
        )
    return np.stack(columns, axis=1)
