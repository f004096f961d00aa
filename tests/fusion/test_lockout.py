"""Started metres wrong and sure of it, nearly every reading is refused by its gate: only re-anchoring can help."""

from __future__ import annotations

import functools

import msgspec
import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.outcome import Health, Verdict
from tests.fusion.inside import memories
from tests.fusion.made_flights import MadeFlight, Scene, fly

CASES = {"fix0": 8.0, "uwb0": 3.0}  # source and how far the start is wrong along x [m]
PATIENCE_S = 15.0
NEVER_S = "1e6"


def lost(uwb: str, seed: int = 1) -> MadeFlight:
    """A flight whose first position is metres wrong and believed to ten centimetres."""
    flight = fly(Scene(seed=seed, duration_s=30.0, sensors=("range0", "flow0", uwb)))
    initial = flight.config.initial
    x, y, z = initial.position_m
    moved = msgspec.structs.replace(initial, position_m=(x + CASES[uwb], y, z))
    config = msgspec.structs.replace(flight.config, initial=moved)
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


@functools.cache
def recovered(uwb: str) -> tuple[MadeFlight, BatchResult]:
    flight = lost(uwb)
    return flight, run_batch(flight.config, flight.tables)


def miss_m(flight: MadeFlight, result: BatchResult) -> np.ndarray:
    return np.linalg.norm(result.track.position_m - flight.truth.position_m, axis=1)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("uwb", CASES)
def test_a_filter_that_sees_the_floor_waits_fifteen_seconds_then_moves(uwb: str, seed: int) -> None:
    flight = lost(uwb, seed)
    result = run_batch(flight.config, flight.tables)
    miss, t = miss_m(flight, result), flight.t_s
    assert miss[t < PATIENCE_S - 0.1].min() > 0.6 * CASES[uwb]
    assert result.track.resets[-1] == 1
    # both ways must have agreed for a while before
    assert miss[t > PATIENCE_S + 5.0].max() < 0.5


def test_the_patience_is_that_of_the_configuration() -> None:
    flight = lost("fix0")
    result = run_batch(flight.config.with_params({"supervisor.reanchor_aided_s": "4.0"}), flight.tables)
    assert 4.0 <= flight.t_s[np.argmax(result.track.resets > 0)] < 5.0  # trust takes most of a second to fade first


@pytest.mark.parametrize("uwb", CASES)
def test_switched_off_it_stays_lost(uwb: str) -> None:
    flight = lost(uwb)
    never = {"supervisor.reanchor_aided_s": NEVER_S, "supervisor.reanchor_alone_s": NEVER_S}
    result = run_batch(flight.config.with_params(never), flight.tables)
    assert result.track.resets.max() == 0
    assert miss_m(flight, result).min() > 0.4 * CASES[uwb]
    mine = result.log.source == result.log.sensors.index(uwb)
    assert (result.log.verdict[mine] != Verdict.FUSED).mean() > 0.8


def test_the_last_reset_is_told_with_the_state() -> None:
    """The jump that is published is the jump that was made; the streaming door tells it."""
    flight, result = recovered("fix0")
    ((_, memory),) = memories(flight.config, flight.tables)
    at = int(np.argmax(result.track.resets > 0))
    jump = result.track.position_m[at] - result.track.position_m[at - 1]
    np.testing.assert_allclose(memory.core["last_reset_m"][0], jump, atol=0.1)
    np.testing.assert_allclose(memory.core["last_reset_m"][0], [-8.0, 0.0, 0.0], atol=0.3)


@pytest.mark.parametrize("uwb", CASES)
def test_only_the_position_moves(uwb: str) -> None:
    """Over the reset velocity, attitude and biases change by no more than one inertial step changes them."""
    _, result = recovered(uwb)
    track = result.track
    at = int(np.argmax(track.resets > 0))
    before, after = at - 1, at
    assert np.linalg.norm(track.position_m[after] - track.position_m[before]) > 2.0
    assert np.linalg.norm(track.velocity_m_s[after] - track.velocity_m_s[before]) < 0.05
    assert np.abs(track.quaternion_WB[after] - track.quaternion_WB[before]).max() < 0.01
    for steady in (track.gyro_bias_rad_s, track.accel_bias_m_s2):
        assert np.abs(steady[after] - steady[before]).max() < 1e-2


def test_velocity_never_suffers_from_being_lost() -> None:
    flight, result = recovered("uwb0")
    error = result.track.velocity_m_s - flight.truth.velocity_m_s
    settled = flight.t_s > 3.0
    assert np.linalg.norm(error[settled], axis=1).max() < 0.3


def test_the_uncertainty_grows_with_the_jump_and_shrinks_with_the_fixes_after_it() -> None:
    _, result = recovered("fix0")
    sigma = np.sqrt(np.diagonal(result.track.position_covariance, axis1=1, axis2=2)[:, 0])
    at = int(np.argmax(result.track.resets > 0))
    assert sigma[at - 1] < 1.0
    assert sigma[at] > sigma[at - 1]
    assert sigma[-1] < 0.2


def test_the_source_is_flagged_as_suspect_while_it_is_refused() -> None:
    flight, result = recovered("fix0")
    suspect = (result.track.flags & Health.UWB_SUSPECT) > 0
    assert suspect[(flight.t_s > 3.0) & (flight.t_s < 14.5)].all()
    assert not suspect[flight.t_s > 20.0].any()


def test_a_source_that_makes_no_sense_is_not_followed() -> None:
    """Fixes that jump about by tens of metres are refused, but no single offset explains them."""
    flight = fly(Scene(seed=2, duration_s=30.0, sensors=("range0", "flow0", "fix0")))
    fixes = flight.tables["fix0"].columns["position_m"]
    fixes += np.random.default_rng(2).choice([-30.0, 30.0], fixes.shape)
    result = run_batch(flight.config, flight.tables)
    assert result.track.resets.max() == 0
    assert miss_m(flight, result).max() < 5.0


def test_healthy_flights_are_never_reset() -> None:
    for seed in range(10):
        flight = fly(Scene(seed=seed, duration_s=30.0))
        result = run_batch(flight.config, flight.tables)
        assert result.track.resets.max() == 0
        assert not (result.track.flags & Health.UWB_SUSPECT).any()
