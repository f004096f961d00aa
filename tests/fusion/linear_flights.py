"""A linear system in the layout of the smoother's records, filtered by filterpy, with a dense answer beside it.

Attitudes and gyro biases are billionths of a radian and act on the velocity with gains of a billion, so that attitudes
add like vectors to the last digit while they still matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.linalg import cho_factor, cho_solve

from axialnav.fusion.kernels.smooth import INERTIAL, REANCHORING, STEP, WORK
from axialnav.fusion.memory import SETTINGS, TRACK_STATE, TRACK_VARIANCE, TRACK_WIDTH
from axialnav.models.state import N_ERROR
from tests.fusion.test_covariance_kernels import dense_transition

SMALL = 1e-9
UNITS = np.concatenate([np.ones(6), np.full(6, SMALL), np.ones(6)])
BIAS_TIME_S = 3.0


@dataclass
class Linear:
    """Transitions (n, 18, 18), their noise, additive inputs, and readings after each of the n + 1 instants."""

    Phi: np.ndarray
    Q: np.ndarray
    shift: np.ndarray
    H: np.ndarray
    R: np.ndarray
    z: np.ndarray
    P0: np.ndarray
    blocks: np.ndarray
    dt: np.ndarray


def make_linear(seed: int, n: int, reanchored_at: int | None = None) -> Linear:
    """Random walk through random transitions of the filter's structure."""
    rng = np.random.default_rng(seed)
    Phi, Q, blocks = np.empty((n, 18, 18)), np.zeros((n, 18, 18)), np.zeros((n, 9, 3))
    dt = rng.uniform(0.005, 0.05, n)
    shift = np.zeros((n, 18))
    for k in range(n):
        blocks[k, 0:3] = rng.normal(size=(3, 3)) * 0.3 / SMALL
        blocks[k, 3:6] = rng.normal(size=(3, 3)) * 0.3
        blocks[k, 6:9] = np.eye(3) + rng.normal(size=(3, 3)) * 0.1
        Phi[k] = dense_transition(blocks[k], dt[k], np.exp(-dt[k] / BIAS_TIME_S))
        Q[k] = np.diag(rng.uniform(0.001, 0.02, 18) * UNITS**2)
    if reanchored_at is not None:
        dt[reanchored_at], blocks[reanchored_at] = 0.0, 0.0
        Phi[reanchored_at] = np.diag([0.0] * 3 + [1.0] * 15)
        Q[reanchored_at] = np.diag([0.5] * 3 + [0.0] * 15)
        shift[reanchored_at, :3] = 4.0, -3.0, 2.0
    A = rng.normal(size=(18, 18)) * UNITS[:, None]
    H = rng.normal(size=(n + 1, 2, 18)) / UNITS
    return Linear(Phi, Q, shift, H, np.full(n + 1, 0.3), rng.normal(size=(n + 1, 2)), A @ A.T, blocks, dt)


def dense_answer(system: Linear) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n + 1, 18) and covariance (n + 1, 18, 18) of every state given all readings, in one solve."""
    n = len(system.Phi)
    size = 18 * (n + 1)
    mean, P = np.zeros(size), np.zeros((size, size))
    P[:18, :18] = system.P0
    for k in range(n):
        here, there = slice(18 * k, 18 * k + 18), slice(18 * k + 18, 18 * k + 36)
        mean[there] = system.Phi[k] @ mean[here] + system.shift[k]
        P[there, : there.start] = system.Phi[k] @ P[here, : there.start]
        P[: there.start, there] = P[there, : there.start].T
        P[there, there] = system.Phi[k] @ P[here, here] @ system.Phi[k].T + system.Q[k]
    H = np.zeros((2 * (n + 1), size))
    for k in range(n + 1):
        H[2 * k : 2 * k + 2, 18 * k : 18 * k + 18] = system.H[k]
    S = H @ P @ H.T + np.diag(np.repeat(system.R, 2))
    gain = cho_solve(cho_factor(S), H @ P).T
    mean = mean + gain @ (system.z.ravel() - H @ mean)
    P = P - gain @ (H @ P)
    return mean.reshape(-1, 18), np.array([P[i : i + 18, i : i + 18] for i in range(0, size, 18)])


def filtered(system: Linear) -> tuple[KalmanFilter, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """filterpy forward: the filter at the end; states and covariances after the readings, and before them."""
    kf = KalmanFilter(dim_x=18, dim_z=2)
    kf.x, kf.P = np.zeros((18, 1)), system.P0.copy()
    means, covariances, early_means, early_covariances = [], [], [], []
    for k in range(len(system.Phi) + 1):
        if k:
            kf.predict(F=system.Phi[k - 1], Q=system.Q[k - 1])
            kf.x = kf.x + system.shift[k - 1][:, None]
        early_means.append(kf.x[:, 0].copy())
        early_covariances.append(kf.P.copy())
        kf.update(system.z[k][:, None], R=np.eye(2) * system.R[k], H=system.H[k])
        means.append(kf.x[:, 0].copy())
        covariances.append(kf.P.copy())
    return kf, *(np.array(a) for a in (means, covariances, early_means, early_covariances))


def nominal(error: np.ndarray) -> np.ndarray:
    """Nominal state (19,) at an error state (18,) with a very small rotation."""
    return np.concatenate([error[:6], [1.0], 0.5 * error[6:9], error[9:]])


def as_records(system: Linear) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Steps, work, settings and track as :func:`axialnav.fusion.kernels.smooth.smooth_back` takes them."""
    _, x, P, x_early, P_early = filtered(system)
    n = len(system.Phi)
    steps, work, settings = np.zeros(n, STEP), np.zeros(1, WORK), np.zeros(1, SETTINGS)
    settings["uwb_bias_time_s"] = BIAS_TIME_S
    for k in range(n):
        steps[k]["kind"] = INERTIAL if system.dt[k] > 0.0 else REANCHORING
        steps[k]["track_row"], steps[k]["dt"] = k + 1, system.dt[k]
        steps[k]["F"][0] = system.blocks[k]
        steps[k]["x_before"][0], steps[k]["P_before"][0] = nominal(x[k]), P[k]
        steps[k]["x_after"][0], steps[k]["P_after"][0] = nominal(x_early[k + 1]), P_early[k + 1]
    work["x"][0], work["P"][0] = nominal(x[n]), P[n]
    return steps, work, settings, np.zeros((n + 1, TRACK_WIDTH))


def states_of(track: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error states (m, 18) and variances (m, 18) of smoothed track rows."""
    x = track[:, TRACK_STATE : TRACK_STATE + 19]
    return np.hstack([x[:, :6], 2 * x[:, 7:10], x[:, 10:]]), track[:, TRACK_VARIANCE : TRACK_VARIANCE + N_ERROR]
