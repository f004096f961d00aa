"""A sick accelerometer: minus 3 m/s^2 along body x that grows over two seconds, wanders, and may go again."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.kernels.rival import supervise_imu
from axialnav.fusion.memory import build_settings, new_memory
from axialnav.fusion.outcome import Health
from tests.fusion.made_flights import MadeFlight, Scene, fly

START_S, RAMP_S = 10.0, 2.0
FLIGHTS = 8
RIG = ("range0", "flow0", "tdoa0")


@functools.cache
def flown(seed: int, enabled: bool = True, end_s: float = 99.0, duration_s: float = 30.0, ramp_s: float = RAMP_S):
    """Flight and result; UWB at 200 Hz as on the vehicles that showed such a fault."""
    fault = {"start_s": START_S, "end_s": end_s, "ramp_s": ramp_s, "size_m_s2": -3.0, "wander_m_s2": 1.0}
    flight = fly(Scene(seed=seed, duration_s=duration_s, sensors=RIG, uwb_rate_hz=200.0, accel_fault=fault))
    on = str(enabled).lower()  # the supervisor alone saves some of it
    config = flight.config.with_params({"imu_fault.enabled": on, "supervisor.enabled": on})
    return flight, run_batch(config, flight.tables)


def velocity_rmse(flight: MadeFlight, result: BatchResult, after_s: float = START_S) -> float:
    error = result.track.velocity_m_s - flight.truth.velocity_m_s
    return float(np.sqrt((error[flight.t_s > after_s] ** 2).mean()))


def is_flagged(result: BatchResult) -> np.ndarray:
    return (result.track.flags & Health.ACCELEROMETER_FAULT) > 0


@pytest.mark.parametrize("seed", range(FLIGHTS))
def test_the_rival_filter_saves_the_velocity(seed: int) -> None:
    assert velocity_rmse(*flown(seed)) < 0.3


@pytest.mark.parametrize("seed", range(FLIGHTS))
def test_the_fault_is_flagged_within_a_second_of_its_full_size_and_not_before_it_begins(seed: int) -> None:
    flight, result = flown(seed)
    flagged = is_flagged(result)
    assert not flagged[flight.t_s < START_S].any()
    assert flight.t_s[np.argmax(flagged)] < START_S + RAMP_S + 1.0
    assert flagged[flight.t_s > START_S + RAMP_S + 1.0].mean() > 0.95


def test_without_the_rival_the_filter_is_lost() -> None:
    """A plain gate refuses the very readings that could tell: the velocity runs away by metres per second."""
    alone = [flown(seed, enabled=False) for seed in range(FLIGHTS)]
    assert not any(is_flagged(result).any() for _, result in alone)
    assert min(velocity_rmse(*pair) for pair in alone) > 1.5


def test_a_jump_that_shuts_the_gates_at_once_is_seen_too() -> None:
    """Refused readings raise the doubt: what they ask for counts though it is not given."""
    for seed in range(3):
        flight, result = flown(seed, ramp_s=0.01)
        assert START_S < flight.t_s[np.argmax(is_flagged(result))] < START_S + 1.5
        assert velocity_rmse(flight, result) < 0.4


def test_the_flag_clears_after_the_fault_has_gone() -> None:
    """Several good trials of two seconds, and not at once: the accelerometer has to earn it."""
    flight, result = flown(1, end_s=20.0, duration_s=60.0)
    flagged = is_flagged(result)
    assert flagged[(flight.t_s > 13.0) & (flight.t_s < 20.0)].all()
    cleared = flight.t_s[np.flatnonzero(flagged)[-1]]
    assert 25.0 < cleared < 55.0
    assert velocity_rmse(flight, result, after_s=55.0) < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("rig", [RIG, ("range0", "flow0"), ("uwb0", "range0")], ids=" ".join)
def test_no_false_alarm_in_thirty_healthy_flights(rig: tuple[str, ...]) -> None:
    for seed in range(30):
        flight = fly(Scene(seed=seed, sensors=rig))
        assert not is_flagged(run_batch(flight.config, flight.tables)).any(), seed


@pytest.mark.slow
def test_outliers_are_no_fault_of_the_accelerometer() -> None:
    """One reading in twenty three metres wrong, thirty flights."""
    for seed in range(30):
        flight = fly(Scene(seed=seed, sensors=RIG, outlier_share=0.05))
        assert not is_flagged(run_batch(flight.config, flight.tables)).any(), seed


@pytest.mark.parametrize(("evidence", "least", "most"), [(0.0, 0.45, 0.55), (10.0, 0.95, 1.0)])
@pytest.mark.parametrize("fault", [0, 1])
def test_doubt_that_lasts_runs_the_rival_half_of_the_time_unless_it_does_better(
    evidence: float, least: float, most: float, fault: int
) -> None:
    """A believed fault lasts by itself, and only trials that the healthy rival fails are followed by a rest."""
    settings = build_settings(fly(Scene(duration_s=3.0, sensors=RIG)).config)
    m, step_s, on_trial = new_memory(1).core[0], 0.01, 0
    m["imu_fault"] = fault
    for step in range(4000):
        m["t_imu"] = round(1e9 * step_s * step)
        m["correction"], m["correction_variance"] = 2.0 * step_s, 1e-6
        m["evidence"] = evidence - (5.0 if fault else 0.0)
        m["good_trials"] = 0
        supervise_imu(step_s, m, settings[0])
        on_trial += int(m["on_trial"])
    assert least < on_trial / 4000 <= most
