"""Ten minutes in the air: the covariance stays a covariance and the quaternion a rotation."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.memory import whole_covariance
from tests.fusion.inside import memories
from tests.fusion.made_flights import Scene, fly


@pytest.mark.slow
@pytest.mark.parametrize(
    "sensors", [("range0", "flow0", "tdoa0", "attitude0"), ("uwb0",), ("fix0", "flow0")], ids=" ".join
)
def test_covariance_stays_symmetric_and_positive(sensors: tuple[str, ...]) -> None:
    flight = fly(Scene(seed=7, duration_s=600.0, sensors=sensors, outlier_share=0.05))
    for _, memory in memories(flight.config, flight.tables, parts=200):
        x, P = memory.core["x"][0, 0], whole_covariance(memory.core["P"][0, 0])
        assert np.isfinite(x).all()
        assert np.linalg.norm(x[6:10]) == pytest.approx(1.0, abs=1e-12)
        sigma = np.sqrt(np.diag(P))
        correlation = P / np.outer(sigma, sigma)
        assert np.abs(correlation - correlation.T).max() < 1e-12
        assert np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min() > -1e-9
    error = flight.truth.velocity_m_s[-1] - x[3:6]
    assert (np.abs(error) < 4.0 * sigma[3:6]).all()


def test_silence_for_a_minute_then_readings_again_stays_finite() -> None:
    """Only inertial samples for a minute at a bias of half a metre per second squared, then the fixes come back."""
    flight = fly(Scene(seed=8, duration_s=90.0, sensors=("fix0", "flow0"), accel_bias_sigma=0.5))
    start = flight.tables["imu0"].t_ns[0]
    for name in ("fix0", "flow0"):
        table = flight.tables[name]
        t = (table.t_ns - start) * 1e-9
        keep = (t < 10.0) | (t > 70.0)
        flight.tables[name] = type(table)(table.t_ns[keep], {k: v[keep] for k, v in table.columns.items()})
    for _, memory in memories(flight.config, flight.tables, parts=90):
        P = whole_covariance(memory.core["P"][0, 0])
        sigma = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(sigma, sigma)).min() > -1e-9
    miss = np.linalg.norm(memory.core["x"][0, 0, :3] - flight.truth.position_m[-1])
    assert miss < 1.0
