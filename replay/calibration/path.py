"""Where the vehicle was and how it moved, as seen by something other than the sensor that is calibrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.fusion.memory import the_imu
from axialnav.models.rig import Imu, Sensor
from axialnav.replay.flight import Flight
from axialnav.replay.reference import interpolate
from axialnav.replay.run import replay

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
MAX_GAP_NS = 100_000_000


@dataclass(frozen=True)
class Path:
    """Position, velocity and attitude at the instants of a sensor; NaN where they are not known.

    ``position_m``, ``velocity_m_s`` (world), ``rate_rad_s`` (body) are (n, 3), ``rotation_WB`` (n, 3, 3); ``source``
    says where they come from.  ``sigma_m`` and ``sigma_m_s`` are how well position and velocity are known, worst axis,
    median over the flight: errors that all readings share, which no number of readings makes smaller.
    """

    position_m: Array
    velocity_m_s: Array
    rate_rad_s: Array
    rotation_WB: Array
    source: str
    sigma_m: float = 0.0
    sigma_m_s: float = 0.0


def path_at(flight: Flight, config: Config, t_ns: Stamps, sensor: str) -> Path:
    """Path from the ground truth; without one from a smoothed replay in which ``sensor`` takes no part.

    Raises
    ------
    FlightError
        No ground truth with velocities, and nothing else to replay the flight with.
    """
    truth = flight.truth
    if truth is not None and np.isfinite(truth.velocity_m_s).any() and config.initial is not None:
        stamps, source = truth.t_ns, "ground truth"
        columns = (truth.position_m, truth.velocity_m_s, truth.quaternion_WB)
        sigmas = (0.0, 0.0)
    else:
        run = replay(flight, config, without=(sensor,), smooth=True)
        if not any(s["fused"] for s in run.metrics["sensors"].values()):
            raise FlightError(f"{flight.name}: neither ground truth nor another aid to calibrate {sensor} against")
        track = run.track
        stamps, source = track.t_ns, f"smoothed replay without {sensor}"
        columns = (track.position_m, track.velocity_m_s, track.quaternion_WB)
        sigmas = (_worst(track.position_covariance), _worst(track.velocity_covariance))
    moved = interpolate(t_ns, stamps, np.hstack(columns), MAX_GAP_NS)
    return Path(moved[:, :3], moved[:, 3:6], _rate(flight, config, t_ns), rotations(moved[:, 6:10]), source, *sigmas)


def _worst(covariance: Array) -> float:
    """Median over time of the standard deviation of the worst axis; covariances (n, 3, 3)."""
    variances = np.einsum("nii->ni", covariance)
    return float(np.sqrt(np.median(variances.max(axis=1))))


def _rate(flight: Flight, config: Config, t_ns: Stamps) -> Array:
    spec: Imu = the_imu(config)
    name = next(name for name, sensor in config.sensor.items() if sensor == spec and name not in config.disabled)
    table = flight.tables[name]
    gyro = interpolate(t_ns, table.t_ns, np.asarray(table.columns["gyro_rad_s"], dtype=np.float64), MAX_GAP_NS)
    turned: Array = gyro @ spec.rotation_BS.T
    return turned


def rotations(quaternion_WB: Array) -> Array:
    """Rotation matrices of quaternions that need not be quite of unit length: (n, 4) scalar first -> (n, 3, 3)."""
    w, x, y, z = (quaternion_WB / np.linalg.norm(quaternion_WB, axis=1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def beam_length(path: Path, spec: Sensor, normal: Array, offset_m: float) -> Array:
    """Distance from a sensor to a plane along its optical axis or beam [m], (n,); NaN where it looks away."""
    place = path.position_m + path.rotation_WB @ spec.lever_arm_m
    beam = path.rotation_WB @ spec.rotation_BS[:, 2]
    towards = beam @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        length = (offset_m - place @ normal) / towards
    return np.where((towards < -0.5) & (length > 0.0), length, np.nan)


def image_rates(path: Path, spec: Sensor, distance_m: Array) -> tuple[Array, Array]:
    """Displacement rate of the image per unit of focal length and axis [rad/s], (n, 2), and its speed part [m/s]."""
    velocity_B = np.einsum("nij,ni->nj", path.rotation_WB, path.velocity_m_s)
    velocity_S = (velocity_B + np.cross(path.rate_rad_s, spec.lever_arm_m)) @ spec.rotation_BS
    rate_S = path.rate_rad_s @ spec.rotation_BS
    turn = np.stack([rate_S[:, 1], -rate_S[:, 0]], axis=1)
    return -(velocity_S[:, :2] / distance_m[:, None] + turn), velocity_S[:, :2] + turn * distance_m[:, None]
