"""What can go wrong is switched by name, touches its own sensor alone, and sensor.yaml says how large errors are."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import msgspec
import numpy as np
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.models.rig import AttitudeSource, Barometer, RangeFinder
from axialnav.replay.flight import Flight
from axialnav.replay.run import replay
from axialnav.replay.simulate.flight import fly_mission, sensed
from axialnav.replay.simulate.mission import ORDINARY_FAULTS, Fault, read_mission
from axialnav.replay.simulate.scenarios import mission_of
from axialnav.replay.simulate.sensors.aiding import BARO_DATUM_M, read_attitude, read_barometer
from axialnav.replay.simulate.sensors.camera import frame_instants

TOUCHES = {
    "tof_misses": {"tof0", "tof1"},
    "tof_spikes": {"tof0", "tof1"},
    "accel_runaway": {"imu0"},
    "uwb_late": {"uwb0"},
    "attitude_drift": {"att0"},
    "baro_doors": {"baro0"},
}


def flown(faults: tuple[str, ...], seed: int = 4) -> Flight:
    mission = msgspec.structs.replace(mission_of("corner", duration_s=12.0), faults=faults)
    return sensed(fly_mission(mission, seed), Path("unused"), frames=False)


@pytest.fixture(scope="module")
def faultless() -> Flight:
    return flown(())


def differing(a: Flight, b: Flight) -> set[str]:
    """Sensors whose readings differ."""

    def same(name: str) -> bool:
        one, other = a.tables[name], b.tables[name]
        return np.array_equal(one.t_ns, other.t_ns) and all(
            np.array_equal(column, other.columns[key]) for key, column in one.columns.items()
        )

    return {name for name in a.tables if not same(name)}


def test_every_fault_is_known_here() -> None:
    assert set(get_args(Fault)) == set(TOUCHES) | {"frame_drops"}
    assert set(ORDINARY_FAULTS) <= set(TOUCHES)


@pytest.mark.parametrize("fault", TOUCHES)
def test_a_fault_touches_its_sensor_and_no_other(fault: str, faultless: Flight) -> None:
    assert differing(faultless, flown((fault,))) == TOUCHES[fault]


def test_the_runaway_of_the_accelerometer_is_in_its_true_bias(faultless: Flight) -> None:
    sick = flown(("accel_runaway",)).truth
    assert sick is not None
    assert faultless.truth is not None
    assert sick.accel_bias is not None
    assert faultless.truth.accel_bias is not None
    change = sick.accel_bias - faultless.truth.accel_bias
    assert change[0, 0] == 0.0
    assert change[-1, 0] == pytest.approx(-2.5)
    assert not change[:, 1:].any()


def test_dropped_frames_are_one_in_a_hundred() -> None:
    calm = msgspec.structs.replace(mission_of("straight"), faults=())
    full = frame_instants(calm, 200.0, np.random.default_rng(1))
    some = frame_instants(msgspec.structs.replace(calm, faults=("frame_drops",)), 200.0, np.random.default_rng(1))
    assert 1.0 - len(some) / len(full) == pytest.approx(0.01, abs=0.004)
    assert set(some) < set(full)


def test_a_fault_that_is_not_known_is_named(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text('faults = ["tof_mises"]\n[[section]]\nkind = "straight"\nlength_m = 9.0\n')
    with pytest.raises(ConfigError, match="tof_mises"):
        read_mission(path)


@pytest.mark.parametrize("faults", [(), ORDINARY_FAULTS])
def test_stated_sigmas_are_those_of_the_readings(faults: tuple[str, ...]) -> None:
    """Slow errors included: over many flights, not within one."""
    flight = flown(faults)
    baro, attitude = flight.config.sensor["baro0"], flight.config.sensor["att0"]
    assert isinstance(baro, Barometer)
    assert isinstance(attitude, AttitudeSource)
    motion = fly_mission(mission_of("straight", duration_s=6.0)).trajectory.at(np.arange(60) / 10.0)
    roll = np.arctan2(motion.rotation_WB.as_matrix()[:, 2, 1], motion.rotation_WB.as_matrix()[:, 2, 2])
    heights, rolls = [], []
    for seed in range(400):
        rng = np.random.default_rng(seed)
        heights.append(read_barometer(motion, "baro_doors" in faults, rng).columns["height_m"] - BARO_DATUM_M)
        rolls.append(read_attitude(motion, "attitude_drift" in faults, rng).columns["roll_rad"] - roll)
    assert np.std(np.array(heights) - motion.position_m[:, 2]) == pytest.approx(baro.sigma_m, rel=0.08)
    assert np.std(rolls) == pytest.approx(attitude.sigma_rad, rel=0.08)


def test_the_wall_range_is_as_noisy_as_stated(faultless: Flight) -> None:
    """Standing still at take-off, where the beam meets one point of the wall."""
    finder, table = faultless.config.sensor["tof0"], faultless.tables["tof0"]
    assert isinstance(finder, RangeFinder)
    early = table.t_ns < table.t_ns[0] + 1_500_000_000
    ranges = table.columns["range_m"][early]
    noise = np.diff(ranges) / np.sqrt(2.0)
    assert len(ranges) > 60
    assert np.std(noise) == pytest.approx(finder.sigma_m, rel=0.25)


def test_the_filter_finds_every_sensor_as_noisy_as_it_is_stated() -> None:
    """Mean NIS near 1, slow errors included: a barometer's and an attitude's are those of one reading, not of many."""
    mission = msgspec.structs.replace(mission_of("mission", duration_s=40.0, uwb="clean"))
    run = replay(sensed(fly_mission(mission, 6), Path("unused"), frames=False))
    found = {name: sensor["mean_nis"] for name, sensor in run.metrics["sensors"].items()}
    assert set(found) == {"att0", "baro0", "tof0", "tof1", "uwb0"}
    assert all(0.2 < nis < 2.0 for nis in found.values()), found
