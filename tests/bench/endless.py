"""A flight without end: one closed loop of a simulated room, flown again and again, one lap of memory at a time."""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.config import Config
from axialnav.fusion.events import Events, pack_tables
from axialnav.fusion.kernels.run import run
from axialnav.fusion.memory import LOG_WIDTH, TRACK_WIDTH, build_settings, new_memory, new_scratch, whole_covariance
from axialnav.fusion.sources import Kind, build_sources
from axialnav.models.rig import RangeFinder
from tests.fusion.made_flights import Scene, Table, fly, motion, stamps

Array = NDArray[np.float64]
LAP_S = 20.0 * math.pi  # after which the curve of :class:`Scene` and its heading close
LEAD_S = 20.0  # from rest into the curve
RANGE_SIGMA_M = 1e-3


@dataclass(frozen=True)
class Lap:
    """Where the filter is after a lap, and what the lap cost."""

    steps: int
    seconds: float  # of processor time
    peak_mb: float
    x: Array
    P: Array

    def asymmetry(self) -> float:
        """Largest difference between the correlation matrix and its transpose."""
        correlation = self._correlation()
        return float(np.abs(correlation - correlation.T).max())

    def least_eigenvalue(self) -> float:
        """Smallest eigenvalue of the correlation matrix."""
        correlation = self._correlation()
        return float(np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min())

    def _correlation(self) -> Array:
        sigma = np.sqrt(np.diag(self.P))
        return self.P / np.outer(sigma, sigma)


def endless(imu_rate_hz: float, laps: int, seed: int = 17) -> Iterator[Lap]:
    """Fly ``laps`` laps with image motion, UWB, attitude and a range finder that is good to a millimetre."""
    scene = Scene(
        seed=seed,
        duration_s=LEAD_S + LAP_S + 0.1,
        imu_rate_hz=imu_rate_hz,
        sensors=("flow0", "tdoa0", "attitude0"),
        accel_bias_sigma=0.1,
    )
    config, events = _with_a_sharp_range_finder(scene)
    sources, settings, scratch = build_sources(config), build_settings(config), new_scratch()
    memory = new_memory(len(sources))
    align(config, sources, events, memory)
    first = int(np.searchsorted(events.t_ns, stamps(np.array([LEAD_S]))[0]))
    last = int(np.searchsorted(events.t_ns, stamps(np.array([LEAD_S + LAP_S]))[0]))
    track, log = np.zeros((len(events.t_ns), TRACK_WIDTH)), np.zeros((len(events.t_ns), LOG_WIDTH))

    def through(part: Events) -> None:
        log[: len(part.t_ns)] = 0.0
        run(*part, sources, memory.core, memory.sources, scratch, settings, track, log)

    through(events.part(slice(0, first)))
    lap = events.part(slice(first, last))
    inertial = int((sources["kind"][lap.source] == int(Kind.IMU)).sum())
    for number in range(laps):
        began = time.process_time()
        through(lap._replace(t_ns=lap.t_ns + number * round(LAP_S * 1e9)))
        spent = time.process_time() - began
        updates = int(np.maximum(log[: len(lap.t_ns), 0], 0.0).sum())
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        core = memory.core
        yield Lap(inertial + updates, spent, peak_mb, core["x"][0, 0].copy(), whole_covariance(core["P"][0, 0]))


def _with_a_sharp_range_finder(scene: Scene) -> tuple[Config, Events]:
    flight = fly(scene)
    seconds = np.arange(0.31 / 30, scene.duration_s - 0.1, 1 / 30)
    at = motion(scene, seconds)
    noise = np.random.default_rng(scene.seed).normal(0, RANGE_SIGMA_M, len(seconds))
    ranges = at.position_m[:, 2] / at.attitude.as_matrix()[:, 2, 2] + noise
    flight.tables["range0"] = Table(stamps(seconds), {"range_m": ranges})
    spec = RangeFinder(T_BS=flight.config.sensor["flow0"].T_BS, surface="floor", sigma_m=RANGE_SIGMA_M)
    config = Config(
        initial=flight.config.initial,
        surface=flight.config.surface,
        sensor={**flight.config.sensor, "range0": spec},
    )
    return config, pack_tables(config, flight.tables)
