"""What the camera should have seen: picture motion from ground truth and the distance of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError
from axialnav.models.rig import Camera, Sensor, Surface
from axialnav.replay.flight import Flight
from axialnav.replay.reference import interpolate

Array = NDArray[np.float64]
MAX_GAP_NS = 200_000_000
SAMPLES = 9


@dataclass(frozen=True)
class TrueMotion:
    """Truth for windows of frames, all shapes (n,).

    Parameters
    ----------
    displacement_px
        Displacement of the content per frame period on the optical axis [px]; NaN where truth is missing.
    metres_per_px
        Wall displacement that one pixel stands for [m].
    speed_m_s
        Speed of the camera along the image axis, positive to its right (or down) [m/s].
    rotation_px
        Part of ``displacement_px`` that is due to rotation [px].
    """

    displacement_px: Array
    metres_per_px: Array
    speed_m_s: Array
    rotation_px: Array


def true_motion(
    flight: Flight,
    camera: str,
    middle_ns: NDArray[np.int64],
    window_s: Array,
    period_s: Array,
    distance_m: float | None,
    axis: str = "x",
) -> TrueMotion | None:
    """Truth for windows around ``middle_ns``; None where the flight has no truth or the distance is unknown.

    Parameters
    ----------
    flight
        With truth.
    camera
        Name of the camera.
    middle_ns, window_s, period_s
        Middle and length of every window, and its frame period, shape (n,).
    distance_m
        Distance of the wall along the optical axis [m]; None: from the surface that the camera names.
    axis
        Image axis of the motion.
    """
    spec = flight.config.sensor[camera]
    if flight.truth is None or not isinstance(spec, Camera) or not knows_distance(flight, spec, distance_m):
        return None
    column = 0 if axis == "x" else 1
    focal = spec.focal_px[column]
    share = np.linspace(-0.5, 0.5, SAMPLES)
    t_ns = (middle_ns[:, None] + np.rint(share * window_s[:, None] * 1e9).astype(np.int64)).ravel()
    velocity_S, rate_S, depth = _seen_from_camera(flight, spec, t_ns, distance_m)
    shape = (len(middle_ns), SAMPLES)
    turn = rate_S[:, 1] if column == 0 else -rate_S[:, 0]
    flow = -focal * (velocity_S[:, column] / depth)
    spin = -focal * turn
    mean_depth = depth.reshape(shape).mean(axis=1)
    return TrueMotion(
        (flow + spin).reshape(shape).mean(axis=1) * period_s,
        mean_depth / focal,
        velocity_S[:, column].reshape(shape).mean(axis=1),
        spin.reshape(shape).mean(axis=1) * period_s,
    )


def knows_distance(flight: Flight, camera: Camera, distance_m: float | None) -> bool:
    """Whether the distance of the wall is given, or follows from a surface whose place is known.

    Raises
    ------
    ConfigError
        If the given distance is not positive.
    """
    if distance_m is not None:
        if not 0.0 < distance_m < np.inf:
            raise ConfigError(f"--distance-m must be positive and finite, got {distance_m}")
        return True
    surface = flight.config.surface.get(camera.surface or "")
    return surface is not None and surface.offset_m != "unknown"


def _seen_from_camera(
    flight: Flight, camera: Camera, t_ns: NDArray[np.int64], distance_m: float | None
) -> tuple[Array, Array, Array]:
    """Velocity and rate of the camera in its own axes (m, 3), and the depth of the wall on its axis (m,)."""
    truth = flight.truth
    assert truth is not None
    quaternion = interpolate(t_ns, truth.t_ns, _continuous(truth.quaternion_WB), MAX_GAP_NS)
    R_WB = rotation_matrices(quaternion)
    rate_B = _interpolated_rates(truth.t_ns, _continuous(truth.quaternion_WB), t_ns)
    velocity_W = interpolate(t_ns, truth.t_ns, truth.velocity_m_s, MAX_GAP_NS)
    R_BS, lever = camera.rotation_BS, camera.lever_arm_m
    velocity_B = np.einsum("nji,nj->ni", R_WB, velocity_W) + np.cross(rate_B, lever)
    if distance_m is not None:
        depth = np.full(len(t_ns), distance_m)
    else:
        surface = flight.config.surface[camera.surface or ""]
        position = interpolate(t_ns, truth.t_ns, truth.position_m, MAX_GAP_NS)
        depth = surface_depth(surface, camera, R_WB, position, float(surface.offset_m))
    return velocity_B @ R_BS, rate_B @ R_BS, depth


def surface_depth(surface: Surface, sensor: Sensor, R_WB: Array, position_W: Array, offset_m: Array | float) -> Array:
    """Distance of a surface along the sensor's optical axis [m], NaN where that does not meet it.

    R_WB (n, 3, 3), position_W (n, 3); ``offset_m``, (n,) or a number, is that of a surface without faces.
    """
    eye = position_W + np.einsum("nij,j->ni", R_WB, sensor.lever_arm_m)
    ray = np.einsum("nij,j->ni", R_WB, sensor.rotation_BS[:, 2])
    if not surface.face:
        return _plane_depth(np.array(surface.normal), offset_m, eye, ray)
    depths = np.full((len(surface.face), len(eye)), np.inf)
    for depth, face in zip(depths, surface.face, strict=True):
        normal, start = np.array(face.normal), np.array(face.start)
        along = np.array(face.end) - start
        met = _plane_depth(normal, face.offset_m, eye, ray)
        travelled = (eye + met[:, None] * ray - start) @ along
        front = (ray @ normal < 0.0) & (travelled >= 0.0) & (travelled <= along @ along)
        depth[front] = met[front]
    nearest = np.min(np.where(np.isnan(depths), np.inf, depths), axis=0)
    return np.where(np.isfinite(nearest), nearest, np.nan)


def _plane_depth(normal: Array, offset_m: Array | float, eye: Array, ray: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (offset_m - eye @ normal) / (ray @ normal)
    return np.where(depth > 0.0, depth, np.nan)


def _continuous(quaternion: Array) -> Array:
    """Quaternions (n, 4) without sign changes between neighbours, so that they may be interpolated."""
    jumps = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    sign = np.where(np.cumsum(jumps) % 2 == 1, -1.0, 1.0)
    return np.vstack([quaternion[:1], quaternion[1:] * sign[:, None]])


def rotation_matrices(quaternion: Array) -> Array:
    """Matrices (n, 3, 3) of quaternions (n, 4), scalar first, of any length but zero."""
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _interpolated_rates(stamps: NDArray[np.int64], quaternion: Array, t_ns: NDArray[np.int64]) -> Array:
    """Angular rate in body axes (m, 3) from the differences of neighbouring attitudes."""
    if len(stamps) < 2:
        return np.zeros((len(t_ns), 3))
    step_s = np.diff(stamps) / 1e9
    a, b = quaternion[:-1], quaternion[1:]
    vector = (
        a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    )  # vector part of conj(a) b: half the rotation, in body axes
    rate = 2.0 * vector / step_s[:, None]
    middle = (stamps[:-1] + stamps[1:]) // 2
    rate = np.vstack([rate[:1], rate, rate[-1:]])
    return interpolate(t_ns, np.concatenate([stamps[:1], middle, stamps[-1:]]), rate, MAX_GAP_NS)
