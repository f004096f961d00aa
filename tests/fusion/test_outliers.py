"""UWB that is wrong now and then: what the gate is for, and that it is the gate that does it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.config import Config
from axialnav.fusion.outcome import Verdict
from tests.fusion.made_flights import MadeFlight, Scene, fly, textbook

FLIGHTS = 6
RIG = ("range0", "flow0", "tdoa0")


def gated(flight: MadeFlight) -> Config:
    """Textbook filter with the gate on UWB at 99.9 %."""
    return textbook(flight.config).with_params({"uwb.gate.probability": "0.999"})


def default(flight: MadeFlight) -> Config:
    return flight.config


@pytest.fixture
def no_gate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the gate out of the filter; a probability, however close to one, only makes it eight sigma wide."""
    monkeypatch.setattr("axialnav.fusion.sources.chi_square_threshold", lambda dof, probability: math.inf)


def rmse_m(flight: MadeFlight, result: BatchResult) -> float:
    """Of position after the first five seconds, per axis."""
    error = result.track.position_m - flight.truth.position_m
    return float(np.sqrt((error[flight.t_s > 5.0] ** 2).mean()))


def mean_rmse(setting, share: float) -> float:
    total = 0.0
    for seed in range(FLIGHTS):
        flight = fly(Scene(seed=seed, sensors=RIG, outlier_share=share))
        total += rmse_m(flight, run_batch(setting(flight), flight.tables))
    return total / FLIGHTS


def test_five_percent_outliers_of_three_metres_hardly_matter_behind_the_gate() -> None:
    assert mean_rmse(gated, 0.05) < 1.2 * mean_rmse(gated, 0.0)


def test_without_the_gate_they_make_the_position_several_times_worse(no_gate: None) -> None:
    """The same flights, the same bound of 1.2 missed by far: it is the gate that keeps it above."""
    assert mean_rmse(gated, 0.05) > 3.0 * mean_rmse(gated, 0.0)


def test_without_outliers_the_gate_costs_nothing(request: pytest.FixtureRequest) -> None:
    with_gate = mean_rmse(gated, 0.0)
    request.getfixturevalue("no_gate")
    assert with_gate == pytest.approx(mean_rmse(gated, 0.0), rel=0.05)


def test_the_default_settings_keep_them_out_too() -> None:
    assert mean_rmse(default, 0.05) < 1.5 * mean_rmse(gated, 0.0)


def test_outliers_are_named_as_gated_and_honest_readings_are_fused() -> None:
    flight, clean = (fly(Scene(seed=3, sensors=RIG, outlier_share=share)) for share in (0.05, 0.0))
    result = run_batch(gated(flight), flight.tables)
    shifted = flight.tables["tdoa0"].columns["difference_m"] - clean.tables["tdoa0"].columns["difference_m"]
    wrong = shifted > 1.0
    assert 20 < wrong.sum() < 80
    log = result.log
    verdict = log.verdict[log.source == log.sensors.index("tdoa0")]
    assert (verdict[wrong] == Verdict.GATED).all()
    assert (verdict[~wrong] == Verdict.FUSED).mean() > 0.99


def test_the_gate_refuses_the_share_of_honest_readings_that_it_says() -> None:
    """At 95 %, one in twenty; a filter that refuses more than that starves itself."""
    refused, count = 0, 0
    for seed in range(FLIGHTS):
        flight = fly(Scene(seed=seed, sensors=RIG))
        log = run_batch(textbook(flight.config).with_params({"uwb.gate.probability": "0.95"}), flight.tables).log
        mine = (log.source == log.sensors.index("tdoa0")) & np.isfinite(log.nis)
        refused += int((log.verdict[mine] == Verdict.GATED).sum())
        count += int(mine.sum())
    assert refused / count == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / count))


def test_with_the_gate_taken_out_every_reading_is_fused(no_gate: None) -> None:
    flight = fly(Scene(seed=1, sensors=RIG, outlier_share=0.05))
    log = run_batch(gated(flight), flight.tables).log
    assert set(log.verdict.tolist()) == {int(Verdict.FUSED)}


def worst_miss_m(setting) -> float:
    """Largest error while every range is two metres too long for three seconds, as behind a corner."""
    flight = fly(Scene(seed=5, sensors=("range0", "flow0", "uwb0"), shadow_s=(10.0, 13.0)))
    track = run_batch(setting(flight), flight.tables).track
    during = (flight.t_s > 10.0) & (flight.t_s < 14.0)
    return float(np.linalg.norm((track.position_m - flight.truth.position_m)[during], axis=1).max())


def test_a_reflected_episode_does_not_drag_the_position_along(request: pytest.FixtureRequest) -> None:
    with_gate = worst_miss_m(default)
    assert with_gate < 0.4
    request.getfixturevalue("no_gate")
    assert worst_miss_m(gated) > 2.0 * with_gate
