"""Simulated corridor flights with UWB that goes wrong in six ways.

A quadrotor flies stop-and-go along x between two walls 2.4 m apart.  A camera and a range finder look at the left wall,
a second range finder at the floor; UWB comes as position fixes, as ranges or as range differences.  Every anchor has an
error of its own that wanders slowly, on top of white noise.  Equal seeds give equal flights.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Initial
from axialnav.models.rig import BlurMeter, Imu, RangeFinder, Surface, Uwb
from tests.fusion.made_flights import (
    ACCEL_DENSITY,
    ACCEL_WALK,
    DOWN_BS,
    GYRO_DENSITY,
    GYRO_WALK,
    LEVER,
    MadeFlight,
    Motion,
    Scene,
    Table,
    _attitude,
    _imu,
    stamps,
    transform,
)

Array = NDArray[np.float64]
LEFT_BS = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))  # sensor axes in body axes, looking left
WALL_Y_M = 1.2
FOCAL_PX, WINDOW_S, MOTION_HZ = 400.0, 1.0 / 15.0, 6.0
SIGMA_SPEED, SCALE_SIGMA, MOTION_OUTLIERS = 0.12, 0.015, 0.03  # of pixel motion, as speed [m/s]
SIGMA_TOF_M = 0.02
SIGMA_UWB_M, WANDER_M, WANDER_S = 0.08, 0.06, 20.0
UWB_HZ, HEARD = 50.0, 6  # readings per second of the whole source, and how many anchors are near enough
EVENT_S = 40.0
FAULTS = ("clean", "spikes", "step", "ramp", "frozen", "wild", "start")
WINDOWS_S = {  # where the velocity is scored
    "clean": (5.0, 100.0),
    "spikes": (5.0, 100.0),
    "step": (EVENT_S, EVENT_S + 20.0),
    "ramp": (EVENT_S, EVENT_S + 15.0),
    "frozen": (EVENT_S, EVENT_S + 13.0),
    "wild": (EVENT_S, EVENT_S + 20.0),
    "start": (1.0, 30.0),
}
SPIKE_SHARE, SPIKE_M = 0.05, 6.0
START_WRONG_M = 8.0


@dataclass(frozen=True)
class Corridor:
    """One flight: what UWB measures, what goes wrong with it, and which anchors that touches.

    ``uwb`` is "fix", "range" or "tdoa"; ``fault`` one of :data:`FAULTS`; ``bad_anchors`` the share of anchors whose
    path is longer during "step" and "ramp" (fixes move along the corridor instead).
    """

    seed: int = 0
    uwb: str = "fix"
    fault: str = "clean"
    duration_s: float = 100.0
    bad_anchors: float = 0.5
    motion_fault: str = ""  # "", "scale" or "stuck": pixel motion goes wrong in the event window
    sensors: tuple[str, ...] = ("motion0", "wall0", "floor0", "uwb0")
    imu: Scene = field(default_factory=Scene)


def motion(corridor: Corridor, t: Array) -> Motion:
    """Stop-and-go along the corridor, swaying a little; from rest."""
    phase = np.random.default_rng([corridor.seed, 77]).uniform(0.0, 2.0 * np.pi, 5)

    def position(s: Array) -> Array:
        ramp = 1.0 - np.exp(-((np.maximum(s, 0.0) / 3.0) ** 3))
        slow = 0.8 / 0.25 * (np.cos(phase[0]) - np.cos(0.25 * s + phase[0]))
        quick = 0.3 / 0.8 * (np.cos(phase[1]) - np.cos(0.8 * s + phase[1]))
        x = 1.0 * s + slow + quick
        y = 0.15 * np.sin(0.5 * s + phase[2]) + 0.05 * np.sin(1.3 * s + phase[3])
        z = 0.1 * np.sin(0.35 * s + phase[4])
        return np.stack([ramp * x, ramp * y, 1.3 + ramp * z], axis=1)

    h = 1e-3
    back, here, ahead = position(t - h), position(t), position(t + h)
    velocity, accel = (ahead - back) / (2 * h), (ahead - 2 * here + back) / h**2
    turn = []
    for shift in (-h, h):
        around = (position(t + shift + h) - 2 * position(t + shift) + position(t + shift - h)) / h**2
        turn.append(_attitude(around, np.zeros_like(t)))
    rate = (turn[0].inv() * turn[1]).as_rotvec() / (2 * h)
    return Motion(t, here, velocity, accel, _attitude(accel, np.zeros_like(t)), rate)


def fly(corridor: Corridor) -> MadeFlight:
    """Simulate one flight."""
    rng = np.random.default_rng([corridor.seed, 1])
    rate_hz = corridor.imu.imu_rate_hz
    truth = motion(corridor, np.arange(round(corridor.duration_s * rate_hz) + 1) / rate_hz)
    imu, gyro_bias, accel_bias = _imu(corridor.imu, truth, rng)
    tables = {
        "imu0": imu,
        "motion0": _pixel_motion(corridor, rng),
        "wall0": _tof(corridor, rng, 1),
        "floor0": _tof(corridor, rng, 2),
        "uwb0": UWB[corridor.uwb](corridor, np.random.default_rng([corridor.seed, 2])),
    }
    chosen = {name: table for name, table in tables.items() if name in ("imu0", *corridor.sensors)}
    return MadeFlight(chosen, make_config(corridor, truth, rng), truth, gyro_bias, accel_bias)


def _instants(corridor: Corridor, rate_hz: float, phase: float) -> Array:
    return (phase + 1.0 + np.arange(int((corridor.duration_s - 0.3) * rate_hz))) / rate_hz


def _pixel_motion(corridor: Corridor, rng: np.random.Generator) -> Table:
    """Displacement of the left wall's image, the mean over the window, stamped at its middle."""
    t = _instants(corridor, MOTION_HZ, 0.57)
    parts = [_image_speed(corridor, t + share * WINDOW_S) for share in (-0.4, -0.2, 0.0, 0.2, 0.4)]
    mean = sum(parts) / len(parts)
    gain = FOCAL_PX * WINDOW_S
    dx = mean * gain * (1.0 + rng.normal(0, SCALE_SIGMA))
    during = (t >= EVENT_S) & (t < EVENT_S + 8.0)
    if corridor.motion_fault == "scale":
        dx = np.where(during, 1.5 * dx, dx)
    noisy = dx + rng.normal(0, gain * SIGMA_SPEED / WALL_Y_M, len(t))
    outlier = rng.random(len(t)) < MOTION_OUTLIERS
    noisy = np.where(outlier, rng.uniform(-2.0, 2.0, len(t)) * gain, noisy)
    if corridor.motion_fault == "stuck":
        noisy = np.where(during, noisy[np.argmax(during)], noisy)
    sigma = np.full(len(t), gain * SIGMA_SPEED / WALL_Y_M)
    return Table(stamps(t), {"window_s": np.full(len(t), WINDOW_S), "dx_px": noisy, "sigma_px": sigma})


