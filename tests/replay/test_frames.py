"""A flight whose only aid along the corridor is its camera: from the pictures on disk to the fused velocity."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import axialnav as an
from axialnav.replay.flight import Flight, SensorTable, Truth
from axialnav.replay.flight_writer import write_flight
from tests.fusion.test_camera_frames import DISTANCE_M, PERIOD_NS, SPEED_M_S, config, frames

STEP_NS = 5_000_000
N_IMU, N_FRAMES = 400, 60


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    folder = tmp_path_factory.mktemp("flight")
    pictures = folder / "mav0" / "cam0" / "data"
    pictures.mkdir(parents=True)
    for number, picture in enumerate(frames(N_FRAMES)):
        cv2.imwrite(str(pictures / f"{number}.png"), picture)
    t_ns = np.arange(N_IMU, dtype=np.int64) * STEP_NS
    gravity = np.tile([0.0, 0.0, 9.80665], (N_IMU, 1))
    along = SPEED_M_S * t_ns[:, None] * 1e-9 * np.array([1.0, 0.0, 0.0]) + np.array([0.0, 0.0, 1.0])
    tables = {
        "imu0": SensorTable(t_ns, {"gyro_rad_s": np.zeros((N_IMU, 3)), "accel_m_s2": gravity}),
        "tof0": SensorTable(t_ns, {"range_m": np.full(N_IMU, DISTANCE_M)}),
        "cam0": SensorTable(
            np.arange(N_FRAMES, dtype=np.int64) * PERIOD_NS,
            {"filename": np.array([f"{number}.png" for number in range(N_FRAMES)])},
        ),
    }
    truth = Truth(t_ns, along, np.tile([1.0, 0.0, 0.0, 0.0], (N_IMU, 1)), np.tile([SPEED_M_S, 0.0, 0.0], (N_IMU, 1)))
    write_flight(Flight("frames", folder, {}, config(), tables, truth, evaluation=(1.0, None)), folder)
    return an.load_flight(folder)


def test_pictures_on_disk_give_the_velocity(flight: Flight) -> None:
    run = an.replay(flight)
    axial = run.metrics["axial_velocity_m_s"]
    assert axial["rmse"] < 0.02
    assert axial["in_3_sigma"] > 0.97
    assert run.metrics["sensors"]["cam0"]["fused"] > 40


def test_without_the_camera_it_stays_unknown(flight: Flight) -> None:
    axial = an.replay(flight, without=["cam0"]).metrics["axial_velocity_m_s"]
    assert axial["rmse"] > 0.5
    assert axial["mean_sigma"] > 0.4


def test_frames_pushed_one_by_one_give_the_same_bits(flight: Flight) -> None:
    estimator = an.CorridorEstimator(an.replay(flight).config)
    for reading in flight.readings():
        estimator.push(reading)
    track = an.replay(flight).track
    at = int(np.searchsorted(track.t_ns, estimator.state().t_ns))
    # the track holds the state at the sample; what came at the same stamp after it is only in the streaming state
    np.testing.assert_allclose(track.velocity_m_s[at], estimator.state().velocity_m_s, atol=1e-3)


def test_a_picture_that_gives_nothing_is_counted_as_blind(flight: Flight, tmp_path: Path) -> None:
    blank = np.full((240, 320), 100, np.uint8)
    folder = Path(write_flight(flight, tmp_path / "blank"))
    for number in range(20, 30):
        cv2.imwrite(str(folder / "mav0" / "cam0" / "data" / f"{number}.png"), blank)
    sensor = an.replay(folder).metrics["sensors"]["cam0"]
    assert sensor["blind"] >= 10
    assert sensor["unprocessed"] == 4, "frames before the first full window"
    assert sensor["fused"] + sensor["gated"] + sensor["blind"] + sensor["unprocessed"] == sensor["available"]
