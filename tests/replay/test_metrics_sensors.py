"""Counts, normalised innovations and silences per sensor."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from axialnav.fusion.outcome import Verdict
from axialnav.replay.sensor_metrics import lag1, mean_nis, sensor_metrics, silences
from tests.replay.made_runs import START_NS, make_config, make_flight, make_log, make_track

COUNT = 5000


@pytest.fixture
def parts():
    track = make_track(np.zeros((COUNT, 3)))
    log = make_log(track.t_ns, np.random.default_rng(4))
    config = make_config()
    return track, log, config, make_flight(track, log, config, None)


def test_verdicts_add_up_to_what_was_available(parts) -> None:
    track, log, config, flight = parts
    found = sensor_metrics(track, log, flight.tables, config)
    assert list(found) == ["tof0", "uwb0"]
    for name, sensor in found.items():
        total = sum(sensor[verdict.name.lower()] for verdict in Verdict)
        assert total == sensor["available"] == len(flight.tables[name])
        assert sensor["unprocessed"] == 0
    assert found["uwb0"]["reasons"] == {"the innovation is outside the gate": found["uwb0"]["gated"]}


def test_a_reading_that_never_reached_the_filter_is_counted(parts) -> None:
    track, log, config, flight = parts
    shorter = dataclasses.replace(log, **{f: getattr(log, f)[7:] for f in log.__slots__ if f != "sensors"})
    found = sensor_metrics(track, shorter, flight.tables, config)
    assert found["tof0"]["unprocessed"] + found["uwb0"]["unprocessed"] == 7


def test_mean_nis_counts_a_gated_reading_as_the_gate(parts) -> None:
    log = parts[1]
    rows = np.flatnonzero(log.source == 1)
    gated = log.verdict[rows] == Verdict.GATED
    expected = (log.nis[rows][~gated].sum() + 10.83 * gated.sum()) / rows.size
    assert mean_nis(log, rows) == pytest.approx(expected)


def test_mean_nis_is_per_degree_of_freedom_and_ignores_what_was_not_compared(parts) -> None:
    log = parts[1]
    rows = np.arange(4)
    verdict = np.array([Verdict.FUSED, Verdict.FUSED, Verdict.BLIND, Verdict.LATE])
    nis, dof = np.array([2.0, 6.0, 99.0, np.nan]), np.array([1, 3, 1, 0])
    small = dataclasses.replace(log, verdict=verdict, nis=nis, dof=dof, gate=np.full(4, 10.0))
    assert mean_nis(small, rows) == pytest.approx(2.0)
    assert mean_nis(small, rows[2:]) is None


def test_lag1_sees_white_and_coloured_innovations(parts) -> None:
    log = parts[1]
    rows = np.flatnonzero(log.source == 0)
    assert abs(lag1(log, rows)) < 4.0 / np.sqrt(rows.size)
    coloured = log.innovation.copy()
    coloured[rows, 0] = 0.1 * np.convolve(np.random.default_rng(5).normal(size=rows.size), [1.0, 1.0], "same")
    assert lag1(dataclasses.replace(log, innovation=coloured), rows) == pytest.approx(0.5, abs=0.12)


def test_silences_are_the_intervals_longer_than_the_timeout() -> None:
    track_t_ns = START_NS + np.arange(0, 10_000_000_001, 100_000_000)
    fused = START_NS + np.array([2.0, 2.5, 3.4, 6.0, 6.9, 7.8, 8.7, 9.6]) * 1e9
    spans = silences(track_t_ns, fused.astype(np.int64), 1.0)
    np.testing.assert_allclose(spans, [[0.0, 2.0], [3.4, 6.0]])


def test_a_sensor_that_was_never_fused_is_silent_all_along() -> None:
    track_t_ns = START_NS + np.arange(0, 5_000_000_001, 100_000_000)
    assert silences(track_t_ns, np.zeros(0, np.int64), 1.0) == [[0.0, 5.0]]


def test_a_sensor_that_was_switched_off_is_named_and_not_called_silent(parts) -> None:
    track, log, config, flight = parts
    off = config.without(("uwb0",))
    rows = log.source == 0
    only_tof = dataclasses.replace(log, **{f: getattr(log, f)[rows] for f in log.__slots__ if f != "sensors"})
    found = sensor_metrics(track, only_tof, flight.tables, off)["uwb0"]
    assert found["disabled"] is True
    assert found["available"] == len(flight.tables["uwb0"])
    assert found["fused"] == 0
    assert found["timeouts"] == []
    assert found["mean_nis"] is None
