"""Strapdown against closed forms and against a dense integration; its transition against numerical differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from axialnav.models.imu import strapdown
from axialnav.models.state import N_ERROR, zero_state
from tests.models.states import central_differences, minus, plus, random_state, rotation_of, with_attitude

GRAVITY = 9.81
UP = np.array([0.0, 0.0, GRAVITY])


def step(x, gyro, accel, dt):
    """One step on a copy; returns it with the blocks F (9, 3)."""
    out, F = x.copy(), np.empty((9, 3))
    strapdown(out, np.asarray(gyro, dtype=float), np.asarray(accel, dtype=float), dt, GRAVITY, np.empty((3, 3)), F)
    return out, F


def transition(F, dt):
    """Dense Phi (25, 25) that the blocks stand for; the UWB biases are not the strapdown's."""
    Phi = np.eye(N_ERROR)
    Phi[0:3, 3:6] = np.eye(3) * dt
    Phi[3:6, 6:9] = F[0:3]
    Phi[3:6, 12:15] = -F[3:6]
    Phi[6:9, 6:9] = F[6:9]
    Phi[6:9, 9:12] = -np.eye(3) * dt
    return Phi


def test_a_body_at_rest_stays_where_it_is() -> None:
    x = zero_state()
    for _ in range(1000):
        x, _ = step(x, [0, 0, 0], [0, 0, GRAVITY], 0.005)
    np.testing.assert_allclose(x, zero_state(), atol=1e-12)


def test_biases_are_taken_off_the_readings() -> None:
    x = zero_state()
    x[10:13], x[13:16] = [0.1, -0.2, 0.3], [0.5, 0.4, -0.6]
    moved = x
    for _ in range(500):
        moved, _ = step(moved, x[10:13], x[13:16] + UP, 0.01)
    np.testing.assert_allclose(moved, x, atol=1e-12)


def test_free_fall_is_exact_for_any_step() -> None:
    x = zero_state()
    x[3:6] = [1.0, 2.0, 3.0]
    x, _ = step(x, [0, 0, 0], [0, 0, 0], 2.0)
    np.testing.assert_allclose(x[:3], [2.0, 4.0, 6.0 - 0.5 * GRAVITY * 4.0])
    np.testing.assert_allclose(x[3:6], [1.0, 2.0, 3.0 - 2.0 * GRAVITY])


def test_a_coordinated_circle_closes_with_an_error_of_second_order_in_the_step() -> None:
    """Radius 2 m at 1 rad/s, nose along the motion: after one turn the vehicle is back."""
    misses = []
    for n in (500, 1000, 2000):
        x = zero_state()
        x[0], x[3:6] = 2.0, [0.0, 2.0, 0.0]
        x = with_attitude(x, Rotation.from_euler("z", np.pi / 2))
        dt = 2.0 * np.pi / n
        for _ in range(n):
            x, _ = step(x, [0, 0, 1.0], [0, 2.0, GRAVITY], dt)
        misses.append(np.linalg.norm(x[:3] - [2.0, 0.0, 0.0]))
        assert rotation_of(x).as_euler("ZYX")[0] == pytest.approx(np.pi / 2, abs=1e-9)
    assert misses[-1] < 1e-4
    assert misses[0] / misses[1] == pytest.approx(4.0, rel=0.2)
    assert misses[1] / misses[2] == pytest.approx(4.0, rel=0.2)


def wild_motion(t):
    """Rate and specific force in body axes of a vehicle that is shaken about all axes."""
    gyro = np.array([0.8 * np.sin(3 * t), 0.6 * np.cos(2 * t), 0.5 + 0.4 * np.sin(t)])
    return gyro, np.array([1.5 * np.cos(2.5 * t), -2 * np.sin(1.7 * t), GRAVITY + np.sin(4 * t)])


def test_a_wild_motion_agrees_with_a_dense_integration() -> None:
    def derivative(t, y):
        gyro, accel = wild_motion(t)
        attitude = Rotation.from_quat(y[6:10], scalar_first=True)
        scalar, vector = y[6], y[7:10]
        turning = [-vector @ gyro, *(scalar * gyro + np.cross(vector, gyro))]  # q (0, w), Hamilton
        return np.concatenate([y[3:6], attitude.apply(accel) - [0, 0, GRAVITY], 0.5 * np.array(turning)])

    x = zero_state()
    exact = solve_ivp(derivative, (0, 5), x[:10], rtol=1e-11, atol=1e-11).y[:, -1]
    dt = 0.002
    for k in range(2500):
        at_start, at_end = wild_motion(k * dt), wild_motion((k + 1) * dt)
        x, _ = step(x, (at_start[0] + at_end[0]) / 2, (at_start[1] + at_end[1]) / 2, dt)
    assert np.linalg.norm(exact[:3]) > 50.0
    assert np.linalg.norm(x[:3] - exact[:3]) < 5e-4
    assert np.linalg.norm(x[3:6] - exact[3:6]) < 1e-4
    assert (rotation_of(x).inv() * Rotation.from_quat(exact[6:10], scalar_first=True)).magnitude() < 1e-5


def test_transition_blocks_are_the_derivative_of_the_step() -> None:
    """To the order that the blocks keep: dt^2 in position, third order of the turn in attitude."""
    rng, dt = np.random.default_rng(5), 0.002
    for _ in range(50):
        x, gyro, accel = random_state(rng), rng.normal(0, 2, 3), rng.normal(0, 5, 3) + UP
        moved, F = step(x, gyro, accel, dt)

        def after(y, gyro=gyro, accel=accel, moved=moved):
            return minus(step(y, gyro, accel, dt)[0], moved)

        difference = central_differences(after, x, 1e-5) - transition(F, dt)
        size = np.linalg.norm(accel) + np.linalg.norm(gyro)
        assert np.abs(difference[:3]).max() < size * dt**2
        assert np.abs(difference[3:6, [*range(6), *range(12, N_ERROR)]]).max() < 1e-8
        assert np.abs(difference[3:6, 6:12]).max() < size**2 * dt**2
        assert np.abs(difference[6:9]).max() < size * dt**2
        assert np.abs(difference[9:]).max() < 1e-9


def test_the_first_order_error_of_the_transition_vanishes_with_the_step() -> None:
    """A wrong sign in any block would leave an error that shrinks only with dt, not with dt^2."""
    rng = np.random.default_rng(6)
    x, gyro, accel = random_state(rng), rng.normal(0, 1, 3), rng.normal(0, 3, 3) + UP
    errors = []
    for dt in (0.02, 0.01, 0.005):
        moved, F = step(x, gyro, accel, dt)
        numerical = central_differences(lambda y, m=moved, dt=dt: minus(step(y, gyro, accel, dt)[0], m), x, 1e-5)
        errors.append(np.abs(numerical - transition(F, dt)).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)


def test_plus_and_minus_of_the_oracle_are_inverse() -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        x, error = random_state(rng), rng.normal(0, 0.3, N_ERROR)
        np.testing.assert_allclose(minus(plus(x, error), x), error, atol=1e-12)
