"""Readings pushed one by one, in any order: the same bits as the replay of the whole recording."""

from __future__ import annotations

import functools

import msgspec
import numpy as np
import pytest

from axialnav.fusion.batch import run_batch
from axialnav.fusion.config import Config
from axialnav.fusion.corridor import CorridorEstimator, NotStartedError
from axialnav.fusion.errors import ReadingError
from axialnav.fusion.memory import whole_covariance
from axialnav.fusion.outcome import AxialState, Health, Reason, Verdict
from axialnav.fusion.readings import Height, ImuSample, Reading, UwbFix, UwbRange, WallRange
from axialnav.fusion.ring import CAPACITY
from tests.fusion.inside import memories
from tests.fusion.made_flights import START_NS, MadeFlight, Scene, fly
from tests.fusion.made_readings import counts, readings

RIG = ("range0", "flow0", "tdoa0", "baro0", "attitude0")


@functools.cache
def flight(duration_s: float = 3.0) -> MadeFlight:
    return fly(Scene(seed=9, duration_s=duration_s, sensors=RIG, outlier_share=0.05))


def pushed(config: Config, stream: list[Reading]) -> CorridorEstimator:
    estimator = CorridorEstimator(config)
    for reading in stream:
        estimator.push(reading)
    return estimator


def bits(state: AxialState) -> tuple[bytes, ...]:
    numbers = (state.position_m, state.velocity_m_s, state.quaternion_WB, state.gyro_bias_rad_s, state.accel_bias_m_s2)
    rest = np.array([state.blur_scale, *state.uwb_bias_m, state.wall_offset_m, state.resets])
    return tuple(a.tobytes() for a in (*numbers, rest, state.covariance))


def late_order(stream: list[Reading], delay_s: float, seed: int) -> list[Reading]:
    """Order of arrival when every reading is held up by up to ``delay_s``."""
    delays = np.random.default_rng(seed).uniform(0.0, delay_s * 1e9, len(stream))
    return [stream[i] for i in np.argsort([r.t_ns + d for r, d in zip(stream, delays, strict=True)], kind="stable")]


def test_pushed_in_order_the_state_is_the_replays_to_the_last_bit() -> None:
    made = flight()
    state = pushed(made.config, readings(made)).state()
    ((_, memory),) = memories(made.config, made.tables)
    x, P = memory.core["x"][0, 0], whole_covariance(memory.core["P"][0, 0])
    assert state.position_m.tobytes() == x[:3].tobytes()
    assert state.velocity_m_s.tobytes() == x[3:6].tobytes()
    assert state.quaternion_WB.tobytes() == x[6:10].tobytes()
    assert state.covariance.tobytes() == P.tobytes()
    track = run_batch(made.config, made.tables).track
    assert state.t_ns == track.t_ns[-1]
    np.testing.assert_array_equal(state.accel_bias_m_s2, track.accel_bias_m_s2[-1])


def test_every_outcome_is_the_row_of_the_replays_log() -> None:
    made = flight()
    estimator = CorridorEstimator(made.config)
    outcomes = [(r, estimator.push(r)) for r in readings(made)]
    log = run_batch(made.config, made.tables).log
    rows = {(log.sensors[s], t): i for i, (s, t) in enumerate(zip(log.source, log.t_ns.tolist(), strict=True))}
    compared = 0
    for reading, outcome in outcomes:
        if isinstance(reading, ImuSample) or outcome.reason is Reason.ALIGNING:
            continue
        i = rows[reading.sensor, reading.t_ns]
        assert outcome.verdict == log.verdict[i]
        assert outcome.reason == log.reason[i]
        assert outcome.nis == log.nis[i]
        assert outcome.weight == log.weight[i]
        assert outcome.innovation == tuple(log.innovation[i, : log.dof[i]])
        compared += 1
    assert compared > 250
    assert {"FUSED", "GATED", "BLIND"} <= set(counts([o for _, o in outcomes]))


