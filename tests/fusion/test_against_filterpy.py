"""The kernels beside filterpy's filters on random problems."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter

from axialnav.fusion.config import Config, Gate, UwbTuning
from axialnav.fusion.kernels.covariance import predict_covariance
from axialnav.fusion.kernels.update import fuse
from axialnav.fusion.memory import LOG_NIS, LOG_VARIANCE, build_settings, new_memory, new_scratch, whole_covariance
from axialnav.fusion.sources import build_sources, fused_sensors
from axialnav.models.rig import Imu, Uwb
from axialnav.models.state import E_UWB_BIAS, N_ERROR, UWB_BIAS
from tests.fusion.made_flights import ANCHORS, LEVER, NEVER, transform
from tests.fusion.test_covariance_kernels import blocks, dense_transition, random_covariance
from tests.models.states import central_differences, minus, random_state, rotation_of

ANCHOR_M = np.array(list(ANCHORS.values()))
SIGMA_M = 0.2


def config(measurement: str) -> Config:
    sensors = {
        "imu0": Imu(),
        "uwb0": Uwb(measurement=measurement, anchors=dict(ANCHORS), T_BS=transform(lever=LEVER), sigma_m=SIGMA_M),
    }
    gate = Gate(probability=NEVER, soft_sigma=1e9)
    white, biases = dict.fromkeys(("sigma_m", "range_sigma_m", "fix_sigma_m"), 0.01), ("bias", "range_bias", "fix_bias")
    uwb = UwbTuning(gate=gate, **white, **{f"{name}_sigma_m": 0.1 for name in biases})
    return Config(sensor=sensors, uwb=uwb)


class Kernel:
    """One filter in the kernels' memory and one UWB source."""

    def __init__(self, measurement: str, x: np.ndarray, P: np.ndarray) -> None:
        c = config(measurement)
        self.source = build_sources(c)[fused_sensors(c).index("uwb0")]
        self.settings, self.memory, self.scratch = build_settings(c)[0], new_memory(2), new_scratch()[0]
        self.memory.core["on_trial"] = 1  # only then is the likelihood worked out
        self.memory.core["x"][0, 0], self.memory.core["P"][0, 0] = x, P
        self.memory.core["path"], self.memory.core["path_heard"] = self.source["first_path"] + np.arange(8), 0

    def fuse(self, values: list[float]) -> float:
        row = np.full(8, np.nan)
        row[: len(values)] = values
        seen = self.memory.sources[1]
        return fuse(0, 0, self.source, seen, row, self.memory.core[0], self.scratch, self.settings)

    @property
    def log(self) -> np.ndarray:
        return self.scratch["row"]

    @property
    def x(self) -> np.ndarray:
        return self.memory.core["x"][0, 0]

    @property
    def P(self) -> np.ndarray:
        return self.memory.core["P"][0, 0]


def antenna(x: np.ndarray) -> np.ndarray:
    return x[:3] + rotation_of(x).apply(LEVER)


def predicted_range(x: np.ndarray, a: int) -> float:
    return float(np.linalg.norm(antenna(x) - ANCHOR_M[a]) + x[UWB_BIAS + a])


def fix_of(x: np.ndarray) -> np.ndarray:
    """What a receiver reports, with a bias on each axis."""
    return antenna(x) + x[UWB_BIAS : UWB_BIAS + 3]


def small_covariance(rng: np.random.Generator) -> np.ndarray:
    P = random_covariance(rng)
    scale = np.sqrt(np.diag(P))
    return P / np.outer(scale, scale) * 0.02


def test_prediction_agrees_with_the_linear_filter() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        P, dt, Q = random_covariance(rng), 0.005, 10.0 ** rng.uniform(-8, -3, N_ERROR)
        F = blocks(rng, dt)
        other = KalmanFilter(dim_x=N_ERROR, dim_z=1)
        other.P, other.F, other.Q = P.copy(), dense_transition(F, dt, 0.9), np.diag(Q)
        other.predict()
        predict_covariance(P, F, dt, 0.9, Q)
        np.testing.assert_allclose(whole_covariance(P), other.P, rtol=1e-10, atol=1e-14)


