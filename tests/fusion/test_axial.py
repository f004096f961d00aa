"""The axial estimator on simulated flights: how good, how sure, and how it treats readings."""

from __future__ import annotations

import subprocess
import sys

import msgspec
import numpy as np
import pytest

from axialnav.fusion.axial import AxialFilter
from axialnav.fusion.axial_estimator import run_axial
from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.outcome import Health, Reason, Verdict
from axialnav.models.rig import BlurMeter
from tests.fusion.made_axial import AxialFlight, axial_flight
from tests.fusion.made_flights import DOWN_BS, FOCAL_PX, Table, transform

SEEDS = range(6)


def flown(seed: int, **options) -> tuple[AxialFlight, BatchResult]:
    flight = axial_flight(seed, **options)
    return flight, run_axial(flight.config, flight.tables)


def scores(imu: bool, sensors: tuple[str, ...]) -> dict[str, float]:
    """Over all seeds: RMSE [m/s], mean squared error in units of its own variance, share inside 3 sigma."""
    errors, sigmas = [], []
    for seed in SEEDS:
        flight, result = flown(seed, imu=imu, sensors=sensors)
        errors.append(flight.error_m_s(result.track))
        sigmas.append(np.sqrt(result.track.velocity_covariance[:, 0, 0]))
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)
    normalised = error / sigma
    return {
        "rmse": float(np.sqrt((error**2).mean())),
        "nees": float((normalised**2).mean()),
        "inside": float((np.abs(normalised) < 3.0).mean()),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imu", "sensors", "limit_m_s"),
    [
        (True, ("range0", "flow0", "tdoa0"), 0.07),
        (True, ("range0", "flow0"), 0.08),
        (True, ("tdoa0",), 0.20),
        (False, ("range0", "flow0", "tdoa0"), 0.12),
        (False, ("range0", "flow0"), 0.20),
    ],
)
def test_velocity_is_good_and_no_surer_than_it_should_be(imu: bool, sensors: tuple[str, ...], limit_m_s: float) -> None:
    """It is built to be on the safe side: the one bias state has to stand for tilt, accelerometer and drag."""
    found = scores(imu, sensors)
    assert found["rmse"] < limit_m_s
    assert 0.05 < found["nees"] < 1.5
    assert found["inside"] > 0.985


@pytest.mark.slow
def test_the_full_filter_is_better_where_there_are_inertial_samples() -> None:
    axial, full = [], []
    for seed in SEEDS:
        flight, result = flown(seed)
        axial.append((flight.error_m_s(result.track) ** 2).mean())
        full.append((flight.error_m_s(run_batch(flight.made.config, flight.made.tables).track) ** 2).mean())
    assert np.sqrt(np.mean(full)) < 0.85 * np.sqrt(np.mean(axial))


def test_gates_are_those_of_the_full_filter() -> None:
    flight = axial_flight(1, duration_s=4.0)
    logs = [run(flight.config, flight.tables).log for run in (run_axial, run_batch)]
    for name in ("range0", "flow0", "tdoa0"):
        gates = [set(log.gate[(log.source == log.sensors.index(name)) & (log.dof > 0)]) for log in logs]
        assert gates[0] == gates[1] != set()


def test_outliers_are_refused_and_the_rest_is_used() -> None:
    flight, result = flown(2, outlier_share=0.1, outlier_m=6.0, sensors=("range0", "flow0", "tdoa0"))
    log = result.log
    uwb = log.source == log.sensors.index("tdoa0")
    wrong = np.abs(log.innovation[:, 0]) > 4.0
    assert (uwb & wrong).sum() > 40
    assert (log.verdict[uwb & wrong] == Verdict.GATED).all()
    assert (log.verdict[uwb & ~wrong] == Verdict.FUSED).mean() > 0.97
    assert np.sqrt((flight.error_m_s(result.track) ** 2).mean()) < 0.1


def test_what_is_across_the_axis_is_held_with_a_sigma_that_covers_it() -> None:
    flight, result = flown(3)
    track = result.track
    for field in ("position_m", "velocity_m_s", "quaternion_WB", "position_covariance", "velocity_covariance"):
        assert np.isfinite(getattr(track, field)).all(), field
    truth = flight.made.truth
    for held, true, P in (
        (track.position_m, truth.position_m, track.position_covariance),
        (track.velocity_m_s, truth.velocity_m_s, track.velocity_covariance),
    ):
        normalised = (held - true)[:, 1:] / np.sqrt(P[:, [1, 2], [1, 2]])
        assert (np.abs(normalised) < 3.0).mean() > 0.97


