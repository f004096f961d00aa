"""Calibration: errors that were put into a flight are found, and nothing is found where there is none."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.rehearsal import Rehearsal
from axialnav.replay import cli
from axialnav.replay.calibration.calibrate import Calibration, calibrate, calibrated_config
from axialnav.replay.calibration.calibrate_table import summary
from axialnav.replay.calibration.delays import find_delays
from axialnav.replay.calibration.line import fit_line
from axialnav.replay.flight import Flight
from axialnav.replay.flight_writer import write_flight
from axialnav.replay.tuning.cost import Subject
from tests.replay.made_recordings import flown

LATE_S, FLOW_LATE_S, LONG_M, FOCAL = 0.35, 0.06, 0.03, 1.04


def late_uwb(flight: Flight) -> Flight:
    """UWB stamped 0.35 s late."""
    uwb = flight.tables["uwb0"]
    late = dataclasses.replace(uwb, t_ns=uwb.t_ns + round(LATE_S * 1e9))
    return dataclasses.replace(flight, tables={**flight.tables, "uwb0": late})


def wrong(flight: Flight) -> Flight:
    """Ranges too long, images as of a longer lens."""
    tables = dict(flight.tables)
    ranges, flow = tables["range0"], tables["flow0"]
    tables["range0"] = dataclasses.replace(ranges, columns={"range_m": ranges.columns["range_m"] + LONG_M})
    scaled = {name: flow.columns[name] * FOCAL for name in ("dx_px", "dy_px")}
    tables["flow0"] = dataclasses.replace(flow, columns={**flow.columns, **scaled})
    return dataclasses.replace(flight, tables=tables)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return wrong(flown(1, 30.0))


@pytest.fixture(scope="module")
def found(flight: Flight) -> Calibration:
    return calibrate(flight, workers=1)


@pytest.mark.slow
def test_late_stamps_are_found_within_20_ms() -> None:
    flight = late_uwb(flown(1, 40.0))
    delays = find_delays(Subject("late", flight.config, Rehearsal(flight.config, flight.tables)), 1)
    late = {delay.sensor: delay for delay in delays}
    assert late["uwb0"].late_s == pytest.approx(LATE_S, abs=0.02)
    assert late["uwb0"].gain_nats > 100.0
    assert abs(late["flow0"].late_s) < 0.02


@pytest.mark.slow
def test_two_delays_are_found_behind_reflections_and_other_faults() -> None:
    """UWB 0.35 s and image motion 0.06 s late, 8 % of the ranges 3 m too long, lens and range finder wrong."""
    flight = wrong(late_uwb(flown(2, 40.0, outlier_share=0.08)))
    flow = flight.tables["flow0"]
    late_flow = dataclasses.replace(flow, t_ns=flow.t_ns + round(FLOW_LATE_S * 1e9))
    flight = dataclasses.replace(flight, tables={**flight.tables, "flow0": late_flow})
    delays = find_delays(Subject("late", flight.config, Rehearsal(flight.config, flight.tables)), 1)
    late = {delay.sensor: delay for delay in delays}
    assert late["uwb0"].late_s == pytest.approx(LATE_S, abs=0.02)
    assert late["flow0"].late_s == pytest.approx(FLOW_LATE_S, abs=0.02)
    assert late["range0"].gain_nats == 0.0  # was right and stays where it was
    for found in late.values():
        assert found.sigma_s is None or 0.0005 < found.sigma_s < 0.1


@pytest.mark.slow
def test_focal_length_and_range_offset_are_found(found: Calibration) -> None:
    (image,), (offset,) = found.images, found.ranges
    assert image.focal_px == pytest.approx(350.0 * FOCAL, abs=4.0 * image.sigma_focal_px)
    assert image.sigma_focal_px < 5.0
    assert offset.offset_m == pytest.approx(LONG_M, abs=max(4.0 * offset.sigma_m, 0.002))
    assert image.paper is not None
    assert image.paper.slope == pytest.approx(image.expected_slope, rel=0.25)


@pytest.mark.slow
def test_what_is_written_takes_the_errors_out(flight: Flight, found: Calibration) -> None:
    config = Config.from_dict(calibrated_config(None, flight, found))
    again = calibrate(flight, config, workers=1)
    assert again.images[0].scale.slope == pytest.approx(1.0, abs=0.015)
    assert abs(again.ranges[0].offset_m) < 0.002
    text = summary([found, again])
    assert "mean" in text
    assert "uwb0" in text


def test_a_line_with_outliers_and_its_errors() -> None:
    rng = np.random.default_rng(3)
    slopes, sigmas = [], []
    for _ in range(200):
        x = rng.uniform(0, 10, 150)
        y = 0.5 + 2.0 * x + rng.normal(0, 0.3, 150)
        y[::25] += 40.0
        line = fit_line(x, y)
        assert line is not None
        assert line.used in range(140, 145)
        slopes.append(line.slope)
        sigmas.append(line.sigma_slope)
    assert np.mean(slopes) == pytest.approx(2.0, abs=4 * np.std(slopes) / np.sqrt(200))
    assert np.std(slopes) / np.mean(sigmas) == pytest.approx(1.0, abs=0.2)


def test_a_line_needs_points_that_differ() -> None:
    assert fit_line(np.arange(10.0), np.arange(10.0)) is None
    assert fit_line(np.ones(50), np.arange(50.0)) is None
    assert fit_line(np.full(50, np.nan), np.arange(50.0)) is None


def test_the_verb_writes_a_file_for_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_flight(flown(2, 12.0), tmp_path / "flight")
    out = tmp_path / "calibrated.toml"
    assert cli.main(["calibrate", str(folder), "--out", str(out), "--workers", "1"]) == 0
    assert "range0: reads" in capsys.readouterr().out
    assert isinstance(Config.from_toml(out), Config)
    assert cli.main(["calibrate"]) == 2
    assert cli.main(["calibrate", str(tmp_path / "none")]) == 3
    assert cli.main(["calibrate", str(folder), "--config", str(out), "--out", str(out)]) == 2
