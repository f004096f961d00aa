"""A linear system in the layout of the smoother's records, filtered by filterpy, with a dense answer beside it.

Attitudes and gyro biases are billionths of a radian and act on the velocity with gains of a billion, so that attitudes
add like vectors to the last digit while they still matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from scipy.linalg import cho_factor, cho_solve

from axialnav.fusion.kernels.smooth import INERTIAL, NEW_PATHS, REANCHORING, STEP, WORK
from axialnav.fusion.memory import TRACK_STATE, TRACK_VARIANCE, TRACK_WIDTH
from axialnav.models.state import E_UWB_BIAS, N_ERROR
from tests.fusion.test_covariance_kernels import dense_transition

SMALL = 1e-9
N = N_ERROR
UNITS = np.concatenate([np.ones(6), np.full(6, SMALL), np.ones(N - 12)])
BIAS_TIME_S = 3.0


@dataclass
class Linear:
    """Transitions (n, 25, 25), their noise, additive inputs, and readings after each of the n + 1 instants."""

    Phi: np.ndarray
    Q: np.ndarray
    shift: np.ndarray
    H: np.ndarray
    R: np.ndarray
    z: np.ndarray
    P0: np.ndarray
    blocks: np.ndarray
    dt: np.ndarray
    forgotten: tuple[int, ...]


def make_linear(seed: int, n: int, forgotten_at: int | None = None, forgotten: tuple[int, ...] = (0, 1, 2)) -> Linear:
    """Random walk through random transitions of the filter's structure, one of which may forget some states."""
    rng = np.random.default_rng(seed)
    Phi, Q, blocks = np.empty((n, N, N)), np.zeros((n, N, N)), np.zeros((n, 9, 3))
    dt = rng.uniform(0.005, 0.05, n)
    shift = np.zeros((n, N))
    for k in range(n):
        blocks[k, 0:3] = rng.normal(size=(3, 3)) * 0.3 / SMALL
        blocks[k, 3:6] = rng.normal(size=(3, 3)) * 0.3
        blocks[k, 6:9] = np.eye(3) + rng.normal(size=(3, 3)) * 0.1
        Phi[k] = dense_transition(blocks[k], dt[k], np.exp(-dt[k] / BIAS_TIME_S))
        Q[k] = np.diag(rng.uniform(0.001, 0.02, N) * UNITS**2)
    if forgotten_at is not None:
        lost = np.isin(np.arange(N), forgotten)
        dt[forgotten_at], blocks[forgotten_at] = 0.0, 0.0
        Phi[forgotten_at], Q[forgotten_at] = np.diag(1.0 - lost), np.diag(0.5 * lost)
        shift[forgotten_at] = np.where(lost, rng.normal(0, 4, N), 0.0)
    A = rng.normal(size=(N, N)) * UNITS[:, None]
    H = rng.normal(size=(n + 1, 2, N)) / UNITS
    return Linear(Phi, Q, shift, H, np.full(n + 1, 0.3), rng.normal(size=(n + 1, 2)), A @ A.T, blocks, dt, forgotten)


def dense_answer(system: Linear) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n + 1, 25) and covariance (n + 1, 25, 25) of every state given all readings, in one solve."""
    n = len(system.Phi)
    size = N * (n + 1)
    mean, P = np.zeros(size), np.zeros((size, size))
    P[:N, :N] = system.P0
    for k in range(n):
        here, there = slice(N * k, N * k + N), slice(N * k + N, N * k + 2 * N)
        mean[there] = system.Phi[k] @ mean[here] + system.shift[k]
        P[there, : there.start] = system.Phi[k] @ P[here, : there.start]
        P[: there.start, there] = P[there, : there.start].T
        P[there, there] = system.Phi[k] @ P[here, here] @ system.Phi[k].T + system.Q[k]
    H = np.zeros((2 * (n + 1), size))
    for k in range(n + 1):
        H[2 * k : 2 * k + 2, N * k : N * k + N] = system.H[k]
    S = H @ P @ H.T + np.diag(np.repeat(system.R, 2))
    gain = cho_solve(cho_factor(S), H @ P).T
    mean = mean + gain @ (system.z.ravel() - H @ mean)
    P = P - gain @ (H @ P)
    return mean.reshape(-1, N), np.array([P[i : i + N, i : i + N] for i in range(0, size, N)])


def filtered(system: Linear) -> tuple[KalmanFilter, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """filterpy forward: the filter at the end; states and covariances after the readings, and before them."""
    kf = KalmanFilter(dim_x=N, dim_z=2)
    kf.x, kf.P = np.zeros((N, 1)), system.P0.copy()
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
    """Nominal state (26,) at an error state (25,) with a very small rotation."""
    return np.concatenate([error[:6], [1.0], 0.5 * error[6:9], error[9:]])


def as_records(system: Linear) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Steps, work and track as :func:`axialnav.fusion.kernels.smooth.smooth_back` takes them."""
    _, x, P, x_early, P_early = filtered(system)
    n = len(system.Phi)
    steps, work = np.zeros(n, STEP), np.zeros(1, WORK)
    kind = REANCHORING if system.forgotten[0] == 0 else NEW_PATHS
    for k in range(n):
        steps[k]["kind"] = INERTIAL if system.dt[k] > 0.0 else kind
        steps[k]["track_row"], steps[k]["dt"] = k + 1, system.dt[k]
        steps[k]["F"][0], steps[k]["decay"][0] = system.blocks[k], np.exp(-system.dt[k] / BIAS_TIME_S)
        steps[k]["new"] = np.isin(np.arange(E_UWB_BIAS, N), system.forgotten) if steps[k]["kind"] == NEW_PATHS else 0
        steps[k]["x_before"][0], steps[k]["P_before"][0] = nominal(x[k]), P[k]
        steps[k]["x_after"][0], steps[k]["P_after"][0] = nominal(x_early[k + 1]), P_early[k + 1]
    work["x"][0], work["P"][0] = nominal(x[n]), P[n]
    return steps, work, np.zeros((n + 1, TRACK_WIDTH))


def states_of(track: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Error states (m, 25) and variances (m, 25) of smoothed track rows."""
    x = track[:, TRACK_STATE : TRACK_STATE + N + 1]
    return np.hstack([x[:, :6], 2 * x[:, 7:10], x[:, 10:]]), track[:, TRACK_VARIANCE : TRACK_VARIANCE + N]
