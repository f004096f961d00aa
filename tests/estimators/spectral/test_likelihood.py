"""The model of a composite's spectrum, its derivatives, and the climb to its maximum."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.estimators.spectral.picture import FIRST_BIN, Spectra, row_window
from axialnav.estimators.spectral.problem import group_edges, pose
from axialnav.estimators.spectral.shapes import comb, pair_lags
from axialnav.estimators.spectral.whittle import BLUR, NOISE, PARAMETERS, SHIFT, UNTIED, pull, solve_spd

LENGTH, FRAMES = 640, 5
FREQUENCY = np.arange(FIRST_BIN, 288) / LENGTH
WIDE = np.ones(4096)  # autocorrelation of a window without end


def shape_of(displacement_px: float, blur_px: float, window: np.ndarray = WIDE) -> np.ndarray:
    out = np.empty((len(FREQUENCY), 3))
    comb(displacement_px, blur_px, pair_lags(tuple(range(FRAMES))), FREQUENCY, window, 0.0, out)
    return out


def spectra_with(power: np.ndarray, rows: int) -> Spectra:
    return Spectra(power, np.full(len(power), float(rows)), FREQUENCY, LENGTH)


def test_the_comb_is_the_transfer_of_the_mean_of_the_frames() -> None:
    """Oracle: the mean of N shifted and box-blurred impulses, transformed."""
    d, blur = 7.3, 2.2
    shift = np.exp(-2j * np.pi * FREQUENCY[None] * d * np.arange(FRAMES)[:, None]).mean(axis=0)
    inside = np.linspace(-0.5, 0.5, 4001) * blur
    box = np.exp(-2j * np.pi * FREQUENCY[None] * inside[:, None]).mean(axis=0)
    np.testing.assert_allclose(shape_of(d, blur)[:, 0], np.abs(shift * box) ** 2, atol=5e-4)


def test_copies_further_apart_than_the_window_do_not_interfere() -> None:
    window = np.zeros(10)
    window[0] = 1.0
    np.testing.assert_allclose(shape_of(20.0, 0.0, window)[:, 0], 1.0 / FRAMES, rtol=1e-6)


def test_lags_of_uneven_frames_give_the_comb_of_their_sum() -> None:
    """Brute force: the power of the mean of copies at 0, 1, 3 and 4 times the displacement."""
    times, displacement_px, out = (0, 1, 3, 4), 7.3, np.empty((len(FREQUENCY), 3))
    comb(displacement_px, 0.0, pair_lags(times), FREQUENCY, np.ones(200), 0.0, out)
    copies = np.exp(2j * np.pi * FREQUENCY[:, None] * displacement_px * np.array(times))
    np.testing.assert_allclose(out[:, 0], np.abs(copies.mean(axis=1)) ** 2, atol=1e-6)


def test_the_combs_derivatives_are_those_of_differences() -> None:
    step, out = 1e-5, shape_of(6.4, 2.1)
    to_shift = (shape_of(6.4 + step, 2.1) - shape_of(6.4 - step, 2.1))[:, 0] / (2.0 * step)
    to_blur = (shape_of(6.4, 2.1 + step) - shape_of(6.4, 2.1 - step))[:, 0] / (2.0 * step)
    np.testing.assert_allclose(out[:, 1], to_shift, atol=1e-6)
    np.testing.assert_allclose(out[:, 2], to_blur, atol=1e-6)


def test_every_derivative_of_the_model_is_that_of_differences() -> None:
    """That the copies' overlap shrinks with the displacement is left out of its derivative: less than a hundredth."""
    problem = pose(spectra_with(np.ones((3, len(FREQUENCY))), 30), np.ones(len(FREQUENCY), np.bool_), FRAMES)
    theta, step = np.array([6.4, 2.1, 3.0, -1.3, -0.2, -2.0, 0.4]), 1e-5
    _, gradient = problem.model(theta, UNTIED)
    for k in range(PARAMETERS):
        high, low = theta.copy(), theta.copy()
        high[k] += step
        low[k] -= step
        difference = np.log(problem.model(high, UNTIED)[0] / problem.model(low, UNTIED)[0]) / (2.0 * step)
        np.testing.assert_allclose(gradient[:, k], difference, atol=0.01 if k == SHIFT else 1e-6)


def test_a_tied_blur_moves_with_the_displacement() -> None:
    problem = pose(spectra_with(np.ones((3, len(FREQUENCY))), 30), np.ones(len(FREQUENCY), np.bool_), FRAMES)
    theta, step, tie = np.array([6.4, 0.3 * 6.4, 3.0, -1.3, -0.2, -2.0, 0.4]), 1e-5, 0.3
    _, gradient = problem.model(theta, tie)
    models = []
    for sign in (1.0, -1.0):
        moved = theta.copy()
        moved[SHIFT] += sign * step
        moved[BLUR] = tie * moved[SHIFT]
        models.append(problem.model(moved, tie)[0])
    np.testing.assert_allclose(gradient[:, SHIFT], np.log(models[0] / models[1]) / (2.0 * step), atol=0.01)


def test_the_climb_finds_the_motion_behind_a_made_spectrum_as_sharply_as_its_information_says() -> None:
    """Chi-square spectra of a known model: the estimates scatter by the inverse of the information."""
    rows, truth = 400, np.array([6.4, 0.3 * 6.4, 3.0, -1.2, -0.25, -3.0, 0.0])
    rng, free = np.random.default_rng(8), np.ones(PARAMETERS, np.bool_)
    free[BLUR] = False
    every, deviations = np.ones(len(FREQUENCY), np.bool_), []
    exact, _ = pose(spectra_with(np.ones((1, len(FREQUENCY))), rows), every, FRAMES).model(truth, 0.3)
    for _ in range(60):
        problem = pose(spectra_with((exact * rng.gamma(rows, 1.0 / rows, len(exact)))[None], rows), every, FRAMES)
        start = problem.prior[0].copy()
        start[SHIFT] = 6.3
        theta, _ = problem.climb(start, 0.3, free, 20, fresh=True)
        model, gradient = problem.model(theta, 0.3)
        J = problem.information(model, gradient)[np.ix_(free, free)]
        deviations.append((theta[SHIFT] - truth[SHIFT]) / math.sqrt(np.linalg.inv(J)[0, 0] / rows))
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


def test_groups_cover_every_bin_once() -> None:
    edges = group_edges(284, 9.0)
    assert edges[0] == 0
    assert edges[-1] == 284
    assert (np.diff(edges) >= 1).all()
    assert np.diff(edges).max() == 9


def test_the_window_correlates_with_itself_best() -> None:
    window, correlation = row_window(LENGTH)
    brute = np.array([np.sum(window[k:] * window[: LENGTH - k]) for k in (0, 1, 50, 400)])
    np.testing.assert_allclose(correlation[[0, 1, 50, 400]], brute / brute[0], atol=1e-5)