def _image_speed(corridor: Corridor, t: Array) -> Array:
    """Speed of the image content along its x axis, divided by the focal length [1/s]."""
    at = motion(corridor, t)
    to_sensor = np.array(LEFT_BS)
    depth = (WALL_Y_M - at.position_m[:, 1]) / at.attitude.as_matrix()[:, 1, 1]
    v_S, w_S = at.attitude.inv().apply(at.velocity_m_s) @ to_sensor, at.rate_rad_s @ to_sensor
    return -(v_S[:, 0] / depth + w_S[:, 1])


def _tof(corridor: Corridor, rng: np.random.Generator, axis: int) -> Table:
    """Range to the left wall (axis 1) or the floor (axis 2)."""
    at = motion(corridor, _instants(corridor, 30.0, 0.31 * axis))
    along = at.attitude.as_matrix()[:, axis, axis]
    gap = WALL_Y_M - at.position_m[:, 1] if axis == 1 else at.position_m[:, 2]
    return Table(stamps(at.t), {"range_m": gap / along + rng.normal(0, SIGMA_TOF_M, len(at.t))})


def _episode(corridor: Corridor, t: Array, rng: np.random.Generator) -> Array:
    """What a reflection adds to a path at ``t`` [m], for the anchors that it touches."""
    since = t - EVENT_S
    during = (since >= 0.0) & (since < 15.0)
    if corridor.fault == "step":
        return 1.5 * during
    if corridor.fault == "ramp":
        return 2.5 * np.clip(since / 4.0, 0.0, 1.0) * (since < 10.0)
    if corridor.fault == "wild":
        return during * rng.uniform(-1.0, 4.0, len(t))
    if corridor.fault == "spikes":
        return (rng.random(len(t)) < SPIKE_SHARE) * rng.uniform(-SPIKE_M, SPIKE_M, len(t))
    return np.zeros(len(t))


def _wander(t: Array, count: int, rng: np.random.Generator) -> Array:
    """Slow errors, shape (n, count) [m]."""
    keep = np.exp(-np.diff(t, prepend=t[0] - 1.0) / WANDER_S)
    errors, value = np.empty((len(t), count)), rng.normal(0, WANDER_M, count)
    for k in range(len(t)):
        value = keep[k] * value + np.sqrt(1.0 - keep[k] ** 2) * rng.normal(0, WANDER_M, count)
        errors[k] = value
    return errors


def _hold(corridor: Corridor, t: Array, values: Array, group: NDArray[np.int64]) -> Array:
    """A receiver that hangs repeats, for eight seconds, the last value of every path."""
    if corridor.fault != "frozen":
        return values
    values = values.copy()
    during = (t >= EVENT_S) & (t < EVENT_S + 8.0)
    for one in np.unique(group[during]):
        before = np.flatnonzero((group == one) & (t < EVENT_S))
        mine = np.flatnonzero((group == one) & during)
        values[mine] = values[before[-1]] if len(before) else values[mine[0]]
    return values


