"""UWB that goes wrong, in front of the axial estimator: supervised as the full filter is, and with as much help."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from axialnav.fusion.axial import axial_settings
from axialnav.fusion.axial_estimator import run_axial
from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.kernels.shadow import displacement_variance
from axialnav.fusion.memory import new_memory
from axialnav.fusion.outcome import Health, Reason, Verdict
from axialnav.fusion.supervisor import SourceState
from tests.fusion.made_axial import AxialFlight, axial_corridor
from tests.fusion.made_corridor import EVENT_S, WINDOWS_S, Corridor

DOUBTED = (SourceState.SUSPECT, SourceState.REACQUIRE)
pytestmark = pytest.mark.slow


@functools.cache
def flown(uwb: str, imu: bool, supervised: bool = True) -> tuple[AxialFlight, BatchResult]:
    """A corridor with image motion; UWB is 1.5 m off for fifteen seconds."""
    flight = axial_corridor(Corridor(seed=0, uwb=uwb, fault="step", duration_s=62.0), imu=imu)
    config = flight.config.with_params({"supervisor.enabled": str(supervised).lower()})
    return flight, run_axial(config, flight.tables)


def seconds(flight: AxialFlight, result: BatchResult) -> np.ndarray:
    return np.asarray((result.track.t_ns - flight.made.tables["imu0"].t_ns[0]) * 1e-9)


def in_event(flight: AxialFlight, result: BatchResult) -> tuple[float, float]:
    """RMSE of axial velocity [m/s] and position [m] in the window of the event."""
    t_s, (start, end) = seconds(flight, result), WINDOWS_S["step"]
    window = (t_s >= start) & (t_s < end)
    errors = flight.error_m_s(result.track), flight.error_m(result.track)
    velocity, position = (float(np.sqrt((error[window] ** 2).mean())) for error in errors)
    return velocity, position


@pytest.mark.parametrize(("uwb", "imu", "limit_m_s"), [("fix", True, 0.10), ("tdoa", False, 0.13)])
def test_a_step_of_uwb_does_not_carry_the_position_away(uwb: str, imu: bool, limit_m_s: float) -> None:
    velocity, position = in_event(*flown(uwb, imu))
    unsupervised, carried = in_event(*flown(uwb, imu, supervised=False))
    assert velocity < min(limit_m_s, 1.2 * unsupervised)  # pixel motion and the weights hold it either way
    assert carried > 0.5
    assert position < 0.6 * carried


@pytest.mark.parametrize(("uwb", "imu"), [("fix", True), ("tdoa", False)])
def test_the_source_is_named_suspect_in_the_event_and_believed_before_and_after(uwb: str, imu: bool) -> None:
    flight, result = flown(uwb, imu)
    states = result.track.source_states[:, result.log.sensors.index("uwb0")]
    t_s = seconds(flight, result)
    assert np.isin(states[(t_s > EVENT_S + 2.0) & (t_s < EVENT_S + 15.0)], DOUBTED).all()
    assert (states[(t_s > 2.0) & (t_s < EVENT_S)] == SourceState.OK).all()
    assert states[-1] == SourceState.OK
    flagged = (result.track.flags & int(Health.UWB_SUSPECT)) > 0
    np.testing.assert_array_equal(flagged, np.isin(states, DOUBTED))


def test_the_full_filter_says_the_same_of_the_same_readings() -> None:
    flight, result = flown("fix", True)
    full = run_batch(flight.made.config, flight.made.tables)
    states = [r.track.source_states[:, r.log.sensors.index("uwb0")] for r in (result, full)]
    verdicts = [r.log.verdict[r.log.source == r.log.sensors.index("uwb0")] for r in (result, full)]
    assert (np.isin(states[0], DOUBTED) == np.isin(states[1], DOUBTED)).mean() > 0.97
    assert (verdicts[0] == verdicts[1]).mean() > 0.95
    held = result.log.verdict == Verdict.SUSPECT
    assert set(result.log.reason[held].tolist()) == {int(Reason.SUPERVISOR)}


def test_without_the_supervisor_nothing_is_held_or_moved() -> None:
    _, result = flown("fix", True, supervised=False)
    assert not np.isin(result.log.verdict, (Verdict.SUSPECT,)).any()
    assert not (result.track.flags & int(Health.UWB_SUSPECT)).any()
    assert result.track.resets[-1] == 0


def test_a_shadow_carried_by_tilt_may_be_wrong_for_as_long_as_drag_lasts() -> None:
    """Half a metre in three seconds at 0.2 m/s, where independent errors would leave a quarter."""
    configs = (axial_corridor(Corridor(duration_s=3.0, uwb="fix"), imu=imu).config for imu in (True, False))
    core, along = new_memory(1).core[0], np.array([1.0, 0.0, 0.0])
    core["shadow_V"], core["shadow_q"] = 0.2**2 * np.eye(3), 0.5**2
    felt, seen = (axial_settings(config)[0] for config in configs)
    assert np.sqrt(displacement_variance(3.0, along, core, felt)) < 0.25
    assert np.sqrt(displacement_variance(3.0, along, core, seen)) > 0.45
