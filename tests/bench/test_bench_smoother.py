"""The smoother's bench runs on the flight that ships with the package."""

from __future__ import annotations

from axialnav.replay.flight import load_flight
from axialnav.replay.sample_flights import sample_flight_path
from tests.bench.bench_smoother import GAIN_HEAD, TIME_HEAD, gain_rows, smoother_rows


def test_the_tables_are_filled() -> None:
    flight = load_flight(sample_flight_path())
    times, gains = list(smoother_rows(flight, repeats=1)), list(gain_rows([(flight, ())]))
    assert [len(row) for row in times] == [len(TIME_HEAD)] * 3
    assert float(times[0][1]) > 0.0
    assert [len(row) for row in gains] == [len(GAIN_HEAD)]
    assert gains[0][1] != gains[0][2]
