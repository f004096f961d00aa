"""A quadrotor as a point mass whose attitude follows from its acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from axialnav.replay.simulate.course import Course, smoothstep
from axialnav.replay.simulate.mission import VehiclePlan
from axialnav.replay.simulate.speed_profile import BEYOND_S, distance_over_time

Array = NDArray[np.float64]
KNOT_S = 0.05
DEGREE = 7
RATE_STEP_S = 2e-4
WANDER_HZ = (0.07, 0.11, 0.19, 0.31)  # of the position and heading control
SETTLE_S = 2.0


@dataclass(frozen=True)
class Motion:
    """Truth at some instants.

    Attributes
    ----------
    t_s
        Since the first inertial sample, shape (n,).
    position_m, velocity_m_s, accel_m_s2
        World frame, shape (n, 3).
    rotation_WB
        Attitudes, n of them.
    rate_rad_s
        Angular rate in body axes, shape (n, 3).
    """

    t_s: Array
    position_m: Array
    velocity_m_s: Array
    accel_m_s2: Array
    rotation_WB: Rotation
    rate_rad_s: Array

    def force(self, gravity_m_s2: float) -> Array:
        """Specific force in body axes, what an ideal accelerometer reads [m/s^2], shape (n, 3)."""
        felt = self.accel_m_s2 + np.array([0.0, 0.0, gravity_m_s2])
        return np.asarray(self.rotation_WB.inv().apply(felt))


@dataclass(frozen=True)
class Trajectory:
    """Position and heading as splines of time; everything else follows by derivation.

    ``course_m`` are the spline of the distance flown and ``axis_WB`` needs no more than the derivative of position.
    """

    position: BSpline
    heading: BSpline
    duration_s: float
    gravity_m_s2: float
    drag_per_s: float

    def at(self, t_s: Array) -> Motion:
        """Truth at instants ``t_s`` (n,) [s]."""
        ahead, back = self.rotation(t_s + RATE_STEP_S), self.rotation(t_s - RATE_STEP_S)
        rate = (back.inv() * ahead).as_rotvec() / (2.0 * RATE_STEP_S)
        return Motion(
            t_s,
            self.position(t_s),
            self.position(t_s, 1),
            self.position(t_s, 2),
            self.rotation(t_s),
            np.asarray(rate),
        )

    def rotation(self, t_s: Array) -> Rotation:
        """Attitude: body z along the thrust against gravity, inertia and drag; nose near the heading."""
        up = self.position(t_s, 2) + self.drag_per_s * self.position(t_s, 1)
        up[:, 2] += self.gravity_m_s2
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        heading = self.heading(t_s)
        nose = np.column_stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)])
        left = np.cross(up, nose)
        left /= np.linalg.norm(left, axis=1, keepdims=True)
        return Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))


def fly(
    plan: VehiclePlan, course: Course, duration_s: float | None, gravity_m_s2: float, rng: np.random.Generator
) -> Trajectory:
    """Fly a course.

    Parameters
    ----------
    plan
        Profile and control errors.
    course
        Where to.
    duration_s
        Length of the flight [s], None for as long as the course takes.
    gravity_m_s2
        Of the world.
    rng
        Draws the phases of the control errors.
    """
    grid, flown = distance_over_time(plan, course.length_m, duration_s)
    end = float(grid[-1]) - BEYOND_S
    knots: Array = KNOT_S * np.arange(-4.0, round(end / KNOT_S) + 6.0).astype(np.float64)
    s = np.interp(knots, grid, flown)
    s = _mean_over_knot(knots, grid, flown, s)
    begun = smoothstep((knots - 0.7 * plan.still_s) / SETTLE_S)
    sideways = plan.offset_m + begun * plan.clearance_sigma_m * _wander(knots, rng)
    upward = begun * plan.clearance_sigma_m * _wander(knots, rng)
    turned = begun * plan.yaw_sigma_rad * _wander(knots, rng)
    along = course.heading(s)
    place = course.place(s)
    place[:, 0] -= sideways * np.sin(along)
    place[:, 1] += sideways * np.cos(along)
    place[:, 2] += upward
    return Trajectory(
        make_interp_spline(knots, place, k=DEGREE),
        make_interp_spline(knots, along + turned, k=DEGREE),
        end,
        gravity_m_s2,
        plan.drag_per_s,
    )


def _mean_over_knot(knots: Array, grid: Array, flown: Array, s: Array) -> Array:
    """Distance at the knots; between grid points the distance is taken as smooth, not as a polygon."""
    spline = make_interp_spline(grid, flown, k=5)
    inside = (knots >= grid[0]) & (knots <= grid[-1])
    return np.where(inside, spline(np.clip(knots, grid[0], grid[-1])), s)


def _wander(t: Array, rng: np.random.Generator) -> Array:
    """Slow random curve of unit variance."""
    phase = rng.uniform(0.0, 2.0 * np.pi, len(WANDER_HZ))
    waves = np.sin(2.0 * np.pi * np.outer(t, WANDER_HZ) + phase)
    return np.asarray(np.sqrt(2.0 / len(WANDER_HZ)) * waves.sum(axis=1))
