"""The axial estimator behind the streaming door: the same numbers as in replay, in any order of arrival."""

from __future__ import annotations

import numpy as np
import pytest

import axialnav as an
from axialnav.fusion.axial_estimator import run_axial
from axialnav.fusion.corridor import NotStartedError, PastStateError
from axialnav.fusion.outcome import Reason, Verdict
from axialnav.fusion.readings import Attitude, ImuSample, PixelMotion, Reading, UwbTdoa, WallRange
from tests.fusion.made_axial import AxialFlight, axial_flight
from tests.fusion.made_flights import ANCHORS


def readings_of(flight: AxialFlight) -> list[Reading]:
    """Typed readings in time order."""
    names = list(ANCHORS)
    out: list[Reading] = []
    for sensor, table in flight.tables.items():
        columns = {k: np.asarray(v).tolist() for k, v in table.columns.items()}
        for row, t_ns in enumerate(table.t_ns.tolist()):
            value = {k: v[row] for k, v in columns.items()}
            match sensor:
                case "imu0":
                    both = {k: tuple(v) for k, v in value.items()}
                    out.append(ImuSample(t_ns=t_ns, sensor=sensor, **both))
                case "att0":
                    out.append(Attitude(t_ns=t_ns, sensor=sensor, **value))
                case "flow0":
                    out.append(PixelMotion(t_ns=t_ns, sensor=sensor, **value))
                case "range0":
                    out.append(WallRange(t_ns=t_ns, sensor=sensor, **value))
                case "tdoa0":
                    a, b = names[value["anchor_a"]], names[value["anchor_b"]]
                    out.append(
                        UwbTdoa(t_ns=t_ns, sensor=sensor, anchor_a=a, anchor_b=b, difference_m=value["difference_m"])
                    )
    return sorted(out, key=lambda r: r.t_ns)


@pytest.mark.parametrize("imu", [True, False])
def test_push_gives_the_bits_of_the_replay(imu: bool) -> None:
    flight = axial_flight(11, imu=imu, duration_s=4.0)
    estimator = an.AxialEstimator(flight.config)
    outcomes = [estimator.push(reading) for reading in readings_of(flight)]
    track = run_axial(flight.config, flight.tables).track
    state = estimator.state(int(track.t_ns[-1]))
    assert state.t_ns == track.t_ns[-1]
    np.testing.assert_array_equal(state.position_m, track.position_m[-1])
    np.testing.assert_array_equal(state.velocity_m_s, track.velocity_m_s[-1])
    assert [int(s) for s in state.source_states.values()] == track.source_states[-1].tolist()
    assert state.axial_velocity_m_s == pytest.approx(track.velocity_m_s[-1, 0])
    assert state.sigma_axial_velocity_m_s == pytest.approx(np.sqrt(track.velocity_covariance[-1, 0, 0]))
    assert sum(o.verdict is Verdict.FUSED for o in outcomes) > 0.5 * len(outcomes)


def test_readings_that_come_late_within_the_ring_give_the_same_bits() -> None:
    flight = axial_flight(12, duration_s=4.0)
    ordered = readings_of(flight)
    rng = np.random.default_rng(12)
    arrival = [r.t_ns + (0 if isinstance(r, ImuSample) else int(rng.uniform(0, 3e8))) for r in ordered]
    shuffled = [ordered[i] for i in np.argsort(arrival, kind="stable")]
    assert [r.t_ns for r in shuffled] != [r.t_ns for r in ordered]
    states = []
    for order in (ordered, shuffled):
        estimator = an.AxialEstimator(flight.config)
        for reading in order:
            estimator.push(reading)
        states.append(estimator.state())
        assert not estimator.late
    np.testing.assert_array_equal(states[0].covariance, states[1].covariance)
    np.testing.assert_array_equal(states[0].position_m, states[1].position_m)


def test_it_waits_for_an_attitude_then_for_the_first_window() -> None:
    flight = axial_flight(13, duration_s=3.0)
    estimator = an.AxialEstimator(flight.config)
    with pytest.raises(NotStartedError, match="attitude"):
        estimator.state()
    ordered = readings_of(flight)
    without = [estimator.push(r) for r in ordered if not isinstance(r, Attitude)]
    assert {o.reason for o in without} == {Reason.ALIGNING}
    first = next(r for r in ordered if isinstance(r, Attitude))
    assert estimator.push(first).reason is Reason.NONE
    assert estimator.state().sigma_axial_velocity_m_s > 0.0


def test_the_state_can_be_asked_for_ahead_but_not_in_the_past() -> None:
    flight = axial_flight(14, imu=False, duration_s=3.0)
    estimator = an.AxialEstimator(flight.config)
    for reading in readings_of(flight):
        estimator.push(reading)
    now = estimator.state()
    ahead = estimator.state(now.t_ns + 500_000_000)
    assert ahead.sigma_axial_velocity_m_s > now.sigma_axial_velocity_m_s
    moved = ahead.axial_position_m - now.axial_position_m
    assert moved == pytest.approx(0.25 * (ahead.axial_velocity_m_s + now.axial_velocity_m_s), abs=0.05)
    np.testing.assert_array_equal(estimator.state().position_m, now.position_m)
    with pytest.raises(PastStateError):
        estimator.state(now.t_ns - 1)
