"""A surface whose place is not known: the filter finds it, as well as it says."""

from __future__ import annotations

import msgspec
import numpy as np
from scipy.stats import chi2

from axialnav.fusion.batch import run_batch
from axialnav.models.rig import Surface
from axialnav.models.state import E_WALL_OFFSET, WALL_OFFSET
from tests.fusion.inside import memories
from tests.fusion.made_flights import MadeFlight, Scene, fly, textbook

FLOOR_M = 0.0


def unknown_floor(seed: int) -> MadeFlight:
    """Position from UWB, floor at an unknown height; the floor's true offset is zero, the first guess too."""
    flight = fly(Scene(seed=seed, sensors=("range0", "uwb0")))
    floor = {"floor": Surface(normal=(0.0, 0.0, 1.0), offset_m="unknown")}
    config = msgspec.structs.replace(textbook(flight.config), surface=floor)
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


def test_the_offset_is_found_within_its_sigma_over_many_flights() -> None:
    """The anchors' heights decide; every flight has another floor."""
    rng = np.random.default_rng(3)
    total, flights = 0.0, 30
    for seed in range(flights):
        flight = unknown_floor(seed)
        floor_m = rng.uniform(-1.5, 0.5)  # the vehicle stays above it
        table = flight.tables["range0"]
        tilt = flight.truth.attitude.as_matrix()[:, 2, 2]
        slant = np.interp(table.t_ns, flight.tables["imu0"].t_ns, tilt)
        table.columns["range_m"][:] -= floor_m / slant
        ((_, memory),) = memories(flight.config, flight.tables)
        error = memory.core["x"][0, 0, WALL_OFFSET] - floor_m
        variance = memory.core["P"][0, 0, E_WALL_OFFSET, E_WALL_OFFSET]
        assert variance < 0.1**2
        total += error**2 / variance
    assert chi2.ppf(0.005, flights) < total < chi2.ppf(0.995, flights)


def test_a_known_offset_is_no_state() -> None:
    flight = fly(Scene(seed=1, sensors=("range0", "uwb0")))
    track = run_batch(flight.config, flight.tables).track
    assert not track.wall_offset_m.any()


def test_flow_over_an_unknown_floor_needs_the_range_finder_to_be_scaled() -> None:
    """With both, the velocity is found; the unknown offset costs accuracy but not honesty."""
    flight = fly(Scene(seed=4, sensors=("range0", "flow0", "uwb0")))
    floor = {"floor": Surface(normal=(0.0, 0.0, 1.0), offset_m="unknown")}
    track = run_batch(msgspec.structs.replace(textbook(flight.config), surface=floor), flight.tables).track
    settled = flight.t_s > 8.0
    error = (track.velocity_m_s - flight.truth.velocity_m_s)[settled]
    assert np.sqrt((error**2).mean()) < 0.06
    assert abs(track.wall_offset_m[-1] - FLOOR_M) < 0.1