def anchors(corridor: Corridor) -> dict[str, tuple[float, float, float]]:
    """Anchors on alternating walls and heights every 8 m, well past the end of the flight."""
    count = int(2.2 * corridor.duration_s / 8.0) + 4
    return {f"a{i}": (8.0 * i - 16.0, 1.1 if i % 2 else -1.1, 2.6 if i % 4 < 2 else 0.4) for i in range(min(count, 30))}


def _antenna(at: Motion) -> Array:
    return at.position_m + at.attitude.apply(LEVER)


def _fix(corridor: Corridor, rng: np.random.Generator) -> Table:
    at = motion(corridor, _instants(corridor, UWB_HZ, 0.43))
    error = rng.normal(0, SIGMA_UWB_M, (len(at.t), 3)) + _wander(at.t, 3, rng)
    error[:, 0] += _episode(corridor, at.t, rng)
    values = _hold(corridor, at.t, _antenna(at) + error, np.zeros(len(at.t), np.int64))
    return Table(stamps(at.t), {"position_m": values})


def _heard(corridor: Corridor, at: Motion) -> tuple[Array, NDArray[np.int64]]:
    """Paths to all anchors (n, anchors), and for every reading the anchor whose turn it is among the nearest."""
    places = np.array(list(anchors(corridor).values()))
    paths = np.linalg.norm(_antenna(at)[:, None, :] - places[None], axis=2)
    near = np.sort(np.argsort(paths, axis=1)[:, :HEARD], axis=1)
    return paths, near


def _touched(corridor: Corridor, count: int) -> NDArray[np.bool_]:
    """Anchors behind the reflection: every second one, or fewer, around where the vehicle then is."""
    share = corridor.bad_anchors
    if corridor.fault in ("wild", "spikes"):
        return np.ones(count, dtype=bool)
    return np.floor((np.arange(count) + 1) * share) > np.floor(np.arange(count) * share)


def _faulty_paths(corridor: Corridor, at: Motion, rng: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    paths, near = _heard(corridor, at)
    count = paths.shape[1]
    paths = paths + _wander(at.t, count, rng)
    return paths + _episode(corridor, at.t, rng)[:, None] * _touched(corridor, count), near


def _range(corridor: Corridor, rng: np.random.Generator) -> Table:
    at = motion(corridor, _instants(corridor, UWB_HZ, 0.43))
    paths, near = _faulty_paths(corridor, at, rng)
    rows = np.arange(len(at.t))
    a = near[rows, rows % HEARD]
    values = np.maximum(paths[rows, a] + rng.normal(0, SIGMA_UWB_M, len(a)), 0.05)
    return Table(stamps(at.t), {"anchor": a, "range_m": _hold(corridor, at.t, values, a)})


def _tdoa(corridor: Corridor, rng: np.random.Generator) -> Table:
    at = motion(corridor, _instants(corridor, UWB_HZ, 0.43))
    paths, near = _faulty_paths(corridor, at, rng)
    rows = np.arange(len(at.t))
    a, b = near[rows, rows % HEARD], near[rows, (rows + 1) % HEARD]
    values = paths[rows, b] - paths[rows, a] + rng.normal(0, 1.4 * SIGMA_UWB_M, len(a))
    held = _hold(corridor, at.t, values, a * 100 + b)
    return Table(stamps(at.t), {"anchor_a": a, "anchor_b": b, "difference_m": held})


UWB = {"fix": _fix, "range": _range, "tdoa": _tdoa}


def make_config(corridor: Corridor, truth: Motion, rng: np.random.Generator) -> Config:
    """The rig with the filter's default noise; the first state as wrong as it says, or 8 m more."""
    x, y, z = (truth.position_m[0] + rng.normal(0, 0.1, 3)).tolist()
    wrong = START_WRONG_M if corridor.fault == "start" else 0.0
    left, down, antenna = transform(LEFT_BS), transform(DOWN_BS), transform(lever=LEVER)
    measurement = {"fix": "position", "range": "range", "tdoa": "tdoa"}[corridor.uwb]
    sensors = {
        "imu0": Imu(
            gyro_noise_density=GYRO_DENSITY,
            gyro_bias_walk=GYRO_WALK,
            accel_noise_density=ACCEL_DENSITY,
            accel_bias_walk=ACCEL_WALK,
        ),
        "motion0": BlurMeter(T_BS=left, surface="left", focal_px=(FOCAL_PX, FOCAL_PX), law="composite", signed=True),
        "wall0": RangeFinder(T_BS=left, surface="left", sigma_m=SIGMA_TOF_M),
        "floor0": RangeFinder(T_BS=down, surface="floor", sigma_m=SIGMA_TOF_M),
        "uwb0": Uwb(T_BS=antenna, measurement=measurement, anchors=anchors(corridor)),
    }
    return Config(
        initial=Initial(position_m=(x + wrong, y, z), sigma_yaw_rad=0.05),
        surface={
            "floor": Surface(normal=(0.0, 0.0, 1.0)),
            "left": Surface(normal=(0.0, -1.0, 0.0), offset_m=-WALL_Y_M),
        },
        sensor={name: spec for name, spec in sensors.items() if name in ("imu0", *corridor.sensors)},
    )
