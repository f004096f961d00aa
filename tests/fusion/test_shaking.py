"""An accelerometer that is shaken: what changes faster than a vehicle can is believed less, and said so if it lasts."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.kernels.shaking import note_shaking
from axialnav.fusion.memory import build_settings, new_memory
from axialnav.fusion.outcome import Health
from tests.fusion.made_flights import MadeFlight, Scene, Table, fly

BLOW_S, SHAKEN_S, CALM_S = 10.0, (10.0, 16.0), 40.0
JOLTS_BELIEVED = {"imu.jolt_time_s": "0.0"}
BIAS_STAYS = {"imu.shaken_walk": "0.0"}
NO_RIVAL = {"imu_fault.enabled": "false"}


def felt(flight: MadeFlight, more_m_s2: np.ndarray) -> MadeFlight:
    """The flight with something else in its accelerometer's x, which the vehicle did not do."""
    imu = flight.tables["imu0"]
    force = imu.columns["accel_m_s2"].copy()
    force[:, 0] += more_m_s2
    tables = {**flight.tables, "imu0": Table(imu.t_ns, {**imu.columns, "accel_m_s2": force})}
    return MadeFlight(tables, flight.config, flight.truth, flight.gyro_bias, flight.accel_bias)


@functools.cache
def struck(seed: int) -> MadeFlight:
    """One blow: minus 6 m/s^2 in the mean over a tenth of a second, in peaks."""
    flight = fly(Scene(seed=seed, sensors=("tdoa0",), duration_s=20.0))
    during = (flight.t_s >= BLOW_S) & (flight.t_s < BLOW_S + 0.1)
    peaks = np.random.default_rng(seed).uniform(-12.0, 0.0, len(flight.t_s))
    return felt(flight, np.where(during, peaks, 0.0))


@functools.cache
def shaken(seed: int) -> MadeFlight:
    """Seconds of vibration with a wandering offset, as rectification makes it; then it is over."""
    flight = fly(Scene(seed=seed, sensors=("tdoa0",), duration_s=45.0, uwb_rate_hz=200.0))
    rng, t = np.random.default_rng(seed), flight.t_s
    during = (t >= SHAKEN_S[0]) & (t < SHAKEN_S[1])
    offset = -1.5 + np.sin(2.0 * np.pi * 0.5 * (t - SHAKEN_S[0]))
    return felt(flight, np.where(during, offset + rng.normal(0.0, 2.5, len(t)), 0.0))


def run(flight: MadeFlight, params: Mapping[str, str] | None = None) -> BatchResult:
    return run_batch(flight.config.with_params(dict(params or {})), flight.tables)


def velocity(flight: MadeFlight, result: BatchResult, start_s: float, end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Error of the velocity along x [m/s] and its sigma, between two instants."""
    during = (flight.t_s >= start_s) & (flight.t_s < end_s)
    error = (result.track.velocity_m_s - flight.truth.velocity_m_s)[during, 0]
    return error, np.sqrt(result.track.velocity_covariance[during, 0, 0])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


def is_flagged(result: BatchResult) -> np.ndarray:
    return (result.track.flags & Health.ACCELEROMETER_FAULT) > 0


def test_a_blow_is_believed_less_and_its_error_stays_within_the_sigma() -> None:
    inside, errors = {}, {}
    for name, params in (("with", {}), ("without", JOLTS_BELIEVED)):
        pairs = [velocity(struck(seed), run(struck(seed), {**NO_RIVAL, **params}), 10.1, 11.1) for seed in range(10)]
        error, sigma = (np.concatenate(part) for part in zip(*pairs, strict=True))
        inside[name], errors[name] = float((np.abs(error) < 3.0 * sigma).mean()), rms(error)
    assert inside["with"] > 0.99
    assert inside["without"] < 0.9
    assert errors["with"] < 0.9 * errors["without"]


def test_shaking_that_lasts_lets_the_bias_walk_and_is_named_until_it_is_over() -> None:
    for seed in range(3):
        flight = shaken(seed)
        with_it, without = run(flight), run(flight, {**BIAS_STAYS, **NO_RIVAL})
        flagged = is_flagged(with_it)
        assert not flagged[flight.t_s < SHAKEN_S[0]].any()
        assert flagged[(flight.t_s > SHAKEN_S[0] + 2.0) & (flight.t_s < SHAKEN_S[1])].all()
        assert not flagged[flight.t_s > CALM_S].any()
        errors = [rms(velocity(flight, result, *SHAKEN_S)[0]) for result in (with_it, without)]
        assert errors[0] < 0.8 * errors[1]


@pytest.mark.parametrize("density", [0.02, 0.1])
def test_noise_that_the_data_sheet_states_is_no_shaking(density: float) -> None:
    """Standing still with an accelerometer of that density, sampled at 200 Hz, for a minute."""
    config = fly(Scene(duration_s=2.0, sensors=())).config
    told = msgspec.structs.replace(config.sensor["imu0"], accel_noise_density=density)
    settings = build_settings(msgspec.structs.replace(config, sensor={**config.sensor, "imu0": told}))[0]
    core, dt, scratch = new_memory(1).core[0], 0.005, np.zeros(3)
    samples = np.random.default_rng(6).normal(0.0, density / np.sqrt(dt), (12_000, 3)) + np.array([0.0, 0.0, 9.81])
    core["force"] = samples[0]
    shaken_for, jolts = 0, 0.0
    for before, sample in pairwise(samples):
        note_shaking(dt, 0.5 * (before + sample), scratch, core, settings)
        shaken_for += core["shaken_walk"].any()
        jolts += core["jolt"].sum() * dt
    assert shaken_for == 0
    assert jolts / 60.0 < 0.3 * density**2  # nearly all of it is the noise that is told


def test_only_the_axes_that_are_shaken_lose_their_bias() -> None:
    settings = build_settings(fly(Scene(duration_s=2.0, sensors=())).config)[0]
    core, dt, scratch, rng = new_memory(1).core[0], 0.005, np.zeros(3), np.random.default_rng(8)
    core["force"] = (0.0, 0.0, 9.81)
    for _ in range(2000):
        note_shaking(dt, rng.normal((0.0, 0.0, 9.81), (3.0, 0.3, 0.0)), scratch, core, settings)
    along, across, none = core["shaken_walk"].tolist()
    assert along > 1.0
    assert 0.0 < across < 0.03 * along  # a hundredth of the mean square
    assert none == 0.0
