"""Runs made from known numbers: a truth, an estimate that is wrong in a known way, and a log of verdicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Corridor, Initial
from axialnav.fusion.outcome import Health, InnovationLog, Reason, Track, Verdict
from axialnav.fusion.supervisor import SourceState
from axialnav.models.rig import Imu, RangeFinder, Surface, Uwb
from axialnav.models.state import N_ERROR
from axialnav.replay.flight import Flight, SensorTable, Truth
from axialnav.replay.fused import digest, fused_columns
from axialnav.replay.metrics import score
from axialnav.replay.run import Run

Array = NDArray[np.float64]
STEP_NS = 4_000_000
START_NS = 7_000_000_000
SIGMA_M_S = 0.05


def stamps(count: int) -> NDArray[np.int64]:
    return START_NS + STEP_NS * np.arange(count, dtype=np.int64)


def true_motion(t_ns: NDArray[np.int64]) -> tuple[Array, Array]:
    """Position and velocity of a smooth three-dimensional curve."""
    s = (t_ns - START_NS)[:, None] * 1e-9
    rate, size = np.array([0.9, 0.7, 0.4]), np.array([2.0, 1.5, 0.5])
    return size * np.sin(rate * s + [0.0, 0.5, 1.0]), size * rate * np.cos(rate * s + [0.0, 0.5, 1.0])


def correlated_noise(count: int, samples: float, rng: np.random.Generator) -> Array:
    """Stationary first-order noise of unit variance, shape (count, 3), that forgets within ``samples`` steps."""
    keep = float(np.exp(-1.0 / samples))
    noise = rng.normal(size=(count, 3)) * np.sqrt(1.0 - keep * keep)
    noise[0] = rng.normal(size=3)
    for i in range(1, count):
        noise[i] += keep * noise[i - 1]
    return noise


def make_truth(count: int = 5000, step_ns: int = 10_000_000) -> Truth:
    t_ns = START_NS + step_ns * np.arange(count * STEP_NS // step_ns, dtype=np.int64)
    position, velocity = true_motion(t_ns)
    return Truth(t_ns, position, np.tile([1.0, 0.0, 0.0, 0.0], (t_ns.size, 1)), velocity)


def make_track(velocity_error: Array, position_error: Array | None = None, sigma_m_s: float = SIGMA_M_S) -> Track:
    """Truth plus the given errors; the stated velocity covariance is isotropic."""
    count = velocity_error.shape[0]
    t_ns = stamps(count)
    position, velocity = true_motion(t_ns)
    zeros = np.zeros((count, 3))
    return Track(
        t_ns=t_ns,
        position_m=position + (zeros if position_error is None else position_error),
        velocity_m_s=velocity + velocity_error,
        quaternion_WB=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        gyro_bias_rad_s=zeros,
        accel_bias_m_s2=zeros,
        blur_scale=np.zeros(count),
        uwb_bias_m=np.zeros((count, 8)),
        wall_offset_m=np.zeros(count),
        position_covariance=np.tile(0.01 * np.eye(3), (count, 1, 1)),
        velocity_covariance=np.tile(sigma_m_s**2 * np.eye(3), (count, 1, 1)),
        sigma_error=np.full((count, N_ERROR), 0.01),
        flags=np.zeros(count, dtype=np.int64),
        resets=np.zeros(count, dtype=np.int64),
        source_states=np.full((count, 2), int(SourceState.OK), dtype=np.int8),
    )


def make_config(*, initial: bool = True, corridor: Corridor | None = None) -> Config:
    return Config(
        corridor=corridor or Corridor(axis=(1.0, 0.0, 0.0)),
        initial=Initial(position_m=(0.0, 0.0, 0.0)) if initial else None,
        surface={"floor": Surface(normal=(0.0, 0.0, 1.0))},
        sensor={
            "imu0": Imu(rate_hz=250.0),
            "tof0": RangeFinder(surface="floor"),
            "uwb0": Uwb(measurement="range", anchors={"a": (5.0, 0.0, 1.0), "b": (0.0, 5.0, 1.0)}),
        },
    )


def make_log(t_ns: NDArray[np.int64], rng: np.random.Generator, *, gated: float = 0.1) -> InnovationLog:
    """Every tenth stamp a ToF reading, every fifth a UWB range; a share of the ranges 30 sigma off and gated."""
    stamp = np.concatenate((t_ns[::10], t_ns[::5]))
    source = np.concatenate((np.zeros(t_ns[::10].size, np.int64), np.ones(t_ns[::5].size, np.int64)))
    order = np.argsort(stamp, kind="stable")
    stamp, source = stamp[order], source[order]
    normalised = np.clip(rng.normal(size=stamp.size), -3.2, 3.2)
    wild = (source == 1) & (rng.uniform(size=stamp.size) < gated)
    normalised[wild] = 30.0
    innovation, variance = np.full((stamp.size, 3), np.nan), np.full((stamp.size, 3), np.nan)
    innovation[:, 0], variance[:, 0] = 0.1 * normalised, 0.01
    verdict = np.where(wild, int(Verdict.GATED), int(Verdict.FUSED))
    return InnovationLog(
        sensors=("tof0", "uwb0"),
        t_ns=stamp,
        source=source,
        verdict=verdict,
        reason=np.where(wild, int(Reason.INNOVATION), int(Reason.NONE)),
        dof=np.ones(stamp.size, np.int64),
        innovation=innovation,
        variance=variance,
        nis=normalised**2,
        gate=np.full(stamp.size, 10.83),
        weight=np.where(wild, 0.0, 1.0),
    )


def make_flight(track: Track, log: InnovationLog, config: Config, truth: Truth | None, **extra: object) -> Flight:
    tables = {"imu0": SensorTable(track.t_ns, {"gyro_rad_s": np.zeros((track.t_ns.size, 3))})}
    for index, name in enumerate(log.sensors):
        rows = log.source == index
        tables[name] = SensorTable(log.t_ns[rows], {"range_m": np.ones(int(rows.sum()))})
    options = {"evaluation": (1.0, 15.0), **extra}
    return Flight("made", Path("made"), {"source": "made by a test"}, config, tables, truth, **options)  # type: ignore[arg-type]


def make_run(
    seed: int = 0, count: int = 5000, *, truth: bool = True, initial: bool = True, corridor: Corridor | None = None
) -> Run:
    """A whole run: honest correlated errors, 10 % of the ranges gated, one reset, some dead reckoning."""
    rng = np.random.default_rng(seed)
    track = make_track(SIGMA_M_S * correlated_noise(count, 50.0, rng))
    track.flags[3000:3400] |= int(Health.DEAD_RECKONING)
    track.resets[3400:] = 1
    track.source_states[3000:3300, 1] = int(SourceState.SUSPECT)
    track.source_states[3300:3400, 1] = int(SourceState.REACQUIRE)
    log = make_log(track.t_ns, rng)
    config = make_config(initial=initial, corridor=corridor)
    flight = make_flight(track, log, config, make_truth(count) if truth else None)
    columns = fused_columns(track, config.corridor)
    head = {"flight": "made", "estimator": "corridor", "digest": digest(columns)}
    timing = {"wall_s": 0.5, "compiled_s": 0.0, "flight_s": 20.0, "real_time_factor": 40.0, "kernel_us_per_imu": 0.5}
    metrics = {**head, **score(track, log, flight, config), "timing": timing}
    return Run(flight, config, track, log, columns, metrics)
