"""``replay --smooth``: same flight, same folder, better numbers, and the table says so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import axialnav as an
from axialnav.replay import cli
from axialnav.replay.sample_flights import sample_flight_path


def test_the_smoothed_run_has_the_shape_of_the_filtered_one() -> None:
    flight = an.load_flight(sample_flight_path())
    filtered, smoothed = an.replay(flight), an.replay(flight, smooth=True)
    assert list(filtered.columns) == list(smoothed.columns)
    np.testing.assert_array_equal(filtered.columns["t_ns"], smoothed.columns["t_ns"])
    np.testing.assert_array_equal(filtered.columns["flags"], smoothed.columns["flags"])
    assert filtered.metrics["digest"] != smoothed.metrics["digest"]
    assert (filtered.metrics["smoothed"], smoothed.metrics["smoothed"]) == (False, True)
    assert smoothed.metrics["sensors"] == filtered.metrics["sensors"]
    assert all(np.isfinite(column).all() for column in smoothed.columns.values())
    sigma = "sigma_axial_velocity_m_s"
    assert np.median(smoothed.columns[sigma]) < np.median(filtered.columns[sigma])
    assert an.replay(flight, smooth=True).metrics["digest"] == smoothed.metrics["digest"]


def test_the_command_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["replay", str(sample_flight_path()), "--smooth", "--out", str(tmp_path)]) == 0
    assert "smoothed" in capsys.readouterr().out
    assert json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))["smoothed"] is True


@pytest.mark.flights
@pytest.mark.parametrize(
    ("name", "limit_m_s"), [("util_los_tdoa2_bolt_short", 0.03), ("util_nlos_tdoa2_obs_flow_tof", 0.035)]
)
def test_real_flights_gain(shared: Path, name: str, limit_m_s: float) -> None:
    flight = an.load_flight(shared / "flights" / name)
    filtered, smoothed = (an.replay(flight, smooth=s).metrics["axial_velocity_m_s"]["rmse"] for s in (False, True))
    assert smoothed < limit_m_s
    assert smoothed < 0.75 * filtered
