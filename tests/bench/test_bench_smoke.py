"""The benches run on the flight that ships with the package, so that they cannot rot between two uses."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from axialnav.replay.flight import load_flight
from axialnav.replay.sample_flights import sample_flight_path
from tests.bench import bench_fusion
from tests.bench.bench_flights import tables
from tests.bench.flights import DEFAULT, PLAIN, Case
from tests.bench.handheld import floor_table
from tests.bench.slider import slider_table
from tests.bench.slider_scene import ripple

SAMPLE = sample_flight_path()


def cells(text: str, start: str) -> list[list[str]]:
    """Cells of the table rows whose first cell starts so."""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]
    return [row for row in rows if row[0].startswith(start)]


def test_the_flight_tables_show_a_limit_that_is_kept_and_one_that_is_not() -> None:
    cases = (Case(SAMPLE.name, speed_m_s=0.5), Case(SAMPLE.name, ("tof0",), speed_m_s=1e-6))
    text = tables(cases, SAMPLE.parent, {"default": DEFAULT, "plain": PLAIN})
    kept, missed = (row for row in cells(text, SAMPLE.name) if len(row) == 13)
    assert kept[-1] == "ok"
    assert missed[0] == f"{SAMPLE.name} without tof0"
    assert missed[-1] == "SHORT: speed"
    compared = [row for row in cells(text, SAMPLE.name) if len(row) == 5]
    assert [bool(re.fullmatch(r"\d+\.\d{3}", value)) for row in compared for value in row[1:]] == [True] * 8


def test_recordings_that_are_not_there_are_named(tmp_path: Path) -> None:
    assert tables((Case("nowhere"),), tmp_path) == f"skipped: nowhere is not in {tmp_path}"
    assert floor_table(tmp_path) == f"skipped: frames_240fps is not in {tmp_path}"
    assert slider_table(tmp_path) == f"skipped: davis_slider_far is not in {tmp_path}"


def test_a_ripple_of_the_slider_is_told_by_its_other_turns_and_noise_is_not() -> None:
    frame, noise = np.arange(120.0), np.random.default_rng(1).normal(0.0, 0.01, (2, 120))
    kick = 0.08 * np.exp(-0.5 * (((frame % 8.8) - 4.0) / 0.8) ** 2)
    period, told = ripple(kick - kick.mean() + noise[0])
    assert period == pytest.approx(8.8, abs=0.05)
    assert np.var(kick - told) < 0.2 * np.var(kick)
    assert np.var(noise[1] - ripple(noise[1])[1]) > 0.8 * np.var(noise[1])


def test_the_speed_tables_have_a_positive_time_in_every_row() -> None:
    whole, growth, soak, late, single = bench_fusion.tables(
        [load_flight(SAMPLE)], SAMPLE, count=200, pushed=300, hours=(0.02, 0.04), soak_h=0.02, seeds=(1,)
    )
    (flight,) = cells(whole, SAMPLE.name)
    assert int(flight[2]) > int(flight[1]) > 4000  # more scalar updates than readings
    short, twice = cells(growth, "0.0")
    assert int(twice[1]) == 2 * int(short[1])
    (soaked,) = cells(soak, "0.02")
    assert float(soaked[6]) < 1e-12
    assert float(soaked[7]) > -1e-9
    on_time, own_stamps, arrival = (float(row[2]) for row in cells(late, "on time") + cells(late, "0.35"))
    assert (on_time, own_stamps < 1.1 < arrival) == (1.0, True)
    steps = [*cells(single, "kernel"), *cells(single, "filterpy"), *cells(single, "CorridorEstimator.push")]
    assert len(steps) == 7
    for row in [*steps, flight[:1] + flight[3:6]]:
        assert all(float(value) > 0.0 for value in row[1:4])
