"""Scores of runs whose errors are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from axialnav.fusion.config import Corridor, Section
from axialnav.fusion.outcome import Health
from axialnav.replay.flight import Truth
from axialnav.replay.metrics import AXIAL_KEYS, score
from tests.replay.made_runs import (
    SIGMA_M_S,
    START_NS,
    correlated_noise,
    make_config,
    make_flight,
    make_log,
    make_run,
    make_track,
    make_truth,
)

COUNT = 5000


def scores(track, *, truth: Truth | None = None, config=None, **extra):
    config = config or make_config()
    log = make_log(track.t_ns, np.random.default_rng(9))
    return score(track, log, make_flight(track, log, config, truth or make_truth(COUNT), **extra), config)


def test_constant_errors_come_back_as_they_were_put_in() -> None:
    velocity, position = np.full((COUNT, 3), [0.1, -0.2, 0.3]), np.full((COUNT, 3), [-1.0, 2.0, 0.5])
    found = scores(make_track(velocity, position))
    axial = found["axial_velocity_m_s"]
    assert axial["rmse"] == pytest.approx(0.1, abs=1e-4)  # truth is interpolated linearly: 1e-5 m/s of curvature
    assert axial["mean_error"] == pytest.approx(0.1, abs=1e-4)
    assert axial["max_abs_error"] == pytest.approx(0.1, abs=1e-3)
    assert axial["min_abs_error"] == pytest.approx(0.1, abs=1e-3)
    assert axial["mean_sigma"] == pytest.approx(SIGMA_M_S)
    assert axial["in_3_sigma"] == 1.0
    np.testing.assert_allclose(found["velocity_rmse_m_s"], [0.1, 0.2, 0.3], atol=1e-4)
    np.testing.assert_allclose(found["position_rmse_m"], [1.0, 2.0, 0.5], atol=1e-4)
    assert found["position_rmse_3d_m"] == pytest.approx(np.sqrt(5.25), abs=1e-4)
    assert found["alignment"] == "none"


def test_share_within_3_sigma_counts_samples() -> None:
    velocity = np.zeros((COUNT, 3))
    velocity[::4, 0] = 4.0 * SIGMA_M_S
    assert scores(make_track(velocity))["axial_velocity_m_s"]["in_3_sigma"] == pytest.approx(0.75, abs=0.001)


def test_only_the_scoring_window_counts() -> None:
    velocity = np.zeros((COUNT, 3))
    velocity[:500] = velocity[4500:] = 9.0
    found = scores(make_track(velocity), evaluation=(2.0, 17.996))
    assert found["axial_velocity_m_s"]["max_abs_error"] < 1e-3
    assert found["reference"] == {"used": 4000, "available": 4000, "kind": "truth"}
    assert scores(make_track(velocity), evaluation=(None, None))["axial_velocity_m_s"]["max_abs_error"] > 8.0


def test_truth_is_not_interpolated_across_its_gaps_and_coverage_says_so() -> None:
    full = make_truth(COUNT)
    seconds = (full.t_ns - START_NS) * 1e-9
    kept = ~((seconds > 5.0) & (seconds < 7.0))
    truth = Truth(full.t_ns[kept], full.position_m[kept], full.quaternion_WB[kept], full.velocity_m_s[kept])
    velocity = np.zeros((COUNT, 3))
    velocity[1252:1748] = 5.0  # inside the gap
    found = scores(make_track(velocity), truth=truth, evaluation=(1.0, 15.0))
    assert found["axial_velocity_m_s"]["max_abs_error"] < 1e-3
    assert found["reference"]["available"] == 3501
    assert found["reference"]["used"] == 3501 - 499


def test_samples_before_alignment_are_not_scored() -> None:
    track = make_track(np.zeros((COUNT, 3)))
    track.flags[:1000] = int(Health.ALIGNING)
    found = scores(track, evaluation=(0.0, 8.0))
    assert found["reference"] == {"used": 1001, "available": 2001, "kind": "truth"}
    assert found["health"] == {"aligning": 0.2}


def test_without_truth_nothing_is_zero_and_everything_is_null() -> None:
    metrics = make_run(truth=False).metrics
    assert metrics["reference"] == {"used": 0, "available": 0, "kind": "none"}
    assert metrics["axial_velocity_m_s"] == dict.fromkeys(AXIAL_KEYS)
    for key in ("velocity_rmse_m_s", "position_rmse_m", "position_rmse_3d_m", "nees_velocity", "alignment"):
        assert metrics[key] is None


def test_truth_without_velocity_scores_position_only() -> None:
    full = make_truth(COUNT)
    truth = dataclasses.replace(full, velocity_m_s=np.full_like(full.velocity_m_s, np.nan))
    found = scores(make_track(np.zeros((COUNT, 3)), np.full((COUNT, 3), 0.5)), truth=truth)
    assert found["axial_velocity_m_s"]["rmse"] is None
    assert found["nees_velocity"] is None
    np.testing.assert_allclose(found["position_rmse_m"], 0.5, atol=1e-4)


def test_unrelated_frames_are_scored_after_a_rigid_alignment() -> None:
    turn = Rotation.from_rotvec([0.2, -0.1, 1.9])
    track = make_track(np.full((COUNT, 3), [0.1, 0.0, 0.0]))
    moved = dataclasses.replace(
        track,
        position_m=turn.apply(track.position_m) + np.array([10.0, -3.0, 1.0]),
        velocity_m_s=turn.apply(track.velocity_m_s),
    )
    found = scores(moved, config=make_config(initial=False))
    assert found["alignment"] == "rigid"
    assert found["position_rmse_3d_m"] < 1e-4
    np.testing.assert_allclose(found["velocity_rmse_m_s"], [0.1, 0.0, 0.0], atol=1e-4)
    assert scores(moved)["position_rmse_3d_m"] > 5.0


def test_each_section_is_scored_along_its_own_axis() -> None:
    corridor = Corridor(
        section=(
            Section(kind="straight", start=(-3.0, 0.0, 0.0), end=(0.0, 0.0, 0.0)),
            Section(kind="corner", start=(0.0, 0.0, 0.0), end=(0.0, 4.0, 0.0)),
        )
    )
    velocity = np.full((COUNT, 3), [0.1, 0.3, 0.0])
    found = scores(make_track(velocity), config=make_config(corridor=corridor))
    assert set(found["sections"]) == {"straight_1", "corner_2"}
    assert found["sections"]["straight_1"]["rmse"] == pytest.approx(0.1, abs=1e-4)
    assert found["sections"]["corner_2"]["rmse"] == pytest.approx(0.3, abs=1e-4)
    assert 0.1 < found["axial_velocity_m_s"]["rmse"] < 0.3


def test_nees_of_an_honest_filter_lies_in_its_band_and_of_a_boaster_does_not() -> None:
    inside = {0.7: 0, 1.0: 0, 1.4: 0}
    for seed in range(20):
        error = SIGMA_M_S * correlated_noise(COUNT, 25.0, np.random.default_rng(seed))
        for claim in inside:
            found = scores(make_track(error, sigma_m_s=claim * SIGMA_M_S))
            low, high = found["nees_velocity_band"]
            assert found["nees_velocity"] == pytest.approx(3.0 / claim**2, rel=0.5)
            inside[claim] += low < found["nees_velocity"] < high
    assert inside[1.0] >= 17
    assert inside[0.7] <= 2
    assert inside[1.4] <= 2


def test_nees_is_null_when_a_covariance_is_not_positive_definite() -> None:
    track = make_track(np.zeros((COUNT, 3)))
    track.velocity_covariance[1000] = -np.eye(3)
    assert scores(track)["nees_velocity"] is None
