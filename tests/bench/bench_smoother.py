"""Smoother: time per step and what it buys: ``python -m tests.bench.bench_smoother``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace

from axialnav.fusion.smoother import Pass
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.run import replay, resolve
from axialnav.replay.sample_flights import sample_flight_path
from tests.bench.flights import CASES, FLIGHTS
from tests.bench.markdown import machine, number, table
from tests.bench.timing import median_of

TIME_HEAD = ("step", "wall [us]", "processor [us]", "least [us]", "asked [us]")
GAIN_HEAD = ("flight", "filtered", "smoothed", "filtered, 3-D", "smoothed, 3-D", "NEES filtered", "NEES smoothed")
REPEATS = 3
ASKED_US = 10.0


def smoother_rows(flight: Flight, repeats: int = REPEATS) -> Iterator[list[str]]:
    """Time per inertial sample of the way forward, and of the way back with and without filtering again."""
    config = resolve(None, flight)
    start = Pass.begin(config, flight.tables_for(config))

    def fresh() -> Pass:
        return replace(start, cuts=start.cuts[:1], rows=start.rows.copy(), log=start.log.copy())

    def forwarded() -> Pass:
        pass_ = fresh()
        pass_.forward()
        return pass_

    warm = forwarded()
    warm.backward()
    forward = median_of(repeats, Pass.forward, fresh)
    back = median_of(repeats, Pass.backward, forwarded)
    again = median_of(repeats, lambda pass_: pass_.backward(smooth=False), forwarded)
    alone = type(back)(*(b - a for b, a in zip(back, again, strict=True)))
    yield [f"forward with cuts, {flight.name}", *forward.per(warm.steps), "-"]
    yield ["filter again and record", *again.per(warm.steps), "-"]
    yield ["one step back (Rauch-Tung-Striebel)", *alone.per(warm.steps), f"<= {ASKED_US:g}"]


def gain_rows(flights: Sequence[tuple[Flight, tuple[str, ...]]]) -> Iterator[list[str]]:
    """Axial velocity and 3-D position RMSE, and NEES of velocity, of filter and smoother."""
    for flight, without in flights:
        runs = [replay(flight, without=without, smooth=smooth).metrics for smooth in (False, True)]
        velocity = [m["axial_velocity_m_s"]["rmse"] or m["horizontal_speed_rmse_m_s"] for m in runs]
        label = flight.name + "".join(f" without {name}" for name in without)
        yield [
            label,
            *map(number, velocity),
            *(number(m["position_rmse_3d_m"]) for m in runs),
            *(number(m["nees_velocity"], 1) for m in runs),
        ]


def main() -> None:
    """Print both tables; where the recordings are absent, those of the flight that ships with the package."""
    there = [case for case in CASES if (FLIGHTS / case.flight / "mav0").is_dir()]
    loaded = {name: load_flight(FLIGHTS / name) for name in dict.fromkeys(case.flight for case in there)}
    sample = load_flight(sample_flight_path())
    flights = [(loaded[case.flight], case.without) for case in there] or [(sample, ())]
    sys.stdout.write(f"{machine()}; medians of {REPEATS}\n\n")
    sys.stdout.write(table(TIME_HEAD, smoother_rows(flights[0][0])) + "\n\n")
    sys.stdout.write("RMSE of axial velocity [m/s] (of speed where there is only GPS) and of position [m]:\n\n")
    sys.stdout.write(table(GAIN_HEAD, gain_rows(flights)) + "\n")


if __name__ == "__main__":
    main()
