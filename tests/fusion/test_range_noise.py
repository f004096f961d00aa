"""A range finder that states no sigma: what is new with each reading, and what stays."""

from __future__ import annotations

import functools

import msgspec
import numpy as np

from axialnav.fusion.batch import BatchResult, run_batch
from tests.fusion.made_flights import MadeFlight, Scene, Table, fly

SEEDS = range(6)
WHITE_M, SLOW_M = 0.004, 0.014
SETTLED_S = 8.0


@functools.cache
def flown(seed: int) -> MadeFlight:
    """Flow, and a range finder over the floor that is off by a constant and repeats to a few millimetres."""
    flight = fly(Scene(seed=seed, duration_s=40.0, sensors=("range0", "flow0")))
    rng, told, truth = np.random.default_rng(seed), flight.tables["range0"], flight.truth
    t = (told.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9
    range_m = truth.position_m[:, 2] / truth.attitude.as_matrix()[:, 2, 2]
    noise = rng.normal(0.0, SLOW_M) + rng.normal(0.0, WHITE_M, t.size)
    tables = {**flight.tables, "range0": Table(told.t_ns, {"range_m": np.interp(t, flight.t_s, range_m) + noise})}
    spec = msgspec.structs.replace(flight.config.sensor["range0"], sigma_m=None)
    config = msgspec.structs.replace(flight.config, sensor={**flight.config.sensor, "range0": spec})
    config = config.with_params({"imu.accel_noise_scale": "1.0"})  # as simulated
    return MadeFlight(tables, config, truth, flight.gyro_bias, flight.accel_bias)


def run(seed: int, white_m: float) -> BatchResult:
    flight = flown(seed)
    return run_batch(flight.config.with_params({"range.white_m": str(white_m)}), flight.tables)


def climbing(white_m: float) -> float:
    """Squared error of the vertical velocity in units of its variance, mean over the flights."""
    total = []
    for seed in SEEDS:
        flight, track = flown(seed), run(seed, white_m).track
        late = flight.t_s > SETTLED_S
        error = (track.velocity_m_s - flight.truth.velocity_m_s)[late, 2]
        total.append(float((error**2 / track.velocity_covariance[late, 2, 2]).mean()))
    return float(np.mean(total))


def test_what_stays_in_a_range_is_no_doubt_about_the_climb() -> None:
    honest, all_of_it_new = climbing(WHITE_M), climbing(0.015)
    assert 0.8 < honest < 1.25
    assert all_of_it_new < 0.8 * honest


def test_the_gate_is_that_of_the_whole_error() -> None:
    log = run(0, WHITE_M).log
    ranges = log.source == log.sensors.index("range0")
    assert (log.variance[ranges, 0] > 0.015**2).all()
    assert (log.weight[ranges] > 0.5).all()


def test_a_range_that_states_its_sigma_is_taken_at_its_word() -> None:
    flight = flown(0)
    spec = msgspec.structs.replace(flight.config.sensor["range0"], sigma_m=0.015)
    config = msgspec.structs.replace(flight.config, sensor={**flight.config.sensor, "range0": spec})
    tracks = [run_batch(config.with_params({"range.white_m": w}), flight.tables).track for w in ("0.004", "0.01")]
    assert np.array_equal(tracks[0].velocity_m_s, tracks[1].velocity_m_s)
