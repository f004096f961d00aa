"""The shipped flight: small, licensed, clean, and fit to start a filter on."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.replay.flight import load_flight
from axialnav.replay.sample_flights import sample_flight_path

LIMIT_BYTES = 5_000_000


def test_it_is_small_and_carries_its_licence() -> None:
    folder = sample_flight_path()
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < LIMIT_BYTES
    licence = (folder / "LICENSE").read_text(encoding="utf-8")
    assert "Copyright (c) 2014, Paul Riseborough" in licence
    assert "THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS" in licence
    assert "priseborough/InertialNav" in licence


def test_it_loads_without_a_single_drop() -> None:
    flight = load_flight(sample_flight_path())
    assert flight.drops == ()
    assert flight.info["licence"] == "BSD-3-Clause"
    assert {name: len(table) for name, table in flight.tables.items()} == {
        "imu0": 3831,
        "att0": 767,
        "flow0": 761,
        "tof0": 509,
    }
    assert sum(1 for _ in flight.readings()) == 3831 + 767 + 761 + 509


def test_it_stands_still_first_and_moves_while_it_is_scored() -> None:
    flight = load_flight(sample_flight_path())
    imu, gps = flight.tables["imu0"], flight.gps
    assert gps is not None
    since_s = (imu.t_ns - imu.t_ns[0]) / 1e9
    still = since_s < 2.5
    assert imu.columns["gyro_rad_s"][still].std(axis=0).max() < 0.03
    assert np.linalg.norm(imu.columns["accel_m_s2"][still].mean(axis=0)) == pytest.approx(9.81, abs=0.1)
    start_s, end_s = flight.evaluation
    assert start_s is not None
    assert end_s is not None
    gps_s = (gps.t_ns - imu.t_ns[0]) / 1e9
    scored = (gps_s >= start_s) & (gps_s <= end_s)
    speed = np.hypot(gps.velocity_m_s[scored, 0], gps.velocity_m_s[scored, 1])
    assert np.median(speed) > 2.0
    assert scored.sum() > 300


def test_another_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(FileNotFoundError, match="no sample flight named 'mars'; there are: copter_px4flow"):
        sample_flight_path("mars")