@pytest.mark.parametrize("delay_s", [0.05, pytest.param(0.95, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", [1, 2])
def test_readings_that_come_late_within_the_ring_change_no_bit(delay_s: float, seed: int) -> None:
    made = flight()
    stream = readings(made)
    estimator = pushed(made.config, late_order(stream, delay_s, seed))
    assert not estimator.late
    assert bits(estimator.state()) == bits(pushed(made.config, stream).state())


def test_one_late_sensor_changes_no_bit() -> None:
    """A camera behind a slow processor: every flow reading comes 0.4 s late, the rest at once."""
    made = flight()
    stream = readings(made)
    order = sorted(stream, key=lambda r: r.t_ns + (400_000_000 if r.sensor == "flow0" else 0))
    assert order != stream
    assert bits(pushed(made.config, order).state()) == bits(pushed(made.config, stream).state())


def test_equal_stamps_are_fused_in_a_fixed_order() -> None:
    """All sensors on one clock of 50 ms: many equal stamps, any order of arrival."""
    made = flight()
    stream = [
        msgspec.structs.replace(r, t_ns=START_NS + (r.t_ns - START_NS) // 50_000_000 * 50_000_000)
        for r in readings(made)
        if not isinstance(r, ImuSample)
    ]
    inertial = [r for r in readings(made) if isinstance(r, ImuSample)]
    reference = sorted([*stream, *inertial], key=lambda r: r.t_ns)
    expected = bits(pushed(made.config, reference).state())
    rng = np.random.default_rng(4)
    for _ in range(2):
        keys = [(r.t_ns, k) for r, k in zip(reference, rng.random(len(reference)), strict=True)]
        shuffled = [reference[i] for i in sorted(range(len(reference)), key=keys.__getitem__)]
        assert shuffled != reference
        assert bits(pushed(made.config, shuffled).state()) == expected


def test_a_reading_older_than_the_ring_is_counted_named_and_changes_nothing() -> None:
    made = flight()
    stream = readings(made)
    estimator = pushed(made.config, stream)
    before = bits(estimator.state())
    old = UwbFix(t_ns=START_NS + 1_500_000_000, sensor="fix0", position_m=(0.0, 0.0, 0.0))
    with pytest.raises(ReadingError):
        estimator.push(old)
    outcome = estimator.push(WallRange(t_ns=START_NS + 1_500_000_000, sensor="range0", range_m=1.0))
    assert (outcome.verdict, outcome.reason) == (Verdict.LATE, Reason.TOO_OLD)
    assert estimator.late == {"range0": 1}
    assert bits(estimator.state()) == before


def test_the_ring_reaches_as_far_as_it_is_told() -> None:
    made = flight()
    config = made.config.with_params({"delay.buffer_s": "0.2"})
    estimator = pushed(config, readings(made))
    end = made.tables["imu0"].t_ns[-1]
    for age_ns, late in ((190_000_000, False), (900_000_000, True)):
        outcome = estimator.push(Height(t_ns=int(end) - age_ns, sensor="baro0", height_m=121.5))
        assert (outcome.verdict is Verdict.LATE) == late


def test_a_ring_that_must_grow_loses_nothing() -> None:
    """A reach of 6 s holds more events than the ring starts with, and snapshots must survive the growth."""
    made = flight(8.0)
    config = made.config.with_params({"delay.buffer_s": "6"})
    stream = readings(made)
    assert len(stream) > 2 * CAPACITY
    expected = bits(pushed(config, stream).state())
    assert bits(pushed(config, late_order(stream, 3.0, seed=3)).state()) == expected


def test_before_the_first_window_is_full_there_is_no_state() -> None:
    made = flight()
    estimator = CorridorEstimator(made.config)
    with pytest.raises(NotStartedError, match="no state yet"):
        estimator.state()
    first = [r for r in readings(made) if r.t_ns < START_NS + 900_000_000]
    assert {estimator.push(r).reason for r in first} == {Reason.ALIGNING}
    with pytest.raises(NotStartedError, match="after 1 s of inertial samples"):
        estimator.state()


def test_the_state_can_be_asked_for_a_little_ahead() -> None:
    made = flight()
    estimator = pushed(made.config, readings(made))
    now = estimator.state()
    ahead = estimator.state(now.t_ns + 20_000_000)
    assert ahead.t_ns == now.t_ns + 20_000_000
    np.testing.assert_allclose(ahead.position_m, now.position_m + 0.02 * now.velocity_m_s, atol=2e-3)
    assert np.trace(ahead.covariance) > np.trace(now.covariance)
    assert bits(estimator.state()) == bits(now)  # looking ahead leaves no trace


def test_what_was_handed_out_does_not_change_later() -> None:
    made = flight()
    stream = readings(made)
    estimator = pushed(made.config, stream[:-200])
    state = estimator.state()
    before = bits(state)
    for reading in stream[-200:]:
        estimator.push(reading)
    assert bits(state) == before
    assert bits(estimator.state()) != before


def test_a_sensor_that_is_switched_off_is_refused_by_name_of_the_reason() -> None:
    made = flight()
    stream = readings(made)
    estimator = CorridorEstimator(made.config.without(("tdoa0",)))
    reasons = {estimator.push(r).reason for r in stream if r.sensor == "tdoa0"}
    assert reasons == {Reason.DISABLED}


def test_a_reading_of_an_unknown_sensor_or_of_the_wrong_kind_is_an_error() -> None:
    estimator = CorridorEstimator(flight().config)
    with pytest.raises(
        ReadingError, match=r"no sensor named 'uwb7' is configured; there are imu0, range0.*\[sensor.uwb7\]"
    ):
        estimator.push(UwbRange(t_ns=0, sensor="uwb7", anchor="a0", range_m=1.0))
    with pytest.raises(ReadingError, match="WallRange from tdoa0, which is configured as a source of UwbTdoa"):
        estimator.push(WallRange(t_ns=0, sensor="tdoa0", range_m=1.0))


def test_an_unknown_anchor_is_named_and_not_fused() -> None:
    made = fly(Scene(seed=1, duration_s=2.0, sensors=("uwb0",)))
    estimator = pushed(made.config, readings(made))
    t_ns = int(made.tables["imu0"].t_ns[-1])
    outcome = estimator.push(UwbRange(t_ns=t_ns, sensor="uwb0", anchor="a99", range_m=3.0))
    assert (outcome.verdict, outcome.reason) == (Verdict.INVALID, Reason.UNKNOWN_ANCHOR)


def test_flags_say_so_when_no_aid_comes() -> None:
    made = flight()
    estimator = pushed(made.config, readings(made))
    now = estimator.state()
    assert now.flags is Health.GOOD
    assert now.velocity_valid
    assert estimator.state(now.t_ns + 1_500_000_000).dead_reckoning
    late = estimator.state(now.t_ns + 6_000_000_000)
    assert late.dead_reckoning
    assert not late.velocity_valid


def test_readings_that_wait_for_inertial_samples_in_vain_are_dropped_and_counted() -> None:
    """Three minutes of UWB and nothing else: the filter holds the last minute, and starts once samples come."""
    made = fly(Scene(duration_s=3.0, sensors=("uwb0",)))
    estimator = CorridorEstimator(made.config)
    begin = made.tables["imu0"].t_ns[0]
    waiting = [
        UwbRange(t_ns=int(begin) - (180 - k) * 1_000_000_000, sensor="uwb0", anchor="a0", range_m=5.0)
        for k in range(180)
    ]
    assert {estimator.push(reading).reason for reading in waiting} == {Reason.ALIGNING}
    held = int(estimator._stream.ring.head["count"][0])
    assert held + estimator.late["uwb0"] == 180
    assert 60 <= held <= 63
    imu = made.tables["imu0"]
    for t_ns, gyro, accel in zip(imu.t_ns, imu.columns["gyro_rad_s"], imu.columns["accel_m_s2"], strict=True):
        estimator.push(ImuSample(t_ns=int(t_ns), sensor="imu0", gyro_rad_s=tuple(gyro), accel_m_s2=tuple(accel)))
    assert estimator.state().t_ns == imu.t_ns[-1]
