"""Readings of every kind in any sequence a bus could deliver: never a NaN in the state, never an undocumented error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from axialnav.fusion.config import Config
from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.errors import FlightError, ReadingError
from axialnav.fusion.outcome import Outcome
from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    Height,
    ImuSample,
    PixelMotion,
    Reading,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from axialnav.models.rig import BlurMeter
from tests.fusion.made_flights import DOWN_BS, FOCAL_PX, GRAVITY, Scene, fly, transform

RIG = ("range0", "flow0", "uwb0", "tdoa0", "fix0", "baro0", "attitude0")
STEP_NS = 10_000_000


def config() -> Config:
    made = fly(Scene(duration_s=0.5, sensors=RIG)).config
    blur = BlurMeter(T_BS=transform(DOWN_BS), focal_px=(FOCAL_PX, FOCAL_PX), surface="floor", law="exposure")
    return Config(
        start=Config.from_dict({"start": {"window_s": 0.05}}).start,
        surface=made.surface,
        sensor={**made.sensor, "blur0": blur},
    )


CONFIG = config()
STAMP = st.one_of(st.integers(0, 300).map(lambda k: k * STEP_NS), st.integers(-(10**10), 10**10))
LENGTH = st.floats(0.0, 1e5)
SIGNED = st.floats(-1e5, 1e5)
SIGMA = st.none() | st.floats(1e-6, 1e6)
WINDOW = st.floats(1e-6, 10.0)
RATE, FORCE = st.floats(-200.0, 200.0), st.floats(-2000.0, 2000.0)
ANGLE = st.floats(-7.0, 7.0)
ANCHOR = st.sampled_from(["a0", "a3", "a7", "nobody", ""])
THREE = st.tuples(SIGNED, SIGNED, SIGNED)
PAIR = st.tuples(ANCHOR, ANCHOR).filter(lambda pair: pair[0] != pair[1])


def stamped(kind, sensor: str, **fields) -> st.SearchStrategy[Reading]:
    return st.builds(kind, t_ns=STAMP, sensor=st.sampled_from([sensor, sensor, sensor, "imu0", "ghost"]), **fields)


CALM = st.builds(
    ImuSample,
    t_ns=STAMP,
    sensor=st.just("imu0"),
    gyro_rad_s=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    accel_m_s2=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(9, 11)),
)
ANY = st.one_of(
    CALM,
    stamped(ImuSample, "imu0", gyro_rad_s=st.tuples(RATE, RATE, RATE), accel_m_s2=st.tuples(FORCE, FORCE, FORCE)),
    stamped(PixelMotion, "flow0", window_s=WINDOW, dx_px=SIGNED, dy_px=st.none() | SIGNED, sigma_px=SIGMA,
            quality=st.none() | st.floats(allow_nan=True)),
    stamped(BlurLength, "blur0", window_s=WINDOW, length_px=LENGTH, sigma_px=st.floats(1e-6, 1e6)),
    stamped(WallRange, "range0", range_m=LENGTH, sigma_m=SIGMA),
    stamped(UwbRange, "uwb0", anchor=ANCHOR, range_m=LENGTH, sigma_m=SIGMA),
    PAIR.flatmap(lambda p: stamped(UwbTdoa, "tdoa0", anchor_a=st.just(p[0]), anchor_b=st.just(p[1]),
                                   difference_m=SIGNED, sigma_m=SIGMA)),
    stamped(UwbFix, "fix0", position_m=THREE, sigma_m=st.none() | st.tuples(*[st.floats(1e-6, 1e6)] * 3)),
    stamped(Height, "baro0", height_m=SIGNED, sigma_m=SIGMA),
    stamped(Attitude, "attitude0", roll_rad=ANGLE, pitch_rad=ANGLE, yaw_rad=ANGLE, sigma_rad=SIGMA),
)  # fmt: skip


def started() -> CorridorEstimator:
    estimator = CorridorEstimator(CONFIG)
    for k in range(8):
        still = ImuSample(t_ns=k * STEP_NS, sensor="imu0", gyro_rad_s=(0, 0, 0), accel_m_s2=(0, 0, GRAVITY))
        estimator.push(still)
    return estimator


def is_sound(estimator: CorridorEstimator) -> bool:
    state = estimator.state()
    numbers = np.concatenate([state.position_m, state.velocity_m_s, state.quaternion_WB, state.accel_bias_m_s2])
    return bool(np.isfinite(numbers).all() and np.isfinite(state.covariance).all())


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(st.lists(ANY, max_size=40))
def test_no_sequence_of_readings_breaks_a_filter_that_runs(stream: list[Reading]) -> None:
    estimator = started()
    for reading in stream:
        try:
            outcome = estimator.push(reading)
        except (ReadingError, FlightError):
            continue
        assert isinstance(outcome, Outcome)
        assert outcome.t_ns == reading.t_ns
        if estimator._aligned:
            assert is_sound(estimator), reading


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(ANY, max_size=20), st.randoms(use_true_random=False))
def test_the_order_of_arrival_never_matters_within_the_ring(stream: list[Reading], random) -> None:
    known = [r for r in stream if r.sensor != "ghost" and 80_000_000 <= r.t_ns <= 900_000_000]
    shuffled = known.copy()
    random.shuffle(shuffled)
    states = []
    for order in (sorted(known, key=lambda r: r.t_ns), shuffled):
        estimator = started()
        for reading in order:
            try:
                estimator.push(reading)
            except ReadingError:
                continue
        assert not estimator.late
        state = estimator.state()
        states.append((state.position_m.tobytes(), state.velocity_m_s.tobytes(), state.covariance.tobytes()))
    assert states[0] == states[1]
