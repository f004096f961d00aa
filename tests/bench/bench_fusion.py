"""Speed of the filter: ``python -m tests.bench.bench_fusion`` (``make bench-fusion``)."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.readings import ImuSample, Reading
from axialnav.fusion.sources import Kind
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.sample_flights import sample_flight_path
from tests.bench.flights import CASES, FLIGHTS, OBSTACLES
from tests.bench.fusion_rows import DELAY_HEAD, GROWTH_HEAD, SOAK_HEAD, delay_rows, growth_rows, soak_row
from tests.bench.markdown import machine, table
from tests.bench.prepared import Prepared, halfway, one_kind, prepare
from tests.bench.process_bench import HEAD as PROCESS_HEAD
from tests.bench.process_bench import process_rows
from tests.bench.timing import median_of
from tests.fusion.made_readings import known_ns

REPEATS = 5
PUSH_REPEATS = 15  # they are short: three that all met a busy neighbour once read half as much again
KERNEL_HEAD = (
    "flight",
    "events",
    "steps",
    "wall [us/step]",
    "processor [us/step]",
    "least [us/step]",
    "times real time",
    "asked [us]",
)
STEP_HEAD = ("step", "wall [us]", "processor [us]", "least [us]")
ASKED_US = 0.6
STEPS = 20_000
PUSHED = 20_000
LATE_NS = 100_000_000


def kernel_rows(flights: Sequence[Flight], repeats: int = REPEATS) -> Iterator[list[str]]:
    """Kernel time of whole flights; a step is an inertial sample or a scalar update."""
    for flight in flights:
        prepared = prepare(flight)
        steps = prepared.steps()
        spent = median_of(repeats, prepared.run, prepared.buffers)
        stamps = prepared.events.t_ns
        real_time = float(stamps[-1] - stamps[0]) * 1e-9 / spent.wall_s
        name, events = flight.name, f"{len(stamps)}"
        yield [name, events, f"{steps}", *spent.per(steps), f"{real_time:.0f}", f"<= {ASKED_US}"]


def kernel_step_rows(prepared: Prepared, count: int = STEPS) -> Iterator[list[str]]:
    """One kind of event alone, with its bookkeeping, log and track row."""
    names = {
        Kind.IMU: "kernel: propagate one inertial sample",
        Kind.UWB_TDOA: "kernel: one scalar update, UWB range difference",
        Kind.UWB_RANGE: "kernel: one scalar update, UWB range",
        Kind.RANGE: "kernel: one scalar update, range finder",
        Kind.FLOW: "kernel: one two-axis update, image motion",
    }
    midair = halfway(prepared)
    there = set(prepared.sources["kind"].tolist())
    for kind, name in names.items():
        if int(kind) in there:
            only = midair.with_events(one_kind(midair, kind, count))
            assert kind == Kind.IMU or only.fused() == count, name
            yield [name, *median_of(REPEATS, only.run, only.buffers).per(count)]


def filterpy_rows(count: int) -> Iterator[list[str]]:
    """The same two steps in filterpy's extended filter of 25 states."""
    from filterpy.kalman import ExtendedKalmanFilter

    def fresh() -> ExtendedKalmanFilter:
        ekf = ExtendedKalmanFilter(dim_x=25, dim_z=1)
        ekf.F, ekf.Q, ekf.R = np.eye(25) + np.eye(25, k=3) * 0.004, np.eye(25) * 1e-6, np.eye(1) * 0.02
        return ekf

    H, z = np.zeros((1, 25)), np.zeros(1)
    H[0, [0, 1, 2, 6, 7, 8, 16]] = 0.5
    actions: dict[str, Callable[[ExtendedKalmanFilter], None]] = {
        "filterpy: predict, 25 states": lambda ekf: ekf.predict(),
        "filterpy: scalar update, 25 states": lambda ekf: ekf.update(z, lambda x: H, lambda x: H @ x),
    }
    for name, action in actions.items():

        def many(ekf: ExtendedKalmanFilter, action: Callable[[ExtendedKalmanFilter], None] = action) -> None:
            for _ in range(count):
                action(ekf)

        yield [name, *median_of(REPEATS, many, fresh).per(count)]


def push_rows(flight: Flight, count: int = PUSHED) -> Iterator[list[str]]:
    """The streaming estimator, reading by reading, in order and with everything but the IMU late by 0.1 s."""
    readings = sorted(islice(flight.readings(), count), key=known_ns)
    estimator = CorridorEstimator(flight.config)
    for reading in readings:  # what is not compiled yet is compiled here
        estimator.push(reading)
    late = sorted(readings, key=lambda r: known_ns(r) + (0 if isinstance(r, ImuSample) else LATE_NS))
    for name, order in (("in order", readings), ("aids 0.1 s late", late)):

        def push_all(estimator: CorridorEstimator, order: Sequence[Reading] = order) -> None:
            for reading in order:
                estimator.push(reading)

        spent = median_of(
            PUSH_REPEATS if order is readings else REPEATS, push_all, lambda: CorridorEstimator(flight.config)
        )
        yield [f"CorridorEstimator.push, {name}", *spent.per(len(order))]


def tables(
    flights: Sequence[Flight],
    main: Path,
    *,
    count: int = STEPS,
    pushed: int = PUSHED,
    hours: Sequence[float] = (1.0, 2.0, 4.0),
    soak_h: float = 24.0,
    seeds: Sequence[int] = (1, 2, 3),
) -> Iterator[str]:
    """All tables but that of processes; ``main`` is the folder of the flight that is looked at closely."""
    close = next(flight for flight in flights if flight.path == main)
    prepared = prepare(close)
    yield "Whole flights through the kernel:\n\n" + table(KERNEL_HEAD, kernel_rows(flights))
    yield "Growth, a simulated flight at 200 Hz:\n\n" + table(GROWTH_HEAD, growth_rows(hours))
    yield "Soak, the same at 1 kHz:\n\n" + table(SOAK_HEAD, [soak_row(soak_h)])
    yield "UWB that comes late, velocity as known at the time:\n\n" + table(DELAY_HEAD, delay_rows(seeds))
    steps = [*kernel_step_rows(prepared, count), *filterpy_rows(count // 10), *push_rows(close, pushed)]
    yield f"Single steps, {close.name}:\n\n" + table(STEP_HEAD, steps)


def main() -> None:
    """Print all tables; where the recordings are absent, those of the flight that ships with the package."""
    names = dict.fromkeys(case.flight for case in CASES)
    there = [FLIGHTS / name for name in names if (FLIGHTS / name / "mav0").is_dir()]
    for name in names:
        if FLIGHTS / name not in there:
            sys.stdout.write(f"skipped: {name} is not in {FLIGHTS}\n")
    folders = there or [sample_flight_path()]
    close = FLIGHTS / OBSTACLES if FLIGHTS / OBSTACLES in there else folders[0]
    sys.stdout.write(f"{machine()}; medians of {REPEATS}\n\n")
    for text in tables([load_flight(folder) for folder in folders], close):
        sys.stdout.write(text + "\n\n")
    sys.stdout.write("Processes:\n\n" + table(PROCESS_HEAD, process_rows(close)) + "\n")


if __name__ == "__main__":
    main()
