"""Camera frames pushed into the filter: a wall in view gives the velocity along it."""

from __future__ import annotations

import numpy as np
import pytest

import axialnav as an
from axialnav.fusion.config import Config

PERIOD_NS = 33_333_333
FOCAL_PX, DISTANCE_M, SPEED_M_S = 300.0, 1.5, 0.6
SHIFT_PX = -FOCAL_PX * SPEED_M_S * PERIOD_NS * 1e-9 / DISTANCE_M
# the camera looks to the left at a wall: its x axis is the body's x axis, its z axis the body's y axis
T_BS = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def config() -> Config:
    return Config.from_dict(
        {
            "initial": {"position_m": [0.0, 0.0, 1.0], "sigma_velocity_m_s": 0.5},
            "surface": {"wall": {"normal": [0.0, -1.0, 0.0], "offset_m": -DISTANCE_M}},
            "sensor": {
                "imu0": {"kind": "imu"},
                "tof0": {"kind": "range", "T_BS": T_BS, "surface": "wall"},
                "cam0": {
                    "kind": "camera",
                    "T_BS": T_BS,
                    "resolution": [320, 240],
                    "intrinsics": [FOCAL_PX, FOCAL_PX, 160.0, 120.0],
                    "rate_hz": 30.0,
                    "surface": "wall",
                },
            },
        }
    )


def frames(n: int) -> list[np.ndarray]:
    """Windows that slide over a random texture, shifted by whole fractions in the Fourier domain."""
    rng = np.random.default_rng(3)
    spectrum = np.fft.rfft(rng.normal(size=(240, 1024)), axis=1)
    k = np.arange(spectrum.shape[1])
    spectrum *= 1.0 / (1.0 + k / 40.0)
    out = []
    for i in range(n):
        moved = np.fft.irfft(spectrum * np.exp(-2j * np.pi * k * SHIFT_PX * i / 1024), 1024, axis=1)
        grey = 120.0 + 25.0 * moved / moved.std() + rng.normal(0.0, 2.0, moved.shape)
        out.append(np.clip(np.rint(grey[:, 300:620]), 0, 255).astype(np.uint8))
    return out


def fly(estimator: an.CorridorEstimator, with_frames: bool) -> list[an.Outcome]:
    outcomes = []
    pictures = frames(60)
    for i in range(400):
        t_ns = i * 5_000_000
        estimator.push(an.ImuSample(t_ns=t_ns, sensor="imu0", gyro_rad_s=(0, 0, 0), accel_m_s2=(0, 0, 9.80665)))
        estimator.push(an.WallRange(t_ns=t_ns, sensor="tof0", range_m=DISTANCE_M))
        if with_frames and t_ns // PERIOD_NS != (t_ns - 5_000_000) // PERIOD_NS:
            number = t_ns // PERIOD_NS
            frame = an.CameraFrame(t_ns=number * PERIOD_NS, sensor="cam0", image=pictures[number])
            outcomes.append(estimator.push(frame))
    return outcomes


def test_frames_give_the_velocity_along_the_wall() -> None:
    estimator = an.CorridorEstimator(config())
    outcomes = fly(estimator, with_frames=True)
    verdicts = [outcome.verdict for outcome in outcomes]
    assert all(verdict is an.Verdict.BLIND for verdict in verdicts[:4]), "no displacement before five frames"
    assert sum(verdict is an.Verdict.FUSED for verdict in verdicts) > 20
    state = estimator.state()
    assert state.sigma_axial_velocity_m_s < 0.05
    assert abs(state.axial_velocity_m_s - SPEED_M_S) < 3.0 * state.sigma_axial_velocity_m_s


def test_without_frames_the_velocity_stays_unknown() -> None:
    estimator = an.CorridorEstimator(config())
    fly(estimator, with_frames=False)
    assert abs(estimator.state().axial_velocity_m_s) < 0.1
    assert estimator.state().sigma_axial_velocity_m_s > 0.4


def test_a_camera_without_a_surface_is_named() -> None:
    estimator = an.CorridorEstimator(config())
    frame = an.CameraFrame(t_ns=0, sensor="cam7", image=np.zeros((4, 4), np.uint8))
    with pytest.raises(an.ReadingError, match=r"cam7.*cam0"):
        estimator.push(frame)


def test_something_that_is_no_picture_is_refused_at_construction() -> None:
    with pytest.raises(an.ReadingError, match=r"CameraFrame.image .*\(3,\)"):
        an.CameraFrame(t_ns=0, sensor="cam0", image=np.zeros(3))


def climb(dy_px: float | None) -> tuple[an.CorridorEstimator, list[an.Outcome]]:
    """Flown along the wall at ``SPEED_M_S`` and upwards at half of that, as the displacements of a camera say."""
    estimator, outcomes, rng = an.CorridorEstimator(config()), [], np.random.default_rng(4)
    for i in range(400):
        t_ns = i * 5_000_000
        estimator.push(an.ImuSample(t_ns=t_ns, sensor="imu0", gyro_rad_s=(0, 0, 0), accel_m_s2=(0, 0, 9.80665)))
        estimator.push(an.WallRange(t_ns=t_ns, sensor="tof0", range_m=DISTANCE_M))
        if i % 8 == 0:
            dx, dy = SHIFT_PX + 0.07 * rng.normal(), None if dy_px is None else dy_px + 0.08 * rng.normal()
            moved = an.PixelMotion(
                t_ns=t_ns, sensor="cam0", window_s=PERIOD_NS * 1e-9, dx_px=dx, dy_px=dy, sigma_px=0.07, sigma_dy_px=0.08
            )
            outcomes.append(estimator.push(moved))
    return estimator, outcomes


def test_what_a_picture_does_across_its_rows_gives_the_speed_of_climbing() -> None:
    with_it, _ = climb(-0.5 * SHIFT_PX)
    without, _ = climb(None)
    assert with_it.state().velocity_m_s[2] == pytest.approx(0.5 * SPEED_M_S, abs=0.01)
    assert abs(without.state().velocity_m_s[2] - 0.5 * SPEED_M_S) > 0.1, "nothing else tells"


def test_a_wrong_motion_across_does_not_take_the_one_along_with_it() -> None:
    """As where a cable hangs still in the picture; 40 px are a climb of 6 m/s."""
    estimator, outcomes = climb(40.0)
    compared = [outcome for outcome in outcomes if outcome.verdict is not an.Verdict.BLIND]
    assert len(compared) > 20
    assert all(outcome.verdict is an.Verdict.FUSED and len(outcome.innovation) == 1 for outcome in compared)
    assert estimator.state().axial_velocity_m_s == pytest.approx(SPEED_M_S, abs=0.02)
    assert abs(estimator.state().velocity_m_s[2]) < 0.5
