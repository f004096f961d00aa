"""Messages to readings: axes and signs against rotation matrices, and a reason for everything that is left out."""

from __future__ import annotations

import math

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest
from scipy.spatial.transform import Rotation

from axialnav.fusion.config import Config
from axialnav.fusion.live.clock import BootClock
from axialnav.fusion.live.mavlink_in import MavlinkInput, with_rounding
from axialnav.fusion.live.vehicle import Inputs
from axialnav.fusion.readings import Attitude, ImuSample, PixelMotion, UwbFix, WallRange
from axialnav.models.rig import AttitudeSource, Flow, Imu, RangeFinder, Surface, Uwb

S, MS = 1_000_000_000, 1_000_000
NOW = 500 * S
FLIP = np.diag([1.0, -1.0, -1.0])
AHEAD = (1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
CONFIG = Config(
    surface={"floor": Surface(normal=(0.0, 0.0, 1.0))},
    sensor={
        "imu0": Imu(),
        "att0": AttitudeSource(),
        "tof0": RangeFinder(surface="floor"),
        "flow0": Flow(T_BS=AHEAD, focal_px=(300.0, 200.0), surface="floor"),
        "uwb0": Uwb(measurement="position"),
    },
)
INPUTS = Inputs(attitude="att0", flow="flow0", vision="uwb0", range={"tof0": 25})


def synchronised() -> BootClock:
    """Boot was 400 s ago."""
    clock = BootClock()
    for k in range(10):
        at = NOW - S + k * 100 * MS
        clock.exchange(at, at - 100 * S + MS, at + 2 * MS)
    return clock


def inputs(heading_rad: float = 0.0) -> MavlinkInput:
    return MavlinkInput(INPUTS, CONFIG, synchronised(), heading_rad)


def highres(boot_us: int, accel=(0.1, 0.2, -9.8), gyro=(0.01, 0.02, 0.03), updated: int = 0x3F, unit: int = 0):
    return mavlink.MAVLink_highres_imu_message(boot_us, *accel, *gyro, *[0.0] * 7, updated, unit)


def test_inertial_samples_turn_from_frd_to_flu_and_to_our_clock() -> None:
    sample = inputs().reading(highres(400_000_000), NOW + 3 * MS)
    assert isinstance(sample, ImuSample)
    assert sample.accel_m_s2 == (0.1, -0.2, 9.8)
    assert sample.gyro_rad_s == (0.01, -0.02, -0.03)
    assert sample.t_ns == pytest.approx(NOW, abs=10_000)


@pytest.mark.parametrize("name", ["raw_imu", "scaled_imu"])
def test_coarse_samples_are_a_fallback_in_milli_g_and_mrad(name: str) -> None:
    fed = inputs()
    stamp = 400_000_000 if name == "raw_imu" else 400_000
    message = getattr(mavlink, f"MAVLink_{name}_message")(stamp, 0, 0, -1001, 7, 8, 9, 0, 0, 0)
    sample = fed.reading(message, NOW)
    assert isinstance(sample, ImuSample)
    assert sample.accel_m_s2[2] == pytest.approx(1.001 * 9.80665)
    assert sample.gyro_rad_s == pytest.approx((0.007, -0.008, -0.009))
    assert fed.imu_source == name.upper()
    assert isinstance(fed.reading(highres(400_005_000), NOW + 5 * MS), ImuSample)  # the fine one takes over at once
    message = getattr(mavlink, f"MAVLink_{name}_message")(stamp, 0, 0, -1001, 7, 8, 9, 0, 0, 0)
    assert fed.reading(message, NOW + 10 * MS) is None
    assert fed.refused[f"{name.upper()} beside HIGHRES_IMU"] == 1


def test_rounding_is_in_the_noise_of_coarse_samples() -> None:
    """Rounding of a long noisy series, against the density that is added."""
    rng, rate = np.random.default_rng(1), 100.0
    signal = rng.normal(0.0, 0.1, 200_000)
    error = np.round(signal / 9.80665e-3) * 9.80665e-3 - signal
    imu, rounded = CONFIG.sensor["imu0"], with_rounding(CONFIG, "imu0", rate).sensor["imu0"]
    assert isinstance(imu, Imu)
    assert isinstance(rounded, Imu)
    added = math.sqrt(rounded.accel_noise_density**2 - imu.accel_noise_density**2)
    assert added == pytest.approx(error.std() / math.sqrt(rate), rel=0.01)
    assert rounded.gyro_noise_density > imu.gyro_noise_density


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: highres(400_000_000, updated=0x3E), "HIGHRES_IMU without new rates and forces"),
        (lambda: highres(400_000_000, unit=1), "HIGHRES_IMU of another unit"),
        (lambda: highres(400_000_000, accel=(math.nan, 0.0, 0.0)), "HIGHRES_IMU not usable"),
        (lambda: highres(400_000_000, accel=(1e30, 0.0, 0.0)), "HIGHRES_IMU not usable"),
        (lambda: highres(401_000_000), "stamp far from arrival"),
        (lambda: highres(2**63), "stamp far from arrival"),
        (lambda: highres(398_000_000), "stamp far from arrival"),
        (
            lambda: mavlink.MAVLink_attitude_quaternion_message(400_000, *[0.0] * 7),
            "ATTITUDE_QUATERNION without unit length",
        ),
        (
            lambda: mavlink.MAVLink_distance_sensor_message(400_000, 10, 500, 200, 0, 0, 0, 0),
            "DISTANCE_SENSOR with orientation 0",
        ),
        (
            lambda: mavlink.MAVLink_distance_sensor_message(400_000, 10, 500, 501, 0, 0, 25, 0),
            "DISTANCE_SENSOR invalid or out of its range",
        ),
        (
            lambda: mavlink.MAVLink_optical_flow_message(400_000_000, 0, 0, 0, 0.0, 0.0, 9, 1.0),
            "OPTICAL_FLOW without a window",
        ),
    ],
)
def test_what_is_not_used_is_counted_with_its_reason(make, reason: str) -> None:
    fed = inputs()
    assert fed.reading(make(), NOW) is None
    assert dict(fed.refused) == {reason: 1}


