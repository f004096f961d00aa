"""Nonsense is refused at the door, and the refusal says what, value, limit and way out."""

from __future__ import annotations

import math

import pytest

from axialnav.fusion.errors import AxialnavError, ReadingError
from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    Height,
    ImuSample,
    PixelMotion,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)

NAN, INF = math.nan, math.inf
GOOD = {
    ImuSample: {"gyro_rad_s": (0.1, 0.2, 0.3), "accel_m_s2": (0.0, 0.0, 9.8)},
    PixelMotion: {"window_s": 0.02, "dx_px": -3.0, "dy_px": 1.0, "sigma_px": 0.5, "quality": 80.0},
    BlurLength: {"window_s": 0.02, "length_px": 12.0, "sigma_px": 1.0},
    WallRange: {"range_m": 2.0, "sigma_m": 0.02},
    UwbRange: {"anchor": "a", "range_m": 5.0, "sigma_m": 0.1, "rssi_dbm": -80.0, "first_path_dbm": -82.0},
    UwbTdoa: {"anchor_a": "a", "anchor_b": "b", "difference_m": -1.0, "sigma_m": 0.1},
    UwbFix: {"position_m": (1.0, 2.0, 3.0), "sigma_m": (0.1, 0.1, 0.2)},
    Height: {"height_m": 100.0, "sigma_m": 0.5},
    Attitude: {"roll_rad": 0.1, "pitch_rad": -0.2, "yaw_rad": 3.0, "sigma_rad": 0.02},
}
NUMBERS = [(kind, field) for kind, good in GOOD.items() for field, v in good.items() if isinstance(v, float)]
NUMBERS = [pair for pair in NUMBERS if pair[1] not in {"quality", "rssi_dbm", "first_path_dbm"}]
VECTORS = [(kind, field) for kind, good in GOOD.items() for field, v in good.items() if isinstance(v, tuple)]
OUTSIDE = [
    (ImuSample, "gyro_rad_s", (0.0, 0.0, 201.0)),
    (ImuSample, "accel_m_s2", (-2001.0, 0.0, 0.0)),
    (PixelMotion, "window_s", 0.0),
    (PixelMotion, "window_s", 11.0),
    (PixelMotion, "dx_px", 1.1e5),
    (PixelMotion, "dy_px", -1.1e5),
    (PixelMotion, "sigma_px", 0.0),
    (BlurLength, "length_px", -1.0),
    (BlurLength, "sigma_px", -1.0),
    (WallRange, "range_m", -0.01),
    (WallRange, "range_m", 1.1e5),
    (UwbRange, "range_m", -0.01),
    (UwbRange, "sigma_m", 0.0),
    (UwbTdoa, "difference_m", 2e5),
    (UwbTdoa, "anchor_b", "a"),
    (UwbFix, "position_m", (0.0, 0.0)),
    (UwbFix, "position_m", (0.0, 0.0, 2e5)),
    (UwbFix, "sigma_m", (0.1, 0.0, 0.1)),
    (UwbFix, "sigma_m", (0.1, 0.1)),
    (Height, "height_m", 2e5),
    (Attitude, "roll_rad", 57.3),
    (Attitude, "sigma_rad", -0.1),
]


def make(kind, **changes):
    return kind(**{"t_ns": 1_000, "sensor": "s0", **GOOD[kind], **changes})


@pytest.mark.parametrize("kind", GOOD)
def test_good_readings_are_taken_as_they_are(kind) -> None:
    reading = make(kind)
    assert {field: getattr(reading, field) for field in GOOD[kind]} == GOOD[kind]


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize(("kind", "field"), NUMBERS, ids=lambda v: getattr(v, "__name__", v))
def test_numbers_that_are_not_finite_are_refused(kind, field: str, bad: float) -> None:
    with pytest.raises(ReadingError, match=field):
        make(kind, **{field: bad})


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("kind", "field"), VECTORS, ids=lambda v: getattr(v, "__name__", v))
def test_vectors_that_are_not_finite_are_refused(kind, field: str, axis: int, bad: float) -> None:
    value = list(GOOD[kind][field])
    value[axis] = bad
    with pytest.raises(ReadingError, match=field):
        make(kind, **{field: tuple(value)})


@pytest.mark.parametrize(("kind", "field", "value"), OUTSIDE, ids=str)
def test_values_outside_their_limits_are_refused(kind, field: str, value) -> None:
    with pytest.raises(ReadingError, match=field):
        make(kind, **{field: value})


@pytest.mark.parametrize("stamp", [1.5, "now", True, 2**62, -(2**62), None])
@pytest.mark.parametrize("kind", GOOD)
def test_a_stamp_is_an_integer_within_reach(kind, stamp) -> None:
    with pytest.raises(ReadingError, match="t_ns"):
        make(kind, t_ns=stamp)


OPTIONAL = [
    *((PixelMotion, field) for field in ("dy_px", "sigma_px", "quality")),
    *((UwbRange, field) for field in ("sigma_m", "rssi_dbm", "first_path_dbm")),
    *((kind, "sigma_m") for kind in (WallRange, UwbTdoa, UwbFix, Height)),
    (Attitude, "sigma_rad"),
]


@pytest.mark.parametrize(("kind", "field"), OPTIONAL)
def test_what_a_sensor_does_not_tell_may_be_left_out(kind, field: str) -> None:
    assert getattr(make(kind, **{field: None}), field) is None


def test_the_refusal_tells_what_value_limit_sensor_and_way_out() -> None:
    with pytest.raises(ReadingError) as refusal:
        make(WallRange, range_m=-0.5)
    message = str(refusal.value)
    for part in ("WallRange.range_m", "-0.5", "within 0..100000", "s0", "t_ns=1000", "drop the reading"):
        assert part in message
    assert "\n" not in message


def test_a_refusal_is_an_error_of_the_package_and_a_value_error() -> None:
    assert issubclass(ReadingError, AxialnavError)
    assert issubclass(ReadingError, ValueError)


def test_readings_cannot_be_changed_afterwards() -> None:
    with pytest.raises(AttributeError, match="immutable"):
        make(Height).height_m = NAN
