"""``replay --estimator axial``: the same run folder, from flights with and without inertial samples."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import axialnav as an
from axialnav.replay import cli
from axialnav.replay.sample_flights import sample_flight_path


def test_the_run_folder_is_complete_and_free_of_nan(tmp_path: Path) -> None:
    command = ["replay", str(sample_flight_path()), "--estimator", "axial", "--out", str(tmp_path)]
    assert cli.main(command) == 0
    metrics = json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8"))
    assert metrics["estimator"] == "axial"
    assert metrics["horizontal_speed_rmse_m_s"] is None or metrics["horizontal_speed_rmse_m_s"] < 3.0
    assert metrics["sensors"]["flow0"]["fused"] > 0
    assert metrics["sensors"]["att0"]["fused"] == metrics["sensors"]["att0"]["available"]
    fused = np.genfromtxt(tmp_path / "fused.csv", delimiter=",", names=True)
    assert all(np.isfinite(fused[name]).all() for name in fused.dtype.names)
    assert (tmp_path / "report.html").exists()


def test_a_flight_without_inertial_samples_is_replayed_at_the_attitudes(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    shutil.copytree(sample_flight_path(), flight)
    shutil.rmtree(flight / "mav0" / "imu0")
    run = an.replay(flight, estimator="axial")
    assert run.track.t_ns.size == len(run.flight.tables["att0"])
    assert run.metrics["sensors"]["flow0"]["fused"] > 100
    with pytest.raises(an.FlightError, match="needs imu0"):
        an.replay(flight)


def test_without_attitude_and_with_smoothing_it_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    flight = str(sample_flight_path())
    assert cli.main(["replay", flight, "--estimator", "axial", "--without", "att0"]) == 2
    assert "needs the autopilot's attitude" in capsys.readouterr().err
    assert cli.main(["replay", flight, "--estimator", "axial", "--smooth"]) == 2
    assert "cannot smooth" in capsys.readouterr().err
    assert cli.main(["replay", flight, "--estimator", "spherical"]) == 2
    assert "corridor, axial" in capsys.readouterr().err
