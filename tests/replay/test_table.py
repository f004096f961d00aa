"""The printed summary: nothing scored without its coverage, nothing dropped without its name."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from axialnav.fusion.config import Config, Corridor, Section
from axialnav.replay.findings import findings, nees_verdict
from axialnav.replay.flight import Drop, SensorTable
from axialnav.replay.rates import sensor_rates
from axialnav.replay.run import Run
from axialnav.replay.settings import changed_settings
from axialnav.replay.table import aligned, summary
from tests.replay.made_runs import START_NS, make_config, make_run


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run()


def line(text: str, start: str) -> str:
    found = [row for row in text.splitlines() if row.startswith(start)]
    assert len(found) == 1, (start, text)
    return found[0]


def with_metrics(run: Run, **changes: object) -> Run:
    return dataclasses.replace(run, metrics={**copy.deepcopy(run.metrics), **changes})


def test_every_score_stands_beside_its_coverage(run: Run) -> None:
    assert "used 3 501/3 501 (100 %)" in line(run.table, "axial velocity")
    half = with_metrics(run, reference={"used": 1000, "available": 3501, "kind": "truth"})
    assert "used 1 000/3 501 (29 %)" in line(half.table, "axial velocity")


def test_without_truth_the_line_says_not_evaluated() -> None:
    assert "NOT_EVALUATED (no ground truth in the flight)" in line(make_run(truth=False).table, "axial velocity")


def test_alignment_is_named(run: Run) -> None:
    assert "rigid" not in run.table
    assert "after rigid alignment" in line(make_run(initial=False).table, "position")


def test_what_the_reader_dropped_is_printed(run: Run) -> None:
    flight = dataclasses.replace(run.flight, drops=(Drop("uwb0", "range is NaN", 12, "line 7: 1,2,nan"),))
    row = line(dataclasses.replace(run, flight=flight).table, "dropped")
    assert "uwb0: 12 x range is NaN (line 7: 1,2,nan)" in row


def test_changed_settings_are_printed_with_their_defaults(run: Run) -> None:
    assert line(run.table, "settings").endswith("defaults")
    changed = dataclasses.replace(run, config=run.config.with_params({"uwb.bias_sigma_m": "0.7"}))
    assert "1 differs from defaults: uwb.bias_sigma_m" in line(changed.table, "settings")
    assert line(changed.table, "settings").endswith("-> 0.7")


def test_a_sensor_that_was_switched_off_counts_as_a_changed_setting() -> None:
    config = make_config()
    flight_config = Config(
        sensor=config.sensor, surface=config.surface, corridor=config.corridor, initial=config.initial
    )
    assert changed_settings(config.without(("uwb0",)), flight_config) == [("disabled", "[]", "[uwb0]")]


def test_gaps_are_counted_and_the_longest_is_located(run: Run) -> None:
    t_ns = START_NS + np.concatenate((np.arange(0, 100), np.arange(200, 300), np.arange(340, 400))) * 50_000_000
    flight = dataclasses.replace(run.flight, tables={**run.flight.tables, "tof0": SensorTable(t_ns, {})})
    rate = next(r for r in sensor_rates(flight, START_NS) if r.name == "tof0")
    assert (rate.count, rate.gaps) == (260, 2)
    assert rate.longest_s == pytest.approx(5.05)
    assert rate.longest_at_s == pytest.approx(4.95)
    assert "tof0 2 (max 5.1 s at 5.0 s)" in line(dataclasses.replace(run, flight=flight).table, "gaps")


@pytest.mark.parametrize("count", [0, 1])
def test_a_sensor_with_hardly_any_reading_has_no_rate(run: Run, count: int) -> None:
    flight = dataclasses.replace(run.flight, tables={"tof0": SensorTable(np.zeros(count, np.int64), {})})
    assert sensor_rates(flight, 0)[0].rate_hz is None


def test_time_outs_are_listed_and_then_counted(run: Run) -> None:
    sensors = copy.deepcopy(run.metrics["sensors"])
    sensors["uwb0"]["timeouts"] = [[float(i), i + 2.5] for i in range(0, 20, 4)]
    row = line(with_metrics(run, sensors=sensors).table, "uwb0")
    assert row.endswith("0.0-2.5 s, 4.0-6.5 s, 8.0-10.5 s, 2 more")


def test_dead_reckoning_alone_is_a_warning(run: Run) -> None:
    sensors = {name: {**sensor, "fused": 0} for name, sensor in run.metrics["sensors"].items()}
    assert "no reading was fused" in line(with_metrics(run, sensors=sensors).table, "warning")


def test_each_section_has_its_line() -> None:
    corridor = Corridor(section=(Section(kind="straight", start=(-3.0, 0.0, 0.0), end=(3.0, 0.0, 0.0)),))
    assert "RMS" in line(make_run(corridor=corridor).table, "  in straight_1")


def test_columns_line_up() -> None:
    assert list(aligned([["a", "1"], ["long", "234"]])) == ["a       1", "long  234"]


@pytest.mark.parametrize(("nees", "word"), [(3.0, "consistent"), (9.0, "overconfident"), (0.5, "pessimistic")])
def test_the_word_for_the_nees_follows_its_band(nees: float, word: str) -> None:
    assert nees_verdict({"nees_velocity": nees, "nees_velocity_band": [2.0, 4.0]}) == word


def test_findings_name_what_is_wrong_and_only_that(run: Run) -> None:
    found = " ".join(findings(run.metrics))
    assert "dead reckoning" in found
    assert "re-anchored 1 time." in found
    assert "uwb0: 12 % of the readings were gated" in found
    assert "tof0" not in found
    assert "overconfident" not in found
    assert summary(run).count("\n") > 8
