"""Simulated corridor flights with the attitude an autopilot would have logged, with and without inertial samples."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.outcome import Track
from axialnav.models.rig import AttitudeSource
from tests.fusion import made_corridor
from tests.fusion.made_attitude import logged_attitude
from tests.fusion.made_flights import MadeFlight, Scene, Table, fly

FLOW_AND_UWB = ("range0", "flow0", "tdoa0")


@dataclass(frozen=True)
class AxialFlight:
    """Tables with ``att0``, the configuration, and the flight it was made from."""

    tables: dict[str, Table]
    config: Config
    made: MadeFlight

    def error_m_s(self, track: Track) -> np.ndarray:
        """Axial velocity, estimate minus truth (n,)."""
        return np.asarray(track.velocity_m_s[:, 0] - self._at(track, self.made.truth.velocity_m_s))

    def error_m(self, track: Track) -> np.ndarray:
        """Axial position, estimate minus truth (n,)."""
        return np.asarray(track.position_m[:, 0] - self._at(track, self.made.truth.position_m))

    def _at(self, track: Track, truth: np.ndarray) -> np.ndarray:
        return np.interp(track.t_ns, self.made.tables["imu0"].t_ns, truth[:, 0])


def axial_flight(
    seed: int, *, sensors: tuple[str, ...] = FLOW_AND_UWB, imu: bool = True, duration_s: float = 20.0, **scene: object
) -> AxialFlight:
    """Mostly along x, with little sway."""
    size = (1.6, 0.3, 0.2)
    options = {"size_m": size, "yaw_rate_rad_s": 0.0, **scene}
    made = fly(Scene(seed=seed, duration_s=duration_s, sensors=sensors, **options))  # type: ignore[arg-type]
    return with_attitude(made, seed, imu)


def axial_corridor(corridor: made_corridor.Corridor, *, imu: bool = True) -> AxialFlight:
    """Along a corridor, with UWB that may go wrong."""
    return with_attitude(made_corridor.fly(corridor), corridor.seed, imu)


def with_attitude(made: MadeFlight, seed: int, imu: bool) -> AxialFlight:
    """Add attitudes at 50 Hz with a wandering tilt error of 0.6 degrees, and take the inertial samples away or not."""
    rows = slice(1, None, 4)
    attitude = logged_attitude(made.tables["imu0"].t_ns[rows], made.truth.attitude[rows], seed)
    tables = {**made.tables, "att0": attitude}
    specs = {**made.config.sensor, "att0": AttitudeSource()}
    if not imu:
        del tables["imu0"], specs["imu0"]
    config = msgspec.structs.replace(made.config, sensor=specs).with_params({"axial.heading_rad": "0.0"})
    return AxialFlight(tables, config, made)
