"""The smoother on linear systems: equal to filterpy's and to one dense solve over the whole trajectory."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.kernels.smooth import factorise, smooth_back, solve
from axialnav.models.state import E_UWB_BIAS
from tests.fusion.linear_flights import UNITS, N, as_records, dense_answer, filtered, make_linear, states_of
from tests.fusion.test_covariance_kernels import random_covariance

STEPS = 25


def scaled_inverse(A: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.diag(A))
    return np.asarray(scale[:, None] * np.linalg.inv(scale[:, None] * A * scale) * scale)


def test_equals_the_smoother_of_filterpy() -> None:
    system = make_linear(1, STEPS)
    kf, x, P, _, _ = filtered(system)
    # filterpy takes the transition that leads to an instant under that instant's index
    led = [np.eye(N), *system.Phi]
    noise = [np.zeros((N, N)), *system.Q]
    expected, P_expected, _, _ = kf.rts_smoother(x[..., None], P, led, noise, inv=scaled_inverse)
    steps, work, track = as_records(system)
    smooth_back(steps, STEPS, work, track)
    mean, variance = states_of(track)
    np.testing.assert_allclose(mean[1:] / UNITS, expected[1:, :, 0] / UNITS, atol=1e-9)
    np.testing.assert_allclose(
        variance[1:] / UNITS**2, np.diagonal(P_expected, 0, 1, 2)[1:] / UNITS**2, rtol=1e-8, atol=1e-10
    )
    np.testing.assert_allclose(work["P"][0] / np.outer(UNITS, UNITS), P_expected[0] / np.outer(UNITS, UNITS), atol=1e-8)


@pytest.mark.parametrize(("at", "forgotten"), [(None, (0, 1, 2)), (11, (0, 1, 2)), (11, (18, 22))])
def test_equals_one_solve_over_the_whole_trajectory(at: int | None, forgotten: tuple[int, ...]) -> None:
    """With a re-anchoring or new UWB paths: later readings say nothing of what was forgotten, but the rest passes."""
    system = make_linear(2, STEPS, at, forgotten)
    expected, P_expected = dense_answer(system)
    steps, work, track = as_records(system)
    smooth_back(steps, STEPS, work, track)
    mean, variance = states_of(track)
    np.testing.assert_allclose(mean[1:] / UNITS, expected[1:] / UNITS, atol=1e-9)
    np.testing.assert_allclose(
        variance[1:] / UNITS**2, np.diagonal(P_expected, 0, 1, 2)[1:] / UNITS**2, rtol=1e-8, atol=1e-10
    )


def test_position_information_does_not_cross_a_reanchoring() -> None:
    """Only the positions of later readings are changed: nothing before the re-anchoring may move."""

    def smoothed(later: float) -> np.ndarray:
        system = make_linear(3, STEPS, 11)
        system.H[12:, :, 3:] = 0.0
        system.z[12:] += later
        # no time passes afterwards, so that no velocity can carry the news of a position
        system.dt[12:], system.Phi[12:, 0:3, 3:6], system.Phi[12:, 6:9, 9:12] = 1e-300, 0.0, 0.0
        system.Phi[12:, range(E_UWB_BIAS, N), range(E_UWB_BIAS, N)] = 1.0
        steps, work, track = as_records(system)
        smooth_back(steps, STEPS, work, track)
        return states_of(track)[0]

    here, there = smoothed(0.0), smoothed(50.0)
    assert np.abs(here[13:, :3] - there[13:, :3]).max() > 1.0
    np.testing.assert_allclose(here[1:11] / UNITS, there[1:11] / UNITS, atol=1e-12)


def test_the_solver_is_the_inverse_of_badly_scaled_covariances() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        P, X = random_covariance(rng), rng.normal(size=(N, N))
        Y, U, (scale, inverse, row) = X.copy(), np.zeros((N, N)), np.empty((3, N))
        factorise(P, scale, inverse, U, row)
        solve(U, scale, inverse, Y, row)
        np.testing.assert_allclose(P @ Y, X, atol=1e-8 * np.abs(X).max())


def test_a_quantity_known_exactly_is_left_alone() -> None:
    P = np.diag(np.r_[1.0, 0.0, np.ones(N - 2)])
    X, U, (scale, inverse, row) = np.eye(N), np.zeros((N, N)), np.empty((3, N))
    factorise(P, scale, inverse, U, row)
    solve(U, scale, inverse, X, row)
    np.testing.assert_array_equal(X, P)
