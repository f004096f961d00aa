"""The models of a composite's comb and of one exposure's blur, their derivatives, and the climbs to their maxima."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from axialnav.estimators.spectral import ratio as combs
from axialnav.estimators.spectral.look import candidates
from axialnav.estimators.spectral.picture import FIRST_BIN, Spectra, row_window
from axialnav.estimators.spectral.problem import pose
from axialnav.estimators.spectral.ratio import Ratio, comb_shape
from axialnav.estimators.spectral.shapes import exposure_power, pair_lags
from axialnav.estimators.spectral.whittle import BLUR, NOISE, PARAMETERS, pull, solve_spd

LENGTH, FRAMES = 640, 5
FREQUENCY = np.arange(FIRST_BIN, 288) / LENGTH
NO_OFFSET = np.zeros(len(FREQUENCY))
WIDE = np.ones(4096)  # autocorrelation of a window without end
THETA = np.array([6.4, 0.97, 0.9, 0.01, 0.02])


def comb_of(
    displacement_px: float, times: tuple[int, ...] = tuple(range(FRAMES)), window: np.ndarray = WIDE
) -> np.ndarray:
    out = np.empty((len(FREQUENCY), 2))
    comb_shape(displacement_px, pair_lags(times), FREQUENCY, NO_OFFSET, window, out)
    return out


def made_ratio(theta: np.ndarray, noise: np.ndarray | float = 0.0) -> Ratio:
    """The ratio that the model predicts for a steep texture on noise of power 1."""
    level = 1.0 + 0.02 * FREQUENCY**-2.0
    prior = np.zeros((2, combs.PARAMETERS))
    blank = Ratio(
        np.zeros_like(level), np.ones_like(level), 1.0 / level, np.ones_like(level), FREQUENCY, NO_OFFSET,
        pair_lags(tuple(range(FRAMES))), row_window(LENGTH)[1], prior, 1.1, 1.0,
    )  # fmt: skip
    return replace(blank, value=noise - blank.model(theta)[0])


@pytest.mark.parametrize("times", [(0, 1, 2, 3, 4), (0, 1, 3, 4, 5)])
def test_the_comb_is_the_power_of_the_mean_of_copies(times: tuple[int, ...]) -> None:
    """Brute force, evenly spaced and with a frame missing."""
    phases = np.exp(-2j * np.pi * FREQUENCY * 7.3 * np.array(times)[:, None])
    np.testing.assert_allclose(comb_of(7.3, times)[:, 0], np.abs(phases.mean(axis=0)) ** 2 - 1.0 / FRAMES, atol=1e-9)


def test_copies_further_apart_than_the_window_do_not_interfere() -> None:
    window = np.zeros(10)
    window[0] = 1.0
    np.testing.assert_allclose(comb_of(20.0, window=window)[:, 0], 0.0, atol=1e-9)


def test_a_small_offset_of_the_frequencies_moves_the_comb() -> None:
    offset, out = 1e-3 * np.sin(np.arange(len(FREQUENCY))), np.empty((len(FREQUENCY), 2))
    comb_shape(7.3, pair_lags(tuple(range(FRAMES))), FREQUENCY, offset, WIDE, out)
    phases = np.exp(-2j * np.pi * (FREQUENCY + offset) * 7.3 * np.arange(FRAMES)[:, None])
    np.testing.assert_allclose(out[:, 0], np.abs(phases.mean(axis=0)) ** 2 - 1.0 / FRAMES, atol=1e-5)


def test_every_derivative_of_the_comb_is_that_of_differences() -> None:
    """That the copies' overlap shrinks with the displacement is left out of its derivative: less than a hundredth."""
    ratio, step = made_ratio(THETA), 1e-5
    gradient = ratio.model(THETA)[2]
    for k in range(combs.PARAMETERS):
        high, low = THETA.copy(), THETA.copy()
        high[k] += step
        low[k] -= step
        difference = (ratio.model(low)[0] - ratio.model(high)[0]) / (2.0 * step)
        np.testing.assert_allclose(gradient[:, k], difference, atol=0.01 if k == combs.SHIFT else 1e-6)