def test_repeated_and_frozen_samples_are_refused() -> None:
    fed = inputs()
    taken = [fed.reading(highres(400_000_000 + 5_000 * (k // 2)), NOW + 5 * MS * k) for k in range(4)]
    assert [r is not None for r in taken] == [True, False, True, False]
    for k in range(20):
        fed.reading(highres(400_020_000 + 5_000 * k), NOW + (20 + 5 * k) * MS)
    assert fed.refused["HIGHRES_IMU repeated"] == 2
    assert fed.refused["HIGHRES_IMU frozen"] > 8


def test_attitude_comes_as_roll_pitch_yaw_of_the_autopilot() -> None:
    x, y, z, w = Rotation.from_euler("ZYX", [2.0, -0.3, 0.4]).as_quat().tolist()
    message = mavlink.MAVLink_attitude_quaternion_message(400_000, w, x, y, z, 0.0, 0.0, 0.0)
    reading = inputs().reading(message, NOW)
    assert isinstance(reading, Attitude)
    assert (reading.yaw_rad, reading.pitch_rad, reading.roll_rad) == pytest.approx((2.0, -0.3, 0.4), abs=1e-6)


def test_distance_in_metres_with_its_variance() -> None:
    reading = inputs().reading(mavlink.MAVLink_distance_sensor_message(400_000, 10, 500, 123, 0, 0, 25, 4), NOW)
    assert isinstance(reading, WallRange)
    assert (reading.range_m, reading.sigma_m) == pytest.approx((1.23, 0.02))


@pytest.mark.parametrize(
    ("velocity_frd", "rate_frd", "flow"),
    [
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.5)),  # forward: positive about y
        ((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (-0.5, 0.0)),  # to the right: negative about x
        ((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.0)),  # turning about x: the same about x
        ((0.0, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.3)),
    ],
)
def test_flow_has_the_signs_of_the_model(velocity_frd, rate_frd, flow) -> None:
    """A sensor looking down from 2 m, against du/dt = -f (v_x / Z + w_y), dv/dt = -f (v_y / Z - w_x)."""
    window = 0.02
    message = mavlink.MAVLink_optical_flow_rad_message(
        400_000_000, 0, 20_000, flow[0] * window, flow[1] * window, 0.0, 0.0, 0.0, 0, 255, 0, -1.0
    )
    reading = inputs().reading(message, NOW)
    assert isinstance(reading, PixelMotion)
    spec = CONFIG.sensor["flow0"]
    assert isinstance(spec, Flow)
    to_sensor = spec.rotation_BS.T @ FLIP  # FRD to S
    v, w = to_sensor @ velocity_frd, to_sensor @ rate_frd
    dx = -300.0 * (v[0] / 2.0 + w[1]) * window
    dy = -200.0 * (v[1] / 2.0 - w[0]) * window
    assert (reading.dx_px, reading.dy_px) == pytest.approx((dx, dy), abs=1e-5)
    assert reading.t_ns == pytest.approx(NOW - 10 * MS, abs=10_000)
    assert reading.quality == 255.0


def test_flow_rates_use_the_time_since_the_message_before() -> None:
    fed = inputs()
    for k in range(3):
        message = mavlink.MAVLink_optical_flow_message(
            400_000_000 + 50_000 * k, 0, 0, 0, 0.0, 0.0, 200, 1.0, flow_rate_x=0.2, flow_rate_y=-0.1
        )
        reading = fed.reading(message, NOW + 50 * MS * k)
    assert isinstance(reading, PixelMotion)
    assert reading.window_s == pytest.approx(0.05, rel=1e-3)
    assert (reading.dx_px, reading.dy_px) == pytest.approx((300.0 * 0.1 * 0.05, 200.0 * 0.2 * 0.05), rel=1e-3)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_positions_come_from_ned_into_the_corridor(heading: float) -> None:
    """North 3, east 4, 1 m up, seen along a corridor that runs by ``heading`` east of north."""
    covariance = [0.0] * 21
    for at, value in zip((0, 6, 11), (0.04, 0.01, 0.09), strict=True):
        covariance[at] = value
    message = mavlink.MAVLink_vision_position_estimate_message(400_000_000, 3.0, 4.0, -1.0, 0.0, 0.0, 0.0, covariance)
    reading = inputs(heading).reading(message, NOW)
    assert isinstance(reading, UwbFix)
    along = 3.0 * math.cos(heading) + 4.0 * math.sin(heading)
    left = 3.0 * math.sin(heading) - 4.0 * math.cos(heading)
    assert reading.position_m == pytest.approx((along, left, 1.0))
    assert reading.sigma_m is not None
    assert reading.sigma_m[2] == pytest.approx(0.3)
    assert sum(s * s for s in reading.sigma_m[:2]) == pytest.approx(0.05)
