"""Is the filter as sure as it should be?  Errors over many flights against its own covariance.

The filter is the textbook one here: no redescending weight and UWB readings counted as independent, because the
simulated noise is Gaussian and white.  With the defaults it is deliberately less sure of UWB.

One rig has errors as the bias states of UWB paths expect them: alike for a while and over some way.

Twenty-four bands are looked at; each is wide enough that a sound filter is inside all of them with 95 % (Bonferroni).
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from axialnav.fusion.batch import run_batch
from axialnav.fusion.memory import whole_covariance
from tests.fusion.inside import memories
from tests.fusion.made_flights import MadeFlight, Scene, Table, fly, textbook

FLIGHTS = 100
BAND = (0.025 / 24, 1.0 - 0.025 / 24)
BLOCKS = {
    "position": slice(0, 3),
    "velocity": slice(3, 6),
    "attitude": slice(6, 9),
    "gyro bias": slice(9, 12),
    "accelerometer bias": slice(12, 15),
}
BIASED = "ranges with biases"
RIGS = {
    "range differences": ("range0", "flow0", "tdoa0", "attitude0"),
    "ranges": ("range0", "flow0", "uwb0"),
    "fixes": ("flow0", "fix0"),
    BIASED: ("range0", "flow0", "uwb0"),
}
BIAS_M, BIAS_TIME_S, BIAS_WAY_M = 0.14, 0.6, 0.4


def with_biases(flight: MadeFlight, seed: int) -> MadeFlight:
    """Add to every path an error that fades with time and with the way flown, and tell the filter."""
    table, rng = flight.tables["uwb0"], np.random.default_rng([seed, 14])
    t = (table.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flight.truth.position_m, axis=0), axis=1))])
    flown, ranges = np.interp(t, flight.t_s, way), table.columns["range_m"].copy()
    for anchor in np.unique(table.columns["anchor"]):
        rows = np.flatnonzero(table.columns["anchor"] == anchor)
        left = np.exp(-np.diff(t[rows]) / BIAS_TIME_S - np.diff(flown[rows]) / BIAS_WAY_M)
        bias = rng.normal(0.0, BIAS_M)
        for row, keep in zip(rows, [1.0, *left], strict=True):
            bias = keep * bias + np.sqrt(1.0 - keep * keep) * rng.normal(0.0, BIAS_M)
            ranges[row] += bias
    tables = {**flight.tables, "uwb0": Table(table.t_ns, {**table.columns, "range_m": ranges})}
    told = {"uwb.range_bias_sigma_m": BIAS_M, "uwb.range_bias_time_s": BIAS_TIME_S, "uwb.bias_length_m": BIAS_WAY_M}
    config = textbook(flight.config).with_params({name: str(value) for name, value in told.items()})
    return MadeFlight(tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


@functools.cache
def flown(rig: str, seed: int) -> MadeFlight:
    """A flight with the configuration that knows its noise."""
    flight = fly(Scene(seed=seed, sensors=RIGS[rig]))
    if rig == BIASED:
        return with_biases(flight, seed)
    config = textbook(flight.config)
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


def errors_at_the_end(rig: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Error state (15,) truth minus estimate after 20 s, and its stated covariance."""
    flight = flown(rig, seed)
    ((t_ns, memory),) = memories(flight.config, flight.tables)
    x, P, end = memory.core["x"][0, 0], whole_covariance(memory.core["P"][0, 0]), -1
    assert int(memory.core["t_imu"][0]) == flight.tables["imu0"].t_ns[end] == t_ns
    attitude = Rotation.from_quat(x[6:10], scalar_first=True)
    error = [
        flight.truth.position_m[end] - x[:3],
        flight.truth.velocity_m_s[end] - x[3:6],
        (attitude.inv() * flight.truth.attitude[end]).as_rotvec(),
        flight.gyro_bias[end] - x[10:13],
        flight.accel_bias[end] - x[13:16],
    ]
    return np.concatenate(error), P[:15, :15].copy()


