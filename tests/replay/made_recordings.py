"""Simulated flights as recordings: tables, configuration and truth in one :class:`Flight`."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from axialnav.fusion.config import Initial
from axialnav.models.rig import Imu
from axialnav.replay.flight import Flight, SensorTable, Truth
from tests.fusion.made_flights import ANCHORS, MadeFlight, Scene, Table, fly, stamps

# noise told as it is: white UWB, no margin on the inertial unit
PLAIN = {
    "uwb.sigma_m": "0.01",
    "uwb.range_sigma_m": "0.01",
    "uwb.bias_sigma_m": "0.0",
    "uwb.range_bias_sigma_m": "0.0",
    "uwb.correlation_time_s": "0.0",
    "imu.accel_noise_scale": "1.0",
    "imu.gyro_noise_scale": "1.0",
}
SHAKE, WALK = 0.1, 0.02  # in flight: five times the noise, seven times the walk of the bias at rest


def shaken(made: MadeFlight, seed: int) -> MadeFlight:
    """The flight with the accelerometer of a vehicle that vibrates; the configuration knows it."""
    rng = np.random.default_rng(seed)
    imu = made.tables["imu0"]
    dt = float(imu.t_ns[1] - imu.t_ns[0]) * 1e-9
    spec = made.config.sensor["imu0"]
    assert isinstance(spec, Imu)
    more = np.sqrt(SHAKE**2 - spec.accel_noise_density**2) / np.sqrt(dt)
    walk = np.sqrt(WALK**2 - spec.accel_bias_walk**2) * np.sqrt(dt)
    shape = imu.columns["accel_m_s2"].shape
    noise = more * rng.normal(size=shape) + walk * np.cumsum(rng.normal(size=shape), axis=0)
    columns = {**imu.columns, "accel_m_s2": imu.columns["accel_m_s2"] + noise}
    told = msgspec.structs.replace(spec, accel_noise_density=SHAKE, accel_bias_walk=WALK)
    config = msgspec.structs.replace(made.config, sensor={**made.config.sensor, "imu0": told})
    return MadeFlight(
        {**made.tables, "imu0": Table(imu.t_ns, columns)}, config, made.truth, made.gyro_bias, made.accel_bias
    )


def recording(made: MadeFlight, name: str = "made") -> Flight:
    """As if it had been read from a folder; the noise of UWB is told as it is, readings independent."""
    tables = {
        sensor: SensorTable(t.t_ns, dict(t.columns), tuple(ANCHORS) if "anchor" in " ".join(t.columns) else ())
        for sensor, t in made.tables.items()
    }
    q = made.truth.attitude.as_quat(scalar_first=True)
    truth = Truth(stamps(made.truth.t), made.truth.position_m, q, made.truth.velocity_m_s)
    return Flight(name, Path(name), {}, made.config, tables, truth, evaluation=(2.0, None))


def flown(seed: int, duration_s: float, *, shake: bool = True, **scene: object) -> Flight:
    """A simulated flight with range finder, image motion and two-way UWB ranges."""
    made = fly(
        Scene(seed=seed, duration_s=duration_s, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=20.0, **scene)  # type: ignore[arg-type]
    )
    flight = recording(shaken(made, seed + 1000) if shake else made)
    config = flight.config.with_params(PLAIN)
    assert isinstance(config.initial, Initial)
    return Flight(flight.name, flight.path, {}, config, flight.tables, flight.truth, evaluation=flight.evaluation)
