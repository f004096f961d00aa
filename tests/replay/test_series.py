"""Statistics of correlated series, against closed forms and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from axialnav.replay.series import (
    autocorrelation,
    chi_square_mean_band,
    effective_samples_of_squares,
    lag1_autocorrelation,
)


def autoregressive(keep: float, count: int, rng: np.random.Generator, columns: int = 3) -> np.ndarray:
    noise = rng.normal(size=(count, columns)) * np.sqrt(1.0 - keep**2)
    noise[0] = rng.normal(size=columns)
    return lfilter([1.0], [1.0, -keep], noise, axis=0)


@pytest.mark.parametrize("keep", [-0.5, 0.0, 0.8])
def test_lag1_of_a_first_order_series_is_its_memory(keep: float) -> None:
    series = autoregressive(keep, 20_000, np.random.default_rng(1), columns=1)[:, 0]
    assert lag1_autocorrelation(series) == pytest.approx(keep, abs=4.0 / np.sqrt(series.size))


def test_lag1_of_too_little_or_of_a_constant_is_unknown() -> None:
    assert lag1_autocorrelation(np.array([1.0, 2.0])) is None
    assert lag1_autocorrelation(np.ones(10)) is None


def test_autocorrelation_is_the_textbook_sum() -> None:
    values = autoregressive(0.7, 300, np.random.default_rng(6), columns=1)[:, 0]
    centred = values - values.mean()
    expected = [centred[: 300 - k] @ centred[k:] / (centred @ centred) for k in range(300)]
    np.testing.assert_allclose(autocorrelation(values), expected, atol=1e-12)
    assert autocorrelation(values)[1] == pytest.approx(lag1_autocorrelation(values))


@pytest.mark.parametrize("keep", [0.0, 0.9, 0.98])
def test_effective_samples_match_the_closed_form_of_a_first_order_series(keep: float) -> None:
    count = 40_000
    found = effective_samples_of_squares(autoregressive(keep, count, np.random.default_rng(2)))
    expected = count * (1.0 - keep**2) / (1.0 + keep**2)  # autocovariance of the squares is keep ** (2 k)
    assert found == pytest.approx(expected, rel=0.15)


def test_effective_samples_of_nothing_one_and_a_constant() -> None:
    assert effective_samples_of_squares(np.zeros((0, 3))) == 0.0
    assert effective_samples_of_squares(np.ones((1, 3))) == 1.0
    assert effective_samples_of_squares(np.ones((1000, 3))) < 3.0


@pytest.mark.parametrize(("dof", "samples"), [(3, 1.0), (3, 40.0), (1, 7.0)])
def test_band_is_that_of_a_chi_square_mean(dof: int, samples: float) -> None:
    low, high = chi_square_mean_band(dof, samples, 0.95)
    assert chi2.cdf(low * samples, dof * samples) == pytest.approx(0.025)
    assert chi2.cdf(high * samples, dof * samples) == pytest.approx(0.975)


@pytest.mark.parametrize("memory", [1.0, 50.0, 200.0])
def test_an_honest_series_stays_in_its_band_19_times_out_of_20(memory: float) -> None:
    rng = np.random.default_rng(3)
    trials, inside = 200, 0
    for _ in range(trials):
        error = autoregressive(float(np.exp(-1.0 / memory)), 4000, rng)
        low, high = chi_square_mean_band(3, effective_samples_of_squares(error))
        inside += low < (error**2).sum(axis=1).mean() < high
    assert 0.90 <= inside / trials <= 0.99
