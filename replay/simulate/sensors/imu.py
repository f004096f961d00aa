"""The inertial unit: noise densities, biases that walk, scale, quantisation and what vibration does to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import Imu
from axialnav.replay.flight import SensorTable
from axialnav.replay.simulate.streams import stamps
from axialnav.replay.simulate.vehicle import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ImuSheet:
    """Data sheet of a MEMS unit of the autopilot class.

    Attributes
    ----------
    rate_hz
        Samples per second.
    gyro_density, accel_density
        White noise [rad/s/sqrt(Hz)], [m/s^2/sqrt(Hz)].
    gyro_walk, accel_walk
        Bias random walk [rad/s^2/sqrt(Hz)], [m/s^3/sqrt(Hz)].
    gyro_bias, accel_bias
        Turn-on bias, standard deviation [rad/s], [m/s^2].
    gyro_scale, accel_scale
        Scale error, standard deviation [-].
    gyro_step, accel_step
        Quantisation [rad/s], [m/s^2].
    rectification
        Shift of the accelerometer's mean per vibration squared [m/s^2 per (m/s^2)^2].
    gyro_vibration
        Gyro noise per vibration of the frame [rad/s per m/s^2].
    """

    rate_hz: float = 200.0
    gyro_density: float = 1.0e-3
    accel_density: float = 5.0e-3
    gyro_walk: float = 1.0e-5
    accel_walk: float = 2.0e-4
    gyro_bias: float = 5.0e-3
    accel_bias: float = 0.05
    gyro_scale: float = 5.0e-4
    accel_scale: float = 1.0e-3
    gyro_step: float = 2000.0 / 32768.0 * np.pi / 180.0
    accel_step: float = 16.0 * 9.80665 / 32768.0
    rectification: float = 0.02
    gyro_vibration: float = 5.0e-3

    def spec(self, vibration_m_s2: float) -> Imu:
        """Description for ``sensor.yaml``: the densities in flight, vibration included."""
        root = np.sqrt(self.rate_hz)
        return Imu(
            rate_hz=self.rate_hz,
            gyro_noise_density=float(np.hypot(self.gyro_density, self.gyro_vibration * vibration_m_s2 / root)),
            gyro_bias_walk=self.gyro_walk,
            accel_noise_density=float(np.hypot(self.accel_density, vibration_m_s2 / root)),
            accel_bias_walk=self.accel_walk,
        )


@dataclass(frozen=True)
class ImuReadings:
    """Readings and the biases that were in them, shape (n, 3)."""

    table: SensorTable
    gyro_bias: Array
    accel_bias: Array


def read_imu(
    sheet: ImuSheet, motion: Motion, force: Array, vibration_m_s2: Array, fault_m_s2: Array, rng: np.random.Generator
) -> ImuReadings:
    """What the unit reads.

    Parameters
    ----------
    sheet
        Its data sheet.
    motion, force
        Truth at its samples, and the specific force in body axes (n, 3).
    vibration_m_s2
        Standard deviation of the frame's vibration at each sample (n,); faster than the sampling, so that it reads as
        white noise, and shifts the mean by rectification.
    fault_m_s2
        What a sick accelerometer adds on the body's x axis (n,).
    rng
        Draws noise and biases.
    """
    count, dt = len(motion.t_s), 1.0 / sheet.rate_hz
    gyro_bias = sheet.gyro_bias * rng.normal(size=3) + sheet.gyro_walk * np.sqrt(dt) * _walk(count, rng)
    accel_bias = sheet.accel_bias * rng.normal(size=3) + sheet.accel_walk * np.sqrt(dt) * _walk(count, rng)
    accel_bias = accel_bias + sheet.rectification * vibration_m_s2[:, None] ** 2 * rng.choice([-1.0, 1.0], 3)
    accel_bias[:, 0] += fault_m_s2
    shaken = vibration_m_s2[:, None]
    gyro = motion.rate_rad_s * (1.0 + sheet.gyro_scale * rng.normal(size=3)) + gyro_bias
    gyro += rng.normal(size=(count, 3)) * np.hypot(sheet.gyro_density / np.sqrt(dt), sheet.gyro_vibration * shaken)
    accel = force * (1.0 + sheet.accel_scale * rng.normal(size=3)) + accel_bias
    accel += rng.normal(size=(count, 3)) * np.hypot(sheet.accel_density / np.sqrt(dt), shaken)
    columns = {
        "gyro_rad_s": _quantised(gyro, sheet.gyro_step),
        "accel_m_s2": _quantised(accel, sheet.accel_step),
    }
    return ImuReadings(SensorTable(stamps(motion.t_s), columns), gyro_bias, accel_bias)


def _walk(count: int, rng: np.random.Generator) -> Array:
    steps = rng.normal(size=(count, 3))
    steps[0] = 0.0
    return np.cumsum(steps, axis=0)


def _quantised(values: Array, step: float) -> Array:
    return np.asarray(np.round(values / step) * step)
