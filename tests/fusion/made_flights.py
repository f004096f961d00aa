"""Small simulated flights: a quadrotor in a room, with every sensor the filter takes and noise of stated size.

The vehicle swings along Lissajous curves, always pushed along its own z axis, so that tilt, specific force and velocity
belong together as they do on a real one.  Readings are sampled, noisy and quantised; equal seeds give equal flights.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from axialnav.fusion.config import Config, Gate, ImuTuning, Initial, UwbTuning
from axialnav.models.rig import AnySensor, AttitudeSource, Barometer, Flow, Imu, RangeFinder, Surface, Uwb

Array = NDArray[np.float64]
GRAVITY = 9.80665
UP = np.array([0.0, 0.0, GRAVITY])
START_NS = 3_000_000_000
DOWN_BS = ((0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0))  # sensor axes in body axes, looking down
ANCHORS = {
    f"a{i}": (x, y, z)
    for i, (x, y, z) in enumerate((x, y, z) for z in (0.2, 3.0) for x in (-5.0, 5.0) for y in (-4.0, 4.0))
}
ACCEL_DENSITY, ACCEL_WALK = 2.0e-2, 3.0e-3
GYRO_DENSITY, GYRO_WALK = 1.7e-3, 2.0e-5
SIGMA = {"range": 0.02, "flow": 0.8, "tdoa": 0.15, "uwb": 0.15, "fix": 0.2, "baro": 0.5, "attitude": 0.02}
FOCAL_PX, WINDOW_S = 350.0, 0.02
LEVER = (0.05, -0.03, -0.02)


@dataclass(frozen=True)
class Table:
    """Readings of one sensor, keyed by the fields of its reading class."""

    t_ns: NDArray[np.int64]
    columns: Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True)
class Motion:
    """Truth at the instants ``t`` [s], shapes (n, 3) and an attitude each."""

    t: Array
    position_m: Array
    velocity_m_s: Array
    accel_m_s2: Array
    attitude: Rotation
    rate_rad_s: Array


@dataclass(frozen=True)
class MadeFlight:
    """A simulated flight: tables, a configuration that knows its noise, and the truth at the inertial samples."""

    tables: dict[str, Table]
    config: Config
    truth: Motion
    gyro_bias: Array
    accel_bias: Array

    @property
    def t_s(self) -> Array:
        """Seconds since the first inertial sample."""
        return self.truth.t


@dataclass(frozen=True)
class Scene:
    """What is simulated; ``sensors`` names them, ``faults`` are applied to the noise-free readings by name."""

    seed: int = 0
    duration_s: float = 20.0
    imu_rate_hz: float = 200.0
    size_m: tuple[float, float, float] = (1.6, 1.2, 0.4)
    rate_rad_s: tuple[float, float, float] = (0.9, 1.1, 0.7)
    yaw_rate_rad_s: float = 0.2
    still_s: float = 0.0
    sensors: tuple[str, ...] = ("range0", "flow0", "tdoa0", "baro0", "attitude0")
    uwb_rate_hz: float = 40.0
    accel_bias_sigma: float = 0.3
    gyro_bias_sigma: float = 0.01
    accel_fault: Mapping[str, float] = field(default_factory=dict)  # start_s, end_s, ramp_s, size_m_s2, wander_m_s2
    outlier_share: float = 0.0
    outlier_m: float = 3.0
    shadow_s: tuple[float, float] = (0.0, 0.0)  # reflected UWB: between these instants, too long by shadow_m
    shadow_m: float = 2.0
    anchors: Mapping[str, tuple[float, float, float]] = field(default_factory=lambda: ANCHORS)


def motion(scene: Scene, t: Array) -> Motion:
    """Smooth curve that starts at rest; after ``still_s`` it speeds up within two seconds."""
    size, rate = np.array(scene.size_m), np.array(scene.rate_rad_s)

    def position(s: Array) -> Array:
        moved = np.maximum(s - scene.still_s, 0.0)
        ramp = 1.0 - np.exp(-((moved / 1.5) ** 3))
        return np.array([0.0, 0.0, 1.5]) + ramp[:, None] * size * np.sin(np.outer(moved, rate))

    h = 1e-3
    back, here, ahead = position(t - h), position(t), position(t + h)
    velocity, accel = (ahead - back) / (2 * h), (ahead - 2 * here + back) / h**2
    attitude = _attitude(accel, scene.yaw_rate_rad_s * t)
    rate_of = []
    for shift in (-h, h):
        around = (position(t + shift + h) - 2 * position(t + shift) + position(t + shift - h)) / h**2
        rate_of.append(_attitude(around, scene.yaw_rate_rad_s * (t + shift)))
    turn = (rate_of[0].inv() * rate_of[1]).as_rotvec() / (2 * h)
    return Motion(t, here, velocity, accel, attitude, turn)


def _attitude(accel_W: Array, yaw: Array) -> Rotation:
    """Body z along the thrust, heading as given."""
    up = accel_W + UP
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    nose = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    left = np.cross(up, nose)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([np.cross(left, up), left, up], axis=2))


def fly(scene: Scene) -> MadeFlight:
    """Simulate a scene."""
    rng = np.random.default_rng(scene.seed)
    n = round(scene.duration_s * scene.imu_rate_hz) + 1
    truth = motion(scene, np.arange(n) / scene.imu_rate_hz)
    imu, gyro_bias, accel_bias = _imu(scene, truth, rng)
    tables = {"imu0": imu}
    for name in scene.sensors:
        tables[name] = SENSORS[name.rstrip("0123456789")](scene, rng)
    return MadeFlight(tables, make_config(scene, truth, rng), truth, gyro_bias, accel_bias)


def _imu(scene: Scene, truth: Motion, rng: np.random.Generator) -> tuple[Table, Array, Array]:
    n, dt = len(truth.t), 1.0 / scene.imu_rate_hz
    force = truth.attitude.inv().apply(truth.accel_m_s2 + UP)
    gyro_bias = rng.normal(0, scene.gyro_bias_sigma, 3) + GYRO_WALK * np.sqrt(dt) * _walk(rng, n)
    accel_bias = rng.normal(0, scene.accel_bias_sigma, 3) + ACCEL_WALK * np.sqrt(dt) * _walk(rng, n)
    gyro = truth.rate_rad_s + gyro_bias + rng.normal(0, GYRO_DENSITY / np.sqrt(dt), (n, 3))
    accel = force + accel_bias + rng.normal(0, ACCEL_DENSITY / np.sqrt(dt), (n, 3))
    if scene.accel_fault:
        accel[:, 0] += _fault(truth.t, rng, **scene.accel_fault)
    columns = {"gyro_rad_s": gyro, "accel_m_s2": accel}
    return Table(stamps(truth.t), columns), gyro_bias, accel_bias


def _walk(rng: np.random.Generator, n: int) -> Array:
    steps = rng.normal(size=(n, 3))
    steps[0] = 0.0
    return np.cumsum(steps, axis=0)


def _fault(
    t: Array,
    rng: np.random.Generator,
    start_s: float,
    end_s: float,
    ramp_s: float,
    size_m_s2: float,
    wander_m_s2: float,
) -> Array:
    """An error that grows over ``ramp_s``, then wanders with a time constant of 2 s, until it is gone again."""
    keep = np.exp(-(t[1] - t[0]) / 2.0)
    wander = np.zeros(len(t))
    for k in range(1, len(t)):
        wander[k] = keep * wander[k - 1] + np.sqrt(1 - keep**2) * wander_m_s2 * rng.normal()
    return np.clip((t - start_s) / ramp_s, 0.0, 1.0) * (t < end_s) * (size_m_s2 + wander)


def stamps(t: Array) -> NDArray[np.int64]:
    """Seconds of the flight as stamps [ns]."""
    return START_NS + np.round(t * 1e9).astype(np.int64)


def _instants(scene: Scene, rate_hz: float, phase: float) -> Array:
    return (phase + np.arange(int((scene.duration_s - 0.1) * rate_hz))) / rate_hz


def _range(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, 30.0, 0.31))
    tilt = at.attitude.as_matrix()[:, 2, 2]
    distance = at.position_m[:, 2] / tilt + rng.normal(0, SIGMA["range"], len(at.t))
    return Table(stamps(at.t), {"range_m": np.maximum(distance, 0.0)})


def _flow(scene: Scene, rng: np.random.Generator) -> Table:
    """Whole pixels, as a flow chip gives them; the stamp is the middle of the window."""
    at = motion(scene, _instants(scene, 50.0, 0.57))
    R = at.attitude.as_matrix()
    distance = at.position_m[:, 2] / R[:, 2, 2]
    v_S = at.attitude.inv().apply(at.velocity_m_s) @ np.array(DOWN_BS)
    w_S = at.rate_rad_s @ np.array(DOWN_BS)
    gain = FOCAL_PX * WINDOW_S
    dx = -gain * (v_S[:, 0] / distance + w_S[:, 1])
    dy = -gain * (v_S[:, 1] / distance - w_S[:, 0])
    noisy = np.stack([dx, dy], axis=1) + rng.normal(0, np.sqrt(SIGMA["flow"] ** 2 - 1 / 12), (len(dx), 2))
    whole = np.round(noisy)
    columns = {"window_s": np.full(len(dx), WINDOW_S), "dx_px": whole[:, 0], "dy_px": whole[:, 1]}
    return Table(stamps(at.t), columns)


def _antenna(at: Motion) -> Array:
    return at.position_m + at.attitude.apply(LEVER)


def _wrong(scene: Scene, t: Array, rng: np.random.Generator) -> Array:
    """What outliers and reflections add [m]."""
    outlier = rng.random(len(t)) < scene.outlier_share
    shadow = (t >= scene.shadow_s[0]) & (t < scene.shadow_s[1])
    return outlier * scene.outlier_m + shadow * scene.shadow_m * (1.0 + 0.3 * rng.normal(size=len(t)))


def _uwb(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, scene.uwb_rate_hz, 0.43))
    anchors = np.array(list(scene.anchors.values()))
    a = np.arange(len(at.t)) % len(anchors)
    distance = np.linalg.norm(_antenna(at) - anchors[a], axis=1)
    noise = rng.normal(0, SIGMA["uwb"], len(a)) + _wrong(scene, at.t, rng)
    return Table(stamps(at.t), {"anchor": a, "range_m": np.maximum(distance + noise, 0.01)})


def _tdoa(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, scene.uwb_rate_hz, 0.43))
    anchors = np.array(list(scene.anchors.values()))
    a = np.arange(len(at.t)) % len(anchors)
    b = (a + 1) % len(anchors)
    antenna = _antenna(at)
    difference = np.linalg.norm(antenna - anchors[b], axis=1) - np.linalg.norm(antenna - anchors[a], axis=1)
    noise = rng.normal(0, SIGMA["tdoa"], len(a)) + _wrong(scene, at.t, rng)
    return Table(stamps(at.t), {"anchor_a": a, "anchor_b": b, "difference_m": difference + noise})


def _fix(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, scene.uwb_rate_hz, 0.43))
    wrong = _wrong(scene, at.t, rng)[:, None] * [1.0, 0.0, 0.0]
    return Table(stamps(at.t), {"position_m": _antenna(at) + rng.normal(0, SIGMA["fix"], (len(at.t), 3)) + wrong})


def _baro(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, 10.0, 0.77))
    return Table(stamps(at.t), {"height_m": 120.0 + at.position_m[:, 2] + rng.normal(0, SIGMA["baro"], len(at.t))})


def _autopilot(scene: Scene, rng: np.random.Generator) -> Table:
    at = motion(scene, _instants(scene, 20.0, 0.13))
    up = at.attitude.as_matrix()[:, 2, :]
    noise = rng.normal(0, SIGMA["attitude"], (len(at.t), 2))
    roll, pitch = np.arctan2(up[:, 1], up[:, 2]) + noise[:, 0], np.arcsin(up[:, 0]) + noise[:, 1]
    return Table(stamps(at.t), {"roll_rad": roll, "pitch_rad": pitch, "yaw_rad": np.zeros(len(at.t))})


SENSORS: dict[str, Callable[[Scene, np.random.Generator], Table]] = {
    "range": _range, "flow": _flow, "uwb": _uwb, "tdoa": _tdoa, "fix": _fix, "baro": _baro, "attitude": _autopilot,
}  # fmt: skip


def transform(rotation=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), lever=(0.0, 0.0, 0.0)) -> tuple[float, ...]:
    """Row-major 4x4 of a rotation and a lever arm."""
    return (*(v for row, at in zip(rotation, lever, strict=True) for v in (*row, at)), 0.0, 0.0, 0.0, 1.0)


def describe(name: str, scene: Scene) -> AnySensor:
    """Rig of a simulated sensor, noise as simulated."""
    anchors = dict(scene.anchors)
    down = transform(DOWN_BS)
    # the filter takes the rotation out with the gyro's mean over the window
    flow_sigma = float(np.hypot(SIGMA["flow"], FOCAL_PX * GYRO_DENSITY * np.sqrt(WINDOW_S)))
    specs: dict[str, AnySensor] = {
        "imu": Imu(
            gyro_noise_density=GYRO_DENSITY,
            gyro_bias_walk=GYRO_WALK,
            accel_noise_density=ACCEL_DENSITY,
            accel_bias_walk=ACCEL_WALK,
        ),
        "range": RangeFinder(T_BS=down, surface="floor", sigma_m=SIGMA["range"]),
        "flow": Flow(T_BS=down, surface="floor", focal_px=(FOCAL_PX, FOCAL_PX), sigma_px=flow_sigma),
        "uwb": Uwb(T_BS=transform(lever=LEVER), measurement="range", anchors=anchors, sigma_m=SIGMA["uwb"]),
        "tdoa": Uwb(T_BS=transform(lever=LEVER), measurement="tdoa", anchors=anchors, sigma_m=SIGMA["tdoa"]),
        "fix": Uwb(T_BS=transform(lever=LEVER), measurement="position", sigma_m=SIGMA["fix"]),
        "baro": Barometer(sigma_m=SIGMA["baro"]),
        "attitude": AttitudeSource(sigma_rad=SIGMA["attitude"]),
    }
    return specs[name.rstrip("0123456789")]


def make_config(scene: Scene, truth: Motion, rng: np.random.Generator) -> Config:
    """What a careful user would write: the rig, the noise as simulated, and a first state as wrong as it says."""
    position = truth.position_m[0] + rng.normal(0, 0.1, 3)
    velocity = truth.velocity_m_s[0] + rng.normal(0, 0.1, 3)
    yaw = truth.attitude[0].as_euler("ZYX")[0] + rng.normal(0, 0.05)
    x, y, z = position.tolist()
    return Config(
        initial=Initial(position_m=(x, y, z), velocity_m_s=tuple(velocity.tolist()), yaw_rad=float(yaw)),
        surface={"floor": Surface(normal=(0.0, 0.0, 1.0))},
        sensor={name: describe(name, scene) for name in ("imu0", *scene.sensors)},
    )


NEVER = 1.0 - 1e-15  # share of readings that pass a gate which is as good as removed


def textbook(config: Config) -> Config:
    """The plain extended Kalman filter: no redescending weights, readings independent, everything believed."""
    change = msgspec.structs.replace
    wide = Gate(probability=NEVER, soft_sigma=1e9)
    slow = ("height", "attitude")
    return change(
        config,
        uwb=UwbTuning(
            bias_sigma_m=0.0,
            range_bias_sigma_m=0.0,
            correlation_time_s=0.0,
            sigma_m=0.01,
            range_sigma_m=0.01,
            fix_sigma_m=0.01,
            gate=wide,
        ),
        imu=ImuTuning(accel_noise_scale=1.0, gyro_noise_scale=1.0, jolt_time_s=0.0, shaken_walk=0.0),
        **{name: change(getattr(config, name), gate=wide) for name in ("flow", "range")},
        **{name: change(getattr(config, name), gate=wide, correlation_time_s=0.0) for name in slow},
        imu_fault=change(config.imu_fault, enabled=False),
        supervisor=change(config.supervisor, enabled=False),
    )