def test_without_uwb_the_position_across_grows_uncertain_and_range_finders_hold_it() -> None:
    _, blind = flown(4, sensors=(), duration_s=10.0)
    _, aided = flown(4, sensors=("range0",), duration_s=10.0)
    sigma = [np.sqrt(r.track.position_covariance[-1, [1, 2], [1, 2]]) for r in (blind, aided)]
    assert (sigma[0] > 0.5).all()
    assert sigma[1][1] < 0.1  # up: the floor is seen
    assert sigma[1][0] > 0.5


def test_a_sick_accelerometer_is_flagged_and_the_tilt_flies_on() -> None:
    flight = axial_flight(5)
    accel = flight.tables["imu0"].columns["accel_m_s2"]
    accel[:, 0] -= 2.5 * (flight.made.t_s > 8.0)
    result = run_axial(flight.config, flight.tables)
    flagged = (result.track.flags & int(Health.ACCELEROMETER_FAULT)) > 0
    assert not flagged[flight.made.t_s < 8.0].any()
    assert flagged[flight.made.t_s > 12.0].all()
    settled = flight.made.t_s > 14.0
    assert np.sqrt((flight.error_m_s(result.track)[settled] ** 2).mean()) < 0.25


def test_a_wrong_start_is_left_by_moving_the_position_only() -> None:
    flight = axial_flight(6, sensors=("range0", "flow0", "fix0"), duration_s=10.0)
    config = flight.config.with_params({"initial.position_m": "[8.0, 0.0, 1.5]", "supervisor.reanchor_aided_s": "4.0"})
    track = run_axial(config, flight.tables).track
    at = int(np.flatnonzero(np.diff(track.resets))[0])
    assert track.resets[-1] == 1
    assert track.position_m[at + 1, 0] - track.position_m[at, 0] < -5.0
    assert np.abs(track.velocity_m_s[at + 1] - track.velocity_m_s[at]).max() < 0.1
    assert track.velocity_covariance[at + 1, 0, 0] == pytest.approx(track.velocity_covariance[at, 0, 0], rel=0.1)
    assert np.abs(track.position_m[-200:, 0] - flight.made.truth.position_m[-200:, 0]).max() < 0.5


def blurred(seed: int, speed_known: bool) -> tuple[BatchResult, np.ndarray]:
    """Unsigned blur lengths instead of flow, looking down across the axis."""
    flight = axial_flight(seed, sensors=("range0", "flow0", "fix0") if speed_known else ("range0", "flow0"))
    flow = flight.tables["flow0"]
    length = np.abs(np.asarray(flow.columns["dy_px"], dtype=np.float64))
    columns = {"window_s": flow.columns["window_s"], "length_px": length, "sigma_px": np.full(len(length), 0.8)}
    turned = tuple((-row[1], row[0], row[2]) for row in DOWN_BS)
    spec = BlurMeter(
        T_BS=transform(turned), focal_px=(FOCAL_PX, FOCAL_PX), surface="floor", law="composite", signed=False
    )
    tables = {k: v for k, v in flight.tables.items() if k != "flow0"} | {"blur0": Table(flow.t_ns, columns)}
    specs = {k: v for k, v in flight.config.sensor.items() if k != "flow0"} | {"blur0": spec}
    result = run_axial(msgspec.structs.replace(flight.config, sensor=specs), tables)
    return result, flight.error_m_s(result.track)


def test_unsigned_blur_is_used_where_the_direction_is_known_and_blind_elsewhere() -> None:
    result, error = blurred(7, speed_known=True)
    log = result.log
    reasons = set(log.reason[log.source == log.sensors.index("blur0")].tolist())
    assert {int(Reason.NONE), int(Reason.TOO_SHORT)} <= reasons
    assert reasons <= {int(r) for r in (Reason.NONE, Reason.TOO_SHORT, Reason.SIGN_UNCERTAIN, Reason.INNOVATION)}
    assert np.sqrt((error**2).mean()) < 0.15


def test_the_same_flight_gives_the_same_bits() -> None:
    flight = axial_flight(8, duration_s=4.0)
    one, two = (run_axial(flight.config, flight.tables).track for _ in range(2))
    np.testing.assert_array_equal(one.velocity_m_s, two.velocity_m_s)


def test_without_attitude_it_is_refused_with_the_way_out() -> None:
    flight = axial_flight(9, duration_s=2.0)
    with pytest.raises(ConfigError, match=r"needs the autopilot's attitude.*\[sensor.att0\]"):
        AxialFilter(flight.config.without(("att0",)))
    tables = {**flight.tables, "att0": Table(np.zeros(0, np.int64), {})}
    with pytest.raises(FlightError, match="no usable row"):
        run_axial(flight.config, tables)
    with pytest.raises(ConfigError, match="left"):
        run_axial(flight.config.with_params({"handedness": '"left"'}), flight.tables)


def test_filterpy_is_loaded_when_a_filter_is_made_and_not_before() -> None:
    code = "import sys, axialnav; axialnav.AxialEstimator; print('filterpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "False\n"
