"""UWB that goes wrong in a corridor: what the supervisor makes of it, and that it is the supervisor that helps."""

from __future__ import annotations

import functools

import numpy as np

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.outcome import Health, Reason, Verdict
from axialnav.fusion.supervisor import SourceState, unpack_states
from tests.fusion.made_corridor import EVENT_S, Corridor, fly
from tests.fusion.made_flights import MadeFlight


@functools.cache
def flown(uwb: str, fault: str, supervised: bool = True, seed: int = 0) -> tuple[MadeFlight, BatchResult]:
    flight = fly(Corridor(seed=seed, uwb=uwb, fault=fault, duration_s=65.0))
    config = flight.config.with_params({"supervisor.enabled": str(supervised).lower()})
    return flight, run_batch(config, flight.tables)


def miss_m(flight: MadeFlight, result: BatchResult, start_s: float, end_s: float) -> float:
    error = (result.track.position_m - flight.truth.position_m)[:, 0]
    return float(np.abs(error[(flight.t_s >= start_s) & (flight.t_s < end_s)]).max())


def uwb_states(result: BatchResult) -> np.ndarray:
    return result.track.source_states[:, result.log.sensors.index("uwb0")]


def test_nothing_is_suspect_in_a_clean_flight() -> None:
    for uwb in ("fix", "range", "tdoa"):
        _, result = flown(uwb, "clean")
        assert not (result.track.flags & (Health.UWB_SUSPECT | Health.DISAGREE | Health.MOTION_SUSPECT)).any()
        assert (uwb_states(result)[400:] == SourceState.OK).all()
        assert (result.log.verdict == Verdict.SUSPECT).sum() == 0


def test_a_receiver_that_hangs_is_named_stuck_and_not_followed() -> None:
    flight, result = flown("fix", "frozen")
    assert (result.log.reason == Reason.STUCK).sum() > 30
    assert miss_m(flight, result, EVENT_S, EVENT_S + 8.0) < 1.0
    assert miss_m(*flown("fix", "frozen", supervised=False), EVENT_S, EVENT_S + 8.0) > 1.5


def test_a_reflection_that_slides_in_makes_the_source_suspect_and_drags_less() -> None:
    flight, result = flown("fix", "ramp")
    during = (flight.t_s > EVENT_S + 3.0) & (flight.t_s < EVENT_S + 10.0)
    doubted = (uwb_states(result) == SourceState.SUSPECT) | (uwb_states(result) == SourceState.REACQUIRE)
    assert doubted[during].all()
    assert (result.log.verdict == Verdict.SUSPECT).sum() > 300
    assert miss_m(*flown("fix", "ramp", supervised=False), 40.0, 50.0) > 2.0 * miss_m(flight, result, 40.0, 50.0)


def test_differences_alone_bring_a_filter_back_that_starts_eight_metres_wrong() -> None:
    flight, result = flown("tdoa", "start")
    assert result.track.resets[-1] == 1
    assert miss_m(flight, result, 30.0, 65.0) < 0.6
    assert miss_m(*flown("tdoa", "start", supervised=False), 16.0, 25.0) > 2.0


def test_states_are_packed_by_three_bits() -> None:
    packed = np.array([2 | 3 << 3 | 5 << 6, 0])
    np.testing.assert_array_equal(unpack_states(packed, 3), [[2, 3, 5], [0, 0, 0]])
    assert unpack_states(packed, 20).shape == (2, 20)
