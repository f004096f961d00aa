r"""What the axial estimator holds but does not estimate along with its four states.

Memory and kernels are those of the 25-state filter, so that every measurement model, gate and record serves both.  The
four axial states are the columns of an embedding E (25, 4): along the axis in position, velocity and accelerometer
bias, and the blur scale.  The covariance is :math:`P = E P_4 E^\top + \Sigma`: :math:`\Sigma` holds position and
velocity across the axis and wall offset, which small updates of their own follow (the correlation with the
axial states is dropped), and the uncertainty of attitude and gyro bias, which stays as given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.models.state import (
    ACCEL_BIAS,
    BLUR_SCALE,
    E_ACCEL_BIAS,
    E_ATT,
    E_BLUR_SCALE,
    E_GYRO_BIAS,
    E_POS,
    E_VEL,
    E_WALL_OFFSET,
    N_ERROR,
    POS,
    VEL,
    WALL_OFFSET,
)

Array = NDArray[np.float64]
CONSIDERED = slice(E_ATT, E_BLUR_SCALE + 1)  # attitude and biases: their uncertainty counts, but nothing corrects it


@dataclass(frozen=True, slots=True)
class Held:
    """Embedding and motion of the held quantities; all methods work on the arrays they are given."""

    axis: Array
    E: Array
    attitude_variance: Array
    lateral_variance: float
    lateral_time_s: float
    offset_walk: float

    @classmethod
    def from_config(cls, config: Config) -> Held:
        """Take axis and noise from the configuration."""
        axis = np.array(config.axis) / np.linalg.norm(config.axis)
        E = np.zeros((N_ERROR, 4))
        E[E_POS : E_POS + 3, 0] = E[E_VEL : E_VEL + 3, 1] = E[E_ACCEL_BIAS : E_ACCEL_BIAS + 3, 2] = axis
        E[E_BLUR_SCALE, 3] = 1.0
        tune = config.axial
        tilt, rate = tune.sigma_tilt_rad**2, config.start.sigma_gyro_bias_rad_s**2
        return cls(
            axis=axis,
            E=E,
            attitude_variance=np.array([tilt, tilt, tune.sigma_yaw_rad**2, rate, rate, rate]),
            lateral_variance=tune.lateral_speed_m_s**2,
            lateral_time_s=tune.lateral_time_s,
            offset_walk=config.range.offset_walk_m**2,
        )

    @property
    def across(self) -> Array:
        """Projection (3, 3) on the plane across the axis."""
        return np.eye(3) - np.outer(self.axis, self.axis)

    def states(self, x: Array) -> Array:
        """Axial position, velocity, acceleration bias and blur scale (4,) of a nominal state (26,)."""
        along = [self.axis @ x[at : at + 3] for at in (POS, VEL, ACCEL_BIAS)]
        return np.array([*along, x[BLUR_SCALE]])

    def put_states(self, x: Array, states: Array) -> None:
        """Write the four states into the nominal state ``x`` (26,)."""
        for at, value in zip((POS, VEL, ACCEL_BIAS), states[:3], strict=True):
            x[at : at + 3] += self.axis * (value - self.axis @ x[at : at + 3])
        x[BLUR_SCALE] = states[3]

    def split(self, P: Array) -> tuple[Array, Array]:
        """Covariance of the four states (4, 4) and of what is held (25, 25)."""
        P4 = self.E.T @ P @ self.E
        return P4, P - self.E @ P4 @ self.E.T

    def first(self, position_variance: float, offset_variance: float) -> Array:
        """Covariance (25, 25) of the held quantities at the start."""
        S = np.zeros((N_ERROR, N_ERROR))
        S[E_POS : E_POS + 3, E_POS : E_POS + 3] = position_variance * self.across
        S[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3] = self.lateral_variance * self.across
        S[E_WALL_OFFSET, E_WALL_OFFSET] = offset_variance
        self._consider(S)
        return S

    def _consider(self, S: Array) -> None:
        S[CONSIDERED, :], S[:, CONSIDERED] = 0.0, 0.0
        diagonal = np.arange(E_ATT, E_GYRO_BIAS + 3)
        S[diagonal, diagonal] = self.attitude_variance

    def drift(self, x: Array, S: Array, dt: float) -> Array:
        """Move the held part of ``x`` (26,) in place over ``dt`` [s]; return its new covariance.

        Velocity across the axis forgets itself within ``lateral_time_s`` (first-order Gauss-Markov).
        """
        keep = math.exp(-dt / self.lateral_time_s)
        velocity = self.across @ x[VEL : VEL + 3]
        x[POS : POS + 3] += dt * velocity
        x[VEL : VEL + 3] -= (1.0 - keep) * velocity
        A = np.eye(N_ERROR)
        A[E_POS : E_POS + 3, E_VEL : E_VEL + 3] = dt * np.eye(3)
        A[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3] *= keep
        S = A @ S @ A.T
        S[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3] += (1.0 - keep**2) * self.lateral_variance * self.across
        S[E_WALL_OFFSET, E_WALL_OFFSET] += self.offset_walk * dt
        return np.asarray(S)

    def drift_shadow(self, x: Array, v: Array, V: Array, v_before: Array, dt: float) -> None:
        """Let the shadow, too, forget its velocity ``v`` (3,) across the axis over ``dt`` [s]; call it before its step.

        The shadow moves by what the filter's velocity changed from ``v_before`` (3,) to that in ``x`` (26,); across the
        axis that is turned in place into its own change.  Its covariance ``V`` (3, 3) receives the lateral noise.
        """
        keep, across = math.exp(-dt / self.lateral_time_s), self.across
        A = np.outer(self.axis, self.axis) + keep * across
        V[:] = A @ V @ A.T + (1.0 - keep**2) * self.lateral_variance * across
        v_before += across @ (x[VEL : VEL + 3] + (1.0 - keep) * v - v_before)

    def correct(self, x: Array, S: Array, H: Array, y: Array, R: Array) -> Array:
        """Update the held part of ``x`` in place; return its new covariance.

        ``R`` (m, m) is the noise of the reading plus what the axial states add.  Joseph form, because attitude and
        biases get no gain though they count in the innovation (Schmidt, 1966).
        """
        HS = H @ S
        gain = np.linalg.solve(HS @ H.T + R, HS).T
        gain[CONSIDERED] = 0.0
        step = gain @ y
        x[POS : POS + 3] += step[E_POS : E_POS + 3]
        x[VEL : VEL + 3] += step[E_VEL : E_VEL + 3]
        x[WALL_OFFSET] += step[E_WALL_OFFSET]
        keep = np.eye(N_ERROR) - gain @ H
        S = keep @ S @ keep.T + gain @ R @ gain.T
        self._consider(S)
        return 0.5 * (S + S.T)
