"""Fields that a log holds in another form than a reading: quaternions, latitude and longitude, air pressure, course."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
EARTH_RADIUS_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563


def roll_pitch_yaw(q: Array, _: Array) -> dict[str, Array]:
    """Aerospace angles of quaternions (n, 4), scalar first."""
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return {
        "roll_rad": np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))[:, None],
        "pitch_rad": np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))[:, None],
        "yaw_rad": np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))[:, None],
    }


def east_north_up(place: Array, t_s: Array) -> dict[str, Array]:
    """Position from latitude, longitude [deg] and height [m] about the first fix, and velocity from its differences.

    Source: WGS 84; radii of curvature in the meridian and the prime vertical at the first fix.
    """
    latitude, longitude = np.radians(place[:, 0]), np.radians(place[:, 1])
    good = np.flatnonzero((place[:, 0] != 0.0) & np.isfinite(place).all(axis=1))
    first = int(good[0]) if len(good) else 0
    sine = np.sin(latitude[first])
    squared = FLATTENING * (2.0 - FLATTENING)
    across = EARTH_RADIUS_M / np.sqrt(1.0 - squared * sine**2)
    along = across * (1.0 - squared) / (1.0 - squared * sine**2)
    east = (longitude - longitude[first]) * across * np.cos(latitude[first])
    north = (latitude - latitude[first]) * along
    position = np.stack([east, north, place[:, 2] - place[first, 2]], axis=1)
    return {"position_m": position, "velocity_m_s": velocity_of(position, t_s)}


def velocity_of(position: Array, t_s: Array) -> Array:
    """Velocity from positions (n, 3) by central differences; NaN where the time stands still."""
    if len(t_s) < 2:
        return np.full_like(position, np.nan)
    distinct, first = np.unique(t_s, return_index=True)
    if len(distinct) < 2:
        return np.full_like(position, np.nan)
    slopes = np.gradient(position[first], distinct, axis=0)
    return np.asarray(slopes[np.searchsorted(distinct, t_s)])


def speed_and_course(motion: Array, _: Array) -> dict[str, Array]:
    """East, north, up velocity from ground speed [m/s], course [deg] and downward velocity [m/s]."""
    course = np.radians(motion[:, 1])
    east, north = motion[:, 0] * np.sin(course), motion[:, 0] * np.cos(course)
    return {"velocity_m_s": np.stack([east, north, -motion[:, 2]], axis=1)}


def north_east_down(velocity: Array, _: Array) -> dict[str, Array]:
    """East, north, up velocity from north, east, down."""
    return {"velocity_m_s": np.stack([velocity[:, 1], velocity[:, 0], -velocity[:, 2]], axis=1)}


def pressure_height(pressure: Array, _: Array) -> dict[str, Array]:
    """Height in the standard atmosphere from air pressure [Pa] (ISO 2533)."""
    return {"height_m": 44330.77 * (1.0 - (np.maximum(pressure, 1.0) / 101325.0) ** 0.1902632)}


DERIVED: dict[str, Callable[[Array, Array], dict[str, Array]]] = {
    "attitude_wxyz": roll_pitch_yaw,
    "latitude_longitude_height": east_north_up,
    "speed_course_down": speed_and_course,
    "velocity_ned_m_s": north_east_down,
    "pressure_pa": pressure_height,
}
