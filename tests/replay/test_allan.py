"""Allan deviation: textbook sums, another program's numbers, known noise, and recordings that cannot tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Imu
from axialnav.replay import cli
from axialnav.replay.calibration.allan import allan, imu_yaml, longest_stretch, overlapping_deviation, summary
from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.flight_writer import write_flight

RATE = 100.0
GYRO_N, GYRO_K, ACCEL_N, ACCEL_K = 2e-3, 4e-4, 2e-2, 4e-3


def at_rest(duration_s: float, seed: int = 0, gyro_walk: float = GYRO_K) -> Flight:
    rng = np.random.default_rng(seed)
    n, dt = int(duration_s * RATE), 1.0 / RATE
    signals = [
        white / np.sqrt(dt) * rng.normal(size=(n, 3)) + walk * np.sqrt(dt) * np.cumsum(rng.normal(size=(n, 3)), axis=0)
        for white, walk in ((GYRO_N, gyro_walk), (ACCEL_N, ACCEL_K))
    ]
    columns = {"gyro_rad_s": signals[0], "accel_m_s2": signals[1] + [0.0, 0.0, 9.81]}
    table = SensorTable(np.arange(n, dtype=np.int64) * 10_000_000, columns)
    return Flight("rest", Path("rest"), {}, Config(sensor={"imu0": Imu()}), {"imu0": table})


def test_the_deviation_is_the_textbook_double_sum() -> None:
    values = np.random.default_rng(1).normal(size=(200, 2))
    for m in (1, 3, 20):
        means = np.array([values[i : i + m].mean(axis=0) for i in range(200 - m + 1)])
        steps = means[m:] - means[:-m]
        expected = np.sqrt(0.5 * np.mean(steps**2, axis=0))
        found = overlapping_deviation(values, RATE, np.array([m]))[0]
        assert found == pytest.approx(expected, rel=1e-9)


def test_densities_of_known_noise_are_found() -> None:
    found = allan(at_rest(2000.0))
    for density, white, walk in ((found.gyro, GYRO_N, GYRO_K), (found.accel, ACCEL_N, ACCEL_K)):
        assert density.white == pytest.approx(white, rel=0.05)
        assert density.walk is not None
        assert density.walk == pytest.approx(walk, rel=0.35)
        assert density.needed_s is None
    assert "gyroscope_random_walk" in imu_yaml(found)
    assert "one sample" in summary(found)


def test_a_walk_that_does_not_show_is_not_invented() -> None:
    found = allan(at_rest(100.0, gyro_walk=0.0))
    assert found.gyro.walk is None
    assert found.gyro.needed_s is not None
    assert found.gyro.needed_s > 200.0
    assert "record about" in summary(found)
    assert "gyroscope_random_walk" not in imu_yaml(found)


def test_a_short_recording_is_refused_with_the_length_it_needs() -> None:
    with pytest.raises(FlightError, match="at least 60 s"):
        allan(at_rest(30.0))


def test_a_moving_vehicle_is_refused() -> None:
    flight = at_rest(70.0)
    flight.tables["imu0"].columns["gyro_rad_s"][3000:, 0] += 0.1
    with pytest.raises(FlightError, match="the vehicle moves"):
        allan(flight)


def test_the_longest_stretch_without_a_gap() -> None:
    t = np.concatenate((np.arange(50), 60 + np.arange(100), 300 + np.arange(30))) * 0.01
    assert longest_stretch(t) == (50, 150)
    assert longest_stretch(np.zeros(0)) == (0, 0)


def test_the_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_flight(at_rest(65.0), tmp_path / "rest")
    out = tmp_path / "imu.yaml"
    assert cli.main(["allan", str(folder), "--out", str(out)]) == 0
    assert "white noise" in capsys.readouterr().out
    assert "gyroscope_noise_density" in out.read_text()
    short = write_flight(at_rest(10.0), tmp_path / "short")
    assert cli.main(["allan", str(short)]) == 3
    assert cli.main(["allan"]) == 2
    assert "Traceback" not in capsys.readouterr().err