@functools.cache
def sample(rig: str) -> list[tuple[np.ndarray, np.ndarray]]:
    return [errors_at_the_end(rig, seed) for seed in range(FLIGHTS)]


def nees(rig: str, block: slice) -> float:
    """Sum over the flights of error' P^-1 error."""
    return sum(float(e[block] @ np.linalg.solve(P[block, block], e[block])) for e, P in sample(rig))


@pytest.mark.slow
@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("rig", RIGS)
def test_errors_are_as_large_as_the_covariance_says(rig: str, block: str) -> None:
    low, high = chi2.ppf(BAND, 3 * FLIGHTS)
    assert low < nees(rig, BLOCKS[block]) < high


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_errors_are_as_correlated_as_the_covariance_says(rig: str) -> None:
    low, high = chi2.ppf(BAND, 9 * FLIGHTS)
    assert low < nees(rig, slice(0, 9)) < high


@functools.cache
def innovations(rig: str) -> dict[str, tuple[float, int]]:
    """Sum of NIS and of degrees of freedom by sensor, over all flights, from 5 s on."""
    total: dict[str, tuple[float, int]] = {}
    for seed in range(FLIGHTS):
        flight = flown(rig, seed)
        log = run_batch(flight.config, flight.tables).log
        settled = log.t_ns > flight.tables["imu0"].t_ns[0] + 5_000_000_000
        for index, name in enumerate(log.sensors):
            mine = settled & (log.source == index)
            nis, dof = total.get(name, (0.0, 0))
            if mine.any():
                total[name] = (nis + float(log.nis[mine].sum()), dof + int(log.dof[mine].sum()))
    return total


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_innovations_of_every_source_are_as_large_as_predicted(rig: str) -> None:
    """Within 3 % of 1 per axis: tens of thousands of readings would show even the rounding of pixels."""
    for name, (nis, dof) in innovations(rig).items():
        assert dof > 5000
        assert nis / dof == pytest.approx(1.0, abs=0.03), name


@functools.cache
def lag_one(rig: str) -> dict[str, tuple[float, int]]:
    """Correlation of neighbouring normalised innovations of the first axis by sensor, and how many pairs there are."""
    total: dict[str, tuple[float, float, int]] = {}
    for seed in range(20):
        flight = flown(rig, seed)
        log = run_batch(flight.config, flight.tables).log
        for index, name in enumerate(log.sensors):
            mine = (log.source == index) & (log.t_ns > flight.tables["imu0"].t_ns[0] + 5_000_000_000) & (log.dof > 0)
            y = log.innovation[mine, 0] / np.sqrt(log.variance[mine, 0])
            product, square, pairs = total.get(name, (0.0, 0.0, 0))
            total[name] = (product + float(y[1:] @ y[:-1]), square + float(y @ y), pairs + max(len(y) - 1, 0))
    return {name: (product / square, pairs) for name, (product, square, pairs) in total.items() if pairs}


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_innovations_of_every_source_are_white(rig: str) -> None:
    """Neighbours are uncorrelated within four sigma, and within 0.03 where there are very many."""
    for name, (correlation, pairs) in lag_one(rig).items():
        assert abs(correlation) < max(4.0 / np.sqrt(pairs), 0.03), name


@pytest.mark.slow
def test_a_filter_that_thinks_its_sensors_twice_as_good_is_found_out() -> None:
    """The band is narrow enough to notice: the same flights with UWB and flow noise halved in the configuration."""
    total = 0.0
    for seed in range(10):
        flight = fly(Scene(seed=seed, sensors=RIGS["ranges"]))
        config = textbook(flight.config).with_params({"sensor.uwb0.sigma_m": "0.075", "sensor.flow0.sigma_px": "0.4"})
        ((_, memory),) = memories(config, flight.tables)
        error = flight.truth.velocity_m_s[-1] - memory.core["x"][0, 0, 3:6]
        total += error @ np.linalg.solve(memory.core["P"][0, 0, 3:6, 3:6], error)
    assert total > chi2.ppf(0.975, 30)
