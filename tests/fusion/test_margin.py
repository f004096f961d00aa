"""The margin on the accelerometer's noise: as much of it as the aids show to be needed."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from axialnav.fusion.batch import run_batch
from axialnav.fusion.kernels.margin import note_moves
from axialnav.fusion.memory import build_settings, new_memory
from tests.fusion.inside import memories
from tests.fusion.made_flights import ACCEL_DENSITY, MadeFlight, Scene, Table, fly

SETTLED_S = 20.0
SEEDS = range(4)
ALL_OF_IT = {"imu.margin_time_s": "0.0"}


@functools.cache
def flown(seed: int, times: float) -> MadeFlight:
    """Flow and range, and an accelerometer with so many times the noise of its data sheet."""
    flight = fly(Scene(seed=seed, duration_s=60.0, sensors=("range0", "flow0")))
    imu = flight.tables["imu0"]
    more = np.random.default_rng(seed).normal(0.0, 1.0, (len(imu.t_ns), 3))
    more *= ACCEL_DENSITY * np.sqrt((times**2 - 1.0) / (flight.t_s[1] - flight.t_s[0]))
    tables = {**flight.tables, "imu0": Table(imu.t_ns, {**imu.columns, "accel_m_s2": imu.columns["accel_m_s2"] + more})}
    return MadeFlight(tables, flight.config, flight.truth, flight.gyro_bias, flight.accel_bias)


def margin_upwards(times: float) -> float:
    """Mean share of the margin in use along z, which the range finder sees best."""
    shares = [
        float(memory.core["margin"][0, 2])
        for seed in SEEDS
        for _, memory in list(memories(flown(seed, times).config, flown(seed, times).tables, parts=30))[-1:]
    ]
    return float(np.mean(shares))


def normalised_error(times: float, params: dict[str, str]) -> float:
    """Squared velocity error in units of the covariance, 3 expected, mean over the flights."""
    total = []
    for seed in SEEDS:
        flight = flown(seed, times)
        track = run_batch(flight.config.with_params(params), flight.tables).track
        late = flight.t_s > SETTLED_S
        error = (track.velocity_m_s - flight.truth.velocity_m_s)[late]
        total.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(track.velocity_covariance[late]), error).mean())
    return float(np.mean(total))


def test_the_margin_follows_the_noise_that_the_accelerometer_has() -> None:
    quiet, noisy = margin_upwards(1.0), margin_upwards(2.0)
    assert quiet < 0.6  # a quarter is needed
    assert noisy > 0.7  # all of it is


def test_a_quiet_accelerometer_makes_an_honest_sigma_not_a_wide_one() -> None:
    learned, told = normalised_error(1.0, {}), normalised_error(1.0, ALL_OF_IT)
    assert told < 2.0
    assert told + 0.5 < learned < 4.0


def test_what_teaches_nothing_leaves_the_margin_alone() -> None:
    settings = build_settings(flown(0, 1.0).config)[0]
    core = new_memory(1).core[0]
    core["margin"] = 0.5
    note_moves(np.int64(0), 4.0, 0.0, core, settings)  # silence
    assert core["margin"].tolist() == [0.5, 0.5, 0.5]
    core["imu_fault"] = 1
    note_moves(np.int64(0), 4.0, 0.1, core, settings)  # doubt
    assert core["margin"].tolist() == [0.5, 0.5, 0.5]
    core["imu_fault"] = 0
    note_moves(np.int64(0), 4.0, 0.1, core, settings)
    assert core["margin"][0] > 0.5
    assert core["margin"][1:].tolist() == [0.5, 0.5]


@pytest.mark.parametrize(("moved", "bound"), [(0.0, 0.25), (1e6, 1.0)])
def test_the_margin_stays_between_the_data_sheet_and_what_was_told(moved: float, bound: float) -> None:
    settings = build_settings(flown(0, 1.0).config)[0]
    core = new_memory(1).core[0]
    core["margin"] = 0.6
    for _ in range(2000):
        note_moves(np.int64(2), moved, 0.1, core, settings)
    assert core["margin"][2] == bound