@pytest.mark.parametrize("displacement_px", [0.5, 1.7, 6.4, 31.0])
def test_the_look_and_the_climb_find_what_was_made(displacement_px: float) -> None:
    theta = THETA.copy()
    theta[combs.SHIFT] = displacement_px
    ratio = made_ratio(theta, 2e-3 * np.random.default_rng(4).normal(size=len(FREQUENCY)))
    starts, _ = candidates(ratio, LENGTH, 80.0)
    found = min((ratio.climb(start, 20) for start in starts), key=lambda top: float(np.sum(ratio.model(top)[0] ** 2)))
    assert found[combs.SHIFT] == pytest.approx(displacement_px, abs=0.02)


def test_the_climb_scatters_as_its_information_says() -> None:
    deviations, rng = [], np.random.default_rng(8)
    _, weight, gradient = made_ratio(THETA).model(THETA)
    sigma = 1e-2 / np.sqrt(weight)
    expected = math.sqrt(np.linalg.inv((gradient * weight[:, None]).T @ gradient)[0, 0]) * 1e-2
    for _ in range(60):
        found = made_ratio(THETA, sigma * rng.normal(size=len(sigma))).climb(THETA, 10)
        deviations.append((found[combs.SHIFT] - THETA[combs.SHIFT]) / expected)
    assert np.sqrt(np.mean(np.square(deviations))) == pytest.approx(1.0, abs=0.25)


def test_no_motion_stays_none_when_it_may_not_move() -> None:
    start = np.array([combs.STILL_PX, 1.0, 0.5, 0.0, 0.0])
    assert made_ratio(THETA).climb(start, 5, moving=False)[combs.SHIFT] == combs.STILL_PX


def spectra_with(power: np.ndarray, rows: int) -> Spectra:
    return Spectra(power, np.full(len(power), float(rows)), FREQUENCY, LENGTH)


def test_the_blurs_derivative_is_that_of_differences() -> None:
    step, out = 1e-5, np.empty((3, len(FREQUENCY), 2))
    for shape, blur in zip(out, (2.1 - step, 2.1, 2.1 + step), strict=True):
        exposure_power(FREQUENCY, blur, shape)
    np.testing.assert_allclose(out[1, :, 0], np.sinc(FREQUENCY * 2.1) ** 2, atol=1e-9)
    np.testing.assert_allclose(out[1, :, 1], (out[2] - out[0])[:, 0] / (2.0 * step), atol=1e-6)


def test_the_climb_finds_the_blur_behind_a_made_spectrum_as_sharply_as_its_information_says() -> None:
    """Chi-square spectra of a known model: the estimates scatter by the inverse of the information."""
    rows, truth = 400, np.array([6.4, 3.0, -1.2, -0.25, -3.0, 0.0])
    rng, free, every, deviations = np.random.default_rng(8), np.ones(PARAMETERS, np.bool_), FREQUENCY > 0.0, []
    exact, _ = pose(spectra_with(np.ones((1, len(FREQUENCY))), rows), every).model(truth)
    for _ in range(60):
        problem = pose(spectra_with((exact * rng.gamma(rows, 1.0 / rows, len(exact)))[None], rows), every)
        start = problem.prior[0].copy()
        start[BLUR] = 6.0
        theta, _ = problem.climb(start, free, 20)
        model, gradient = problem.model(theta)
        J = problem.information(model, gradient)
        deviations.append((theta[BLUR] - truth[BLUR]) / math.sqrt(np.linalg.inv(J)[BLUR, BLUR] / rows))
    assert np.sqrt(np.mean(np.square(deviations))) == pytest.approx(1.0, abs=0.35)


def test_cholesky_solves_what_numpy_solves() -> None:
    rng = np.random.default_rng(1)
    root, b = rng.normal(size=(6, 6)), rng.normal(size=6)
    A = root @ root.T + np.eye(6)
    np.testing.assert_allclose(solve_spd(A, b), np.linalg.solve(A, b), rtol=1e-9)
    assert not np.isfinite(solve_spd(-A, b)).all()


def test_the_prior_pulls_by_its_inverse_variance() -> None:
    prior, theta = np.zeros((2, PARAMETERS)), np.zeros(PARAMETERS)
    prior[0, NOISE], prior[1, NOISE] = 3.0, 4.0
    assert pull(theta, prior) == pytest.approx(18.0)


def test_the_window_correlates_with_itself_best() -> None:
    window, correlation = row_window(LENGTH)
    brute = np.array([np.sum(window[k:] * window[: LENGTH - k]) for k in (0, 1, 50, 400)])
    np.testing.assert_allclose(correlation[[0, 1, 50, 400]], brute / brute[0], atol=1e-5)
