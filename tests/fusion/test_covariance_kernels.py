"""Block and scalar kernels against the dense textbook forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.fusion.kernels.covariance import correct, inject, predict_covariance, project
from axialnav.fusion.memory import whole_covariance
from axialnav.models.imu import strapdown
from axialnav.models.state import E_UWB_BIAS, N_ERROR, N_NOMINAL, zero_state

EYE = np.eye(N_ERROR)


def random_covariance(rng: np.random.Generator) -> np.ndarray:
    """Full, badly scaled, positive definite."""
    A = rng.normal(size=(N_ERROR, N_ERROR + 4)) * (10.0 ** rng.uniform(-3, 0.5, N_ERROR))[:, None]
    return A @ A.T


def without_the_block_below(P: np.ndarray) -> np.ndarray:
    """As the filter has it: nobody may look below the core."""
    P = P.copy()
    P[9:, :9] = np.nan
    return P


def dense_transition(F: np.ndarray, dt: float, decay: float) -> np.ndarray:
    Phi = EYE.copy()
    Phi[0:3, 3:6] = dt * np.eye(3)
    Phi[3:6, 6:9], Phi[3:6, 12:15] = F[0:3], -F[3:6]
    Phi[6:9, 6:9], Phi[6:9, 9:12] = F[6:9], -dt * np.eye(3)
    Phi[range(E_UWB_BIAS, N_ERROR), range(E_UWB_BIAS, N_ERROR)] = decay
    return Phi


def blocks(rng: np.random.Generator, dt: float) -> np.ndarray:
    """Blocks as the strapdown writes them, from a random attitude."""
    x, F = zero_state(), np.empty((9, 3))
    x[6:10] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    strapdown(x, rng.normal(0, 2, 3), rng.normal(0, 10, 3), dt, 9.81, np.empty((3, 3)), F)
    return F


def test_prediction_is_phi_p_phi_plus_q() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        P, dt, decay = random_covariance(rng), 10.0 ** rng.uniform(-4, -1), rng.uniform(0.5, 1.0)
        F, Q = blocks(rng, dt), 10.0 ** rng.uniform(-9, -3, N_ERROR)
        Phi = dense_transition(F, dt, decay)
        expected = Phi @ P @ Phi.T + np.diag(Q)
        P = without_the_block_below(P)
        predict_covariance(P, F, dt, decay, Q)
        P = whole_covariance(P)
        scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
        assert np.abs((P - expected) / scale).max() < 1e-12
        assert np.abs((P - P.T) / scale).max() < 1e-14


def test_projection_is_p_h_and_h_p_h() -> None:
    rng = np.random.default_rng(2)
    for _ in range(100):
        P, H, PHt = random_covariance(rng), rng.normal(size=N_ERROR), np.empty(N_ERROR)
        H[rng.random(N_ERROR) < 0.6] = 0.0
        half = without_the_block_below(P)
        assert project(half, H, PHt) == pytest.approx(H @ P @ H, rel=1e-12)
        np.testing.assert_allclose(PHt, P @ H, rtol=1e-11, atol=1e-13)


def test_correction_is_the_dense_joseph_form() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        P, H, R = random_covariance(rng), rng.normal(size=N_ERROR), 10.0 ** rng.uniform(-4, 1)
        K = P @ H / (H @ P @ H + R)
        expected = (EYE - np.outer(K, H)) @ P @ (EYE - np.outer(K, H)).T + R * np.outer(K, K)
        scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
        PHt, gain = np.empty(N_ERROR), np.empty(N_ERROR)
        P = without_the_block_below(P)
        S = project(P, H, PHt) + R
        correct(zero_state(), P, PHt, S, 0.0, gain)
        P = whole_covariance(P)
        np.testing.assert_allclose(gain, K, rtol=1e-11, atol=1e-14)
        assert np.abs((P - expected) / scale).max() < 1e-12


def test_the_joseph_form_holds_for_a_gain_that_is_not_optimal() -> None:
    """With the variance S of another noise the short form P - K H P would be wrong; this one stays a covariance."""
    rng = np.random.default_rng(4)
    P, H = random_covariance(rng), rng.normal(size=N_ERROR)
    before = P.copy()
    PHt, gain = np.empty(N_ERROR), np.empty(N_ERROR)
    P = without_the_block_below(P)
    project_variance = project(P, H, PHt)
    S = project_variance * 3.0
    correct(zero_state(), P, PHt, S, 0.0, gain)
    P = whole_covariance(P)
    R = S - project_variance
    K = before @ H / S
    expected = (EYE - np.outer(K, H)) @ before @ (EYE - np.outer(K, H)).T + R * np.outer(K, K)
    np.testing.assert_allclose(P, expected, rtol=1e-9, atol=1e-12 * np.abs(before).max())
    assert np.linalg.eigvalsh(0.5 * (P + P.T)).min() > 0.0


def test_injection_turns_in_body_axes_and_adds_the_rest() -> None:
    rng = np.random.default_rng(5)
    x, gain = rng.normal(size=N_NOMINAL), rng.normal(size=N_ERROR)
    attitude = Rotation.random(rng=rng)
    x[6:10] = attitude.as_quat(scalar_first=True)
    out = x.copy()
    inject(out, gain, 0.3)
    np.testing.assert_allclose(out[:6], x[:6] + 0.3 * gain[:6])
    np.testing.assert_allclose(out[10:], x[10:] + 0.3 * gain[9:])
    turned = attitude * Rotation.from_rotvec(0.3 * gain[6:9])
    assert (Rotation.from_quat(out[6:10], scalar_first=True).inv() * turned).magnitude() < 1e-14
