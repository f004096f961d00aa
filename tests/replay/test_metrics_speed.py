"""Horizontal speed against GPS: heading does not matter, latency is named but not corrected."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.replay.flight import GpsReference
from axialnav.replay.metrics import score
from axialnav.replay.speed_metrics import speed_metrics
from tests.replay.made_runs import START_NS, make_config, make_flight, make_log, make_track, stamps, true_motion

COUNT = 5000


def gps(late_s: float = 0.0, heading_rad: float = 0.0) -> GpsReference:
    t_ns = START_NS + np.arange(0, 20 * 10**9, 200_000_000)
    _, velocity = true_motion(t_ns - int(late_s * 1e9))
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    turned = velocity @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return GpsReference(t_ns, np.zeros_like(turned), turned)


@pytest.mark.parametrize("heading_rad", [0.0, 2.0])
def test_a_perfect_track_scores_zero_whatever_its_heading(heading_rad: float) -> None:
    found = speed_metrics(make_track(np.zeros((COUNT, 3))), gps(heading_rad=heading_rad), (1.0, 15.0))
    assert found["horizontal_speed_rmse_m_s"] < 1e-3
    assert found["used"] == found["available"] == 71


def test_late_gps_is_recognised_and_still_scored_as_stamped() -> None:
    found = speed_metrics(make_track(np.zeros((COUNT, 3))), gps(late_s=0.13), (1.0, 15.0))
    assert found["gps_latency_s"] == pytest.approx(0.13, abs=0.011)
    assert found["horizontal_speed_rmse_m_s"] > 0.03


def test_a_speed_that_is_too_large_has_a_positive_bias() -> None:
    found = speed_metrics(make_track(0.1 * true_motion(stamps(COUNT))[1]), gps(), (1.0, 15.0))
    speed = np.hypot(gps().velocity_m_s[5:76, 0], gps().velocity_m_s[5:76, 1])
    assert found["horizontal_speed_mean_error_m_s"] == pytest.approx(0.1 * speed.mean(), rel=1e-3)


def test_a_latency_beyond_the_search_is_not_made_up() -> None:
    track = make_track(np.zeros((COUNT, 3)))
    assert speed_metrics(track, gps(late_s=0.9), (1.0, 15.0))["gps_latency_s"] is None


def test_gps_outside_the_track_is_not_used() -> None:
    track = make_track(np.zeros((2000, 3)))
    found = speed_metrics(track, gps(), (None, None))
    assert found["available"] == 100
    assert found["used"] == 40


def test_a_flight_with_gps_only_has_no_axial_score() -> None:
    track, config = make_track(np.full((COUNT, 3), 0.1)), make_config()
    log = make_log(track.t_ns, np.random.default_rng(1))
    metrics = score(track, log, make_flight(track, log, config, None, gps=gps()), config)
    assert metrics["reference"] == {"used": 71, "available": 71, "kind": "gps"}
    assert metrics["horizontal_speed_rmse_m_s"] > 0.03
    assert metrics["axial_velocity_m_s"]["rmse"] is None
