"""Rows of the fusion bench that take a flight without end or a stream that comes late."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec
import numpy as np

from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.readings import ImuSample, Reading
from tests.bench.endless import LAP_S, endless
from tests.fusion.made_flights import START_NS, MadeFlight, Scene, fly
from tests.fusion.made_readings import readings

GROWTH_HEAD = ("length of the flight", "inertial samples and updates", "kernel [s]", "[us/step]")
SOAK_HEAD = (
    "hours at 1 kHz",
    "steps",
    "[us/step] first tenth",
    "[us/step] last tenth",
    "memory [MB] first lap",
    "last lap",
    "asymmetry",
    "least eigenvalue",
)
DELAY_HEAD = ("UWB, seed", "velocity RMSE [m/s]", "against on time")
LATE_NS = 350_000_000
SETTLED_S = 5.0


def growth_rows(hours: Sequence[float]) -> Iterator[list[str]]:
    """Kernel time of flights of some hours at 200 Hz with as many updates as samples."""
    for length in hours:
        laps = list(endless(200.0, max(round(length * 3600 / LAP_S), 1)))
        steps, seconds = sum(lap.steps for lap in laps), sum(lap.seconds for lap in laps)
        yield [f"{length:g} h", f"{steps}", f"{seconds:.2f}", f"{1e6 * seconds / steps:.2f}"]


def soak_row(hours: float) -> list[str]:
    """One long flight at 1 kHz with a range finder good to 1 mm: both ends, and the worst covariance."""
    laps = max(round(hours * 3600 / LAP_S), 3)
    tenth = -(-laps // 10)
    first, last, worst, least, steps, memory, peak = [], [], 0.0, np.inf, 0, 0.0, 0.0
    for number, lap in enumerate(endless(1000.0, laps)):
        steps += lap.steps
        worst, least, peak = max(worst, lap.asymmetry()), min(least, lap.least_eigenvalue()), lap.peak_mb
        if number == 1:
            memory = lap.peak_mb
        if 0 < number <= tenth:  # in the first lap the kernel may be compiled
            first.append(lap.seconds / lap.steps)
        if number >= laps - tenth:
            last.append(lap.seconds / lap.steps)
    speeds = (f"{1e6 * float(np.median(part)):.2f}" for part in (first, last))
    return [f"{hours:g}", f"{steps}", *speeds, f"{memory:.0f}", f"{peak:.0f}", f"{worst:.1e}", f"{least:.2g}"]


def delay_rows(seeds: Sequence[int], duration_s: float = 40.0) -> Iterator[list[str]]:
    """Velocity as it is known when an inertial sample comes, with the UWB 0.35 s behind."""
    for seed in seeds:
        flight = fly(Scene(seed=seed, duration_s=duration_s, sensors=("flow0", "range0", "fix0")))
        stream = readings(flight)
        on_time = live_rmse(flight, stream)
        yield [f"on time, seed {seed}", f"{on_time:.4f}", "1.00"]
        behind = sorted(stream, key=lambda r: r.t_ns + (LATE_NS if r.sensor == "fix0" else 0))
        for name, order in (
            ("its own stamps", behind),
            ("stamped on arrival", stamped_on_arrival(behind)),
        ):
            rmse = live_rmse(flight, order)
            yield [f"0.35 s late, {name}, seed {seed}", f"{rmse:.4f}", f"{rmse / on_time:.2f}"]


def stamped_on_arrival(stream: Sequence[Reading]) -> list[Reading]:
    """The same arrivals, but the UWB says that it was measured just then."""
    return [msgspec.structs.replace(r, t_ns=r.t_ns + LATE_NS) if r.sensor == "fix0" else r for r in stream]


def live_rmse(flight: MadeFlight, order: Sequence[Reading]) -> float:
    """Root mean square of the velocity's error, asked for at every tenth inertial sample as it comes."""
    estimator = CorridorEstimator(flight.config)
    squares, seen = [], 0
    for reading in order:
        estimator.push(reading)
        if isinstance(reading, ImuSample):
            seen += 1
            if seen % 10 == 0 and reading.t_ns > START_NS + SETTLED_S * 1e9:
                error = estimator.state().velocity_m_s - flight.truth.velocity_m_s[seen - 1]
                squares.append(float(error @ error) / 3.0)
    return float(np.sqrt(np.mean(squares)))
