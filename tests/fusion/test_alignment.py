"""The first state: tilt from gravity, bias from standing still, position from UWB, each within its own sigma."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from axialnav.fusion.alignment import align
from axialnav.fusion.batch import run_batch
from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.fusion.events import pack_tables
from axialnav.fusion.memory import Memory, new_memory
from axialnav.fusion.sources import build_sources
from axialnav.models.rig import Imu
from tests.fusion.made_flights import GRAVITY, GYRO_DENSITY, START_NS, MadeFlight, Scene, Table, fly, transform

RATE_HZ = 200.0
T_NS = START_NS + np.arange(400) * 5_000_000


def first_state(config: Config, tables) -> Memory:
    sources = build_sources(config)
    memory = new_memory(len(sources))
    align(config, sources, pack_tables(config, tables), memory)
    return memory


def standing(seed: int, attitude: Rotation, bias=(0.0, 0.0, 0.0), R_BS=None) -> dict[str, Table]:
    """Two seconds on the ground."""
    rng = np.random.default_rng(seed)
    gyro = np.array(bias) + rng.normal(0, GYRO_DENSITY * np.sqrt(RATE_HZ), (len(T_NS), 3))
    accel = attitude.inv().apply([0.0, 0.0, GRAVITY]) + rng.normal(0, 0.05, (len(T_NS), 3))
    if R_BS is not None:
        gyro, accel = gyro @ R_BS, accel @ R_BS
    return {"imu0": Table(T_NS, {"gyro_rad_s": gyro, "accel_m_s2": accel})}


def attitude_of(memory: Memory) -> Rotation:
    return Rotation.from_quat(memory.core["x"][0, 0, 6:10], scalar_first=True)


RIG = Config(sensor={"imu0": Imu(gyro_noise_density=GYRO_DENSITY)})


def test_roll_and_pitch_come_from_gravity_and_yaw_is_zero() -> None:
    rng = np.random.default_rng(1)
    for seed, (roll, pitch, yaw) in enumerate(rng.uniform([-0.6, -0.6, -3], [0.6, 0.6, 3], (50, 3))):
        memory = first_state(RIG, standing(seed, Rotation.from_euler("ZYX", [yaw, pitch, roll])))
        np.testing.assert_allclose(attitude_of(memory).as_euler("ZYX"), [0.0, pitch, roll], atol=0.003)


def test_an_imu_that_is_mounted_turned_levels_the_vehicle_not_itself() -> None:
    R_BS = Rotation.from_euler("ZYX", [1.2, 0.4, -2.0]).as_matrix()
    config = Config(sensor={"imu0": Imu(T_BS=transform(R_BS.tolist()))})
    bias_B = np.array([0.01, -0.02, 0.03])
    memory = first_state(config, standing(2, Rotation.from_euler("ZYX", [0, 0.2, -0.1]), bias_B, R_BS))
    np.testing.assert_allclose(attitude_of(memory).as_euler("ZYX"), [0.0, 0.2, -0.1], atol=0.003)
    np.testing.assert_allclose(memory.core["x"][0, 0, 10:13], bias_B, atol=0.01)


def test_standing_still_gives_the_gyro_bias_within_its_sigma() -> None:
    """The stated sigma also allows for a vehicle that is not perfectly still, so it must be safe, not sharp."""
    square, n = 0.0, 40
    for seed in range(n):
        bias = np.random.default_rng(100 + seed).normal(0, 0.02, 3)
        memory = first_state(RIG, standing(seed, Rotation.identity(), bias))
        x, P = memory.core["x"][0, 0], memory.core["P"][0, 0]
        square += (((x[10:13] - bias) ** 2) / np.diag(P)[9:12]).sum()
    assert 0.5 * chi2.ppf(0.025, 3 * n) < square < chi2.ppf(0.975, 3 * n)


def test_a_moving_start_claims_no_bias_and_less_tilt() -> None:
    flight = fly(Scene(seed=1, rate_rad_s=(3.0, 4.0, 2.0)))
    shaken = flight.tables["imu0"].columns["gyro_rad_s"]
    shaken += 0.3 * np.sin(np.arange(len(shaken)) * 0.3)[:, None]
    moving, still = first_state(flight.config, flight.tables), first_state(RIG, standing(1, Rotation.identity()))
    assert not moving.core["x"][0, 0, 10:13].any()
    for error in (6, 7, 9, 10, 11):
        assert moving.core["P"][0, 0, error, error] > 2.0 * still.core["P"][0, 0, error, error]


def test_a_short_still_stretch_before_the_start_is_enough() -> None:
    bias = np.array([0.02, -0.03, 0.01])
    tables = standing(3, Rotation.identity(), bias)
    tables["imu0"].columns["gyro_rad_s"][60:] += np.sin(np.arange(340))[:, None]  # still for 0.3 s only
    np.testing.assert_allclose(first_state(RIG, tables).core["x"][0, 0, 10:13], bias, atol=0.01)


@pytest.mark.parametrize("factor", [1.0 / GRAVITY, 0.0, 2.0])
def test_a_force_that_cannot_be_gravity_is_an_error_of_the_flight(factor: float) -> None:
    tables = standing(1, Rotation.identity())
    tables["imu0"].columns["accel_m_s2"][:] *= factor
    with pytest.raises(FlightError, match=r"specific force at the start is .* gravity is 9\.807"):
        run_batch(RIG, tables)


def test_a_flight_without_inertial_samples_is_an_error() -> None:
    with pytest.raises(FlightError, match="no inertial samples"):
        run_batch(RIG, {"imu0": Table(T_NS[:0], {"gyro_rad_s": np.empty((0, 3)), "accel_m_s2": np.empty((0, 3))})})


def unknown_start(sensors: tuple[str, ...], seed: int, **extra) -> MadeFlight:
    flight = fly(Scene(seed=seed, still_s=3.0, sensors=sensors, duration_s=5.0, **extra))
    config = msgspec.structs.replace(flight.config, initial=None)
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


@pytest.mark.parametrize("uwb", ["uwb0", "tdoa0", "fix0"])
def test_an_unknown_start_is_found_from_the_first_readings(uwb: str) -> None:
    """Within its sigma of half a metre, in three of three axes, for twenty flights."""
    for seed in range(20):
        flight = unknown_start((uwb,), seed)
        memory = first_state(flight.config, flight.tables)
        miss = memory.core["x"][0, 0, :3] - flight.truth.position_m[0]
        sigma = np.sqrt(np.diag(memory.core["P"][0, 0]))
        assert (np.abs(miss) < 2.0 * sigma[:3]).all()
        assert not memory.core["x"][0, 0, 3:6].any()
        assert sigma[8] > 1.0  # an absolute frame and no compass: yaw is unknown


@pytest.mark.parametrize("uwb", ["uwb0", "tdoa0", "fix0"])
def test_outliers_among_the_first_readings_do_not_shift_the_start(uwb: str) -> None:
    for seed in range(10):
        flight = unknown_start((uwb,), seed, outlier_share=0.1)
        miss = first_state(flight.config, flight.tables).core["x"][0, 0, :3] - flight.truth.position_m[0]
        assert np.linalg.norm(miss) < 0.5


def test_without_any_uwb_the_start_is_the_origin_and_yaw_is_free() -> None:
    flight = unknown_start(("range0", "flow0"), 1)
    memory = first_state(flight.config, flight.tables)
    assert not memory.core["x"][0, 0, :6].any()
    assert memory.core["P"][0, 0, 8, 8] < 0.02**2
