"""Thresholds and weights: numbers that a table of the chi-square distribution must confirm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from axialnav.fusion.batch import run_batch
from axialnav.fusion.chi_square import chi_square_threshold
from axialnav.fusion.config import Config, Gate, UwbTuning
from axialnav.fusion.kernels.measure import repetition
from axialnav.fusion.kernels.update import redescend
from axialnav.fusion.outcome import Reason
from axialnav.fusion.sources import build_sources
from axialnav.models.rig import Imu, Uwb
from tests.fusion.made_flights import Scene, fly


@pytest.mark.parametrize("dof", [1, 2, 3])
@pytest.mark.parametrize("probability", [1e-6, 0.5, 0.9, 0.95, 0.99, 0.999, 0.999999, 1 - 1e-12])
def test_thresholds_are_the_quantiles_of_chi_square(dof: int, probability: float) -> None:
    assert chi_square_threshold(dof, probability) == pytest.approx(chi2.ppf(probability, dof), rel=1e-9)


def test_the_table_every_textbook_prints() -> None:
    assert [round(chi_square_threshold(dof, 0.95), 3) for dof in (1, 2, 3)] == [3.841, 5.991, 7.815]


def test_a_source_carries_its_gate_for_one_two_and_three_axes() -> None:
    gate = Gate(probability=0.97, soft_sigma=1.5)
    config = Config(sensor={"imu0": Imu(), "uwb0": Uwb(measurement="position")}, uwb=UwbTuning(gate=gate))
    source = build_sources(config)[1]
    np.testing.assert_allclose(source["gate"], chi2.ppf(0.97, [1, 2, 3]))
    assert source["soft_nis"] == pytest.approx(2.25)


def test_a_reading_in_the_middle_has_full_weight_and_one_at_the_soft_limit_a_quarter() -> None:
    assert redescend(0.0, 4.0) == 1.0
    assert redescend(4.0, 4.0) == 0.25


def test_the_weight_only_ever_falls_and_takes_the_influence_down_with_it() -> None:
    """A redescending weight: the pull of a reading (weight times innovation) has one maximum, then it fades."""
    sigmas = np.linspace(0.0, 20.0, 4001)
    weights = np.array([redescend(s * s, 6.25) for s in sigmas])
    assert (np.diff(weights) < 0.0).all()
    assert ((weights > 0.0) & (weights <= 1.0)).all()
    pull = weights * sigmas
    top = int(np.argmax(pull))
    assert (np.diff(pull[: top + 1]) > 0.0).all()
    assert (np.diff(pull[top:]) < 0.0).all()
    assert sigmas[top] == pytest.approx(2.5 / np.sqrt(3.0), abs=0.01)
    assert pull[-1] < 0.01 * pull[top] * 10


def test_readings_that_repeat_each_other_count_as_fewer() -> None:
    """Variance of the mean of many readings whose errors are correlated by exp(-dt / tau), against white ones."""
    assert repetition(0.1, 0.0) == 1.0
    assert repetition(0.0, 0.012) == 1.0
    n = 20000
    lags = np.arange(1, n)
    for tau, dt in ((0.2, 0.02), (0.012, 0.0025), (0.012, 0.1)):
        variance = 1.0 + 2.0 * ((1 - lags / n) * np.exp(-lags * dt / tau)).sum()
        assert repetition(dt, tau) == pytest.approx(variance, rel=2e-3)


def test_the_first_reading_of_a_source_stands_for_itself() -> None:
    """How often it speaks is not known yet; that must not blind it."""
    assert repetition(float("nan"), 0.012) == 1.0
    flight = fly(Scene(seed=1, duration_s=2.0, sensors=("uwb0",)))
    assert run_batch(flight.config, flight.tables).log.reason[0] in (Reason.NONE, Reason.INNOVATION)