def test_a_range_is_fused_as_by_the_extended_filter() -> None:
    """State, covariance, Mahalanobis distance and log-likelihood; filterpy gets a numerical Jacobian."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        x, P, a = random_state(rng), small_covariance(rng), int(rng.integers(8))
        z = predicted_range(x, a) + rng.normal(0, 0.3)
        ours = Kernel("range", x, P)
        likelihood = ours.fuse([a, z])
        other = ExtendedKalmanFilter(dim_x=N_ERROR, dim_z=1)
        other.x, other.P, other.R = np.zeros(N_ERROR), P.copy(), np.array([[SIGMA_M**2]])
        H = central_differences(lambda y, a=a: predicted_range(y, a), x)
        other.update(np.array([z]), lambda _, H=H: H, lambda _, x=x, a=a: np.array([predicted_range(x, a)]))
        np.testing.assert_allclose(minus(ours.x, x), other.x, atol=1e-8)
        np.testing.assert_allclose(whole_covariance(ours.P), other.P, rtol=1e-6, atol=1e-9)
        assert np.sqrt(ours.log[LOG_NIS]) == pytest.approx(other.mahalanobis, rel=1e-6)
        assert ours.log[LOG_VARIANCE] == pytest.approx(other.S[0, 0], rel=1e-6)
        assert likelihood == pytest.approx(other.log_likelihood + 0.5 * np.log(2 * np.pi), abs=1e-6)


def test_three_axes_one_by_one_are_as_good_as_all_at_once() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        x, P = random_state(rng), 0.01 * small_covariance(rng)
        z = fix_of(x) + rng.normal(0, 0.3, 3)
        ours = Kernel("position", x, P)
        likelihood = ours.fuse(z.tolist())
        other = ExtendedKalmanFilter(dim_x=N_ERROR, dim_z=3)
        other.x, other.P, other.R = np.zeros(N_ERROR), P.copy(), np.eye(3) * SIGMA_M**2
        H = central_differences(fix_of, x)
        other.update(z, lambda _, H=H: H, lambda _, x=x: fix_of(x))
        np.testing.assert_allclose(whole_covariance(ours.P), other.P, rtol=1e-6, atol=1e-9)
        assert np.linalg.norm(other.x) > 1e-4
        # three turns one after the other are one turn to second order
        np.testing.assert_allclose(minus(ours.x, x), other.x, atol=1e-5)
        assert np.sqrt(ours.log[LOG_NIS]) == pytest.approx(other.mahalanobis, rel=1e-6)
        assert likelihood == pytest.approx(other.log_likelihood + 1.5 * np.log(2 * np.pi), abs=1e-6)


def test_a_long_linear_run_stays_with_filterpy() -> None:
    """Two hundred predictions and fixes in a row, level and without turning: a linear problem."""
    rng = np.random.default_rng(4)
    x, P = random_state(rng, 0.0), small_covariance(rng)
    x[6:10] = [1.0, 0.0, 0.0, 0.0]
    P[6:9], P[:, 6:9] = 0.0, 0.0
    P[9:12], P[:, 9:12] = 0.0, 0.0
    ours = Kernel("position", x, P)
    other = KalmanFilter(dim_x=N_ERROR, dim_z=3)
    other.x, other.P, other.R = np.zeros(N_ERROR), P.copy(), np.eye(3) * SIGMA_M**2
    other.H = np.zeros((3, N_ERROR))
    other.H[:, :3], other.H[:, E_UWB_BIAS : E_UWB_BIAS + 3] = np.eye(3), np.eye(3)
    F, dt, Q = np.zeros((9, 3)), 0.05, np.full(N_ERROR, 1e-4)
    F[3:6], F[6:9] = np.eye(3) * dt, np.eye(3)
    Q[6:12] = 0.0
    other.F, other.Q = dense_transition(F, dt, 0.99), np.diag(Q)
    for _ in range(200):
        predict_covariance(ours.P, F, dt, 0.99, Q)
        other.predict()
        ours.x[:3] += dt * ours.x[3:6]
        ours.x[3:6] -= dt * ours.x[13:16]
        ours.x[UWB_BIAS:] *= 0.99
        start = x.copy()
        start[:3], start[3:6], start[UWB_BIAS:] = x[:3] + dt * x[3:6], x[3:6] - dt * x[13:16], 0.99 * x[UWB_BIAS:]
        x = start
        z = fix_of(x) + rng.normal(0, 0.3, 3)
        ours.fuse(z.tolist())
        other.update(z - fix_of(x))
    np.testing.assert_allclose(minus(ours.x, x), other.x, atol=1e-9)
    np.testing.assert_allclose(whole_covariance(ours.P), other.P, rtol=1e-8, atol=1e-12)
    assert rotation_of(ours.x).magnitude() == pytest.approx(0.0, abs=1e-12)
