"""The main job end to end on the flight that ships with the package: same bits, honest coverage, every option."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import axialnav as an
from axialnav.replay import cli
from axialnav.replay.run import Run
from axialnav.replay.sample_flights import sample_flight_path


@pytest.fixture(scope="module")
def run() -> Run:
    return an.replay(an.load_flight(sample_flight_path()))


def test_every_reading_is_accounted_for(run: Run) -> None:
    for name, sensor in run.metrics["sensors"].items():
        verdicts = ("fused", "gated", "late", "blind", "suspect", "invalid")
        assert sum(sensor[key] for key in verdicts) + sensor["unprocessed"] == sensor["available"], name
        assert sensor["available"] == len(run.flight.tables[name])


def test_one_row_per_imu_sample_and_nothing_that_is_not_a_number(run: Run) -> None:
    assert run.track.t_ns.size == len(run.flight.tables["imu0"])
    for name, values in run.columns.items():
        assert np.isfinite(values).all(), name


def test_scores_against_gps_and_says_what_it_could_not_score(run: Run) -> None:
    assert run.metrics["reference"]["kind"] == "gps"
    assert run.metrics["reference"]["used"] > 300
    assert run.metrics["horizontal_speed_rmse_m_s"] < 0.5
    assert run.metrics["axial_velocity_m_s"]["rmse"] is None
    assert "NOT_EVALUATED" in run.table


def test_two_replays_in_one_process_give_one_digest(run: Run) -> None:
    assert an.replay(sample_flight_path()).metrics["digest"] == run.metrics["digest"]


def test_a_replay_in_another_process_gives_the_same_digest(run: Run, tmp_path: Path) -> None:
    log = str(sample_flight_path())
    command = [sys.executable, "-m", "axialnav", "replay", log, "--out", str(tmp_path / "demo")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert done.stderr == ""
    assert "horizontal speed vs GPS" in done.stdout
    assert done.stdout.splitlines()[-1].endswith("report.html")
    assert json.loads((tmp_path / "demo" / "metrics.json").read_text())["digest"] == run.metrics["digest"]


def test_the_config_of_a_run_repeats_that_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = str(sample_flight_path())
    changed = ["--without", "att0,tof0", "--param", "flow.sigma_rad=0.008", "--param", "imu.accel_noise_scale=2.0"]
    assert cli.main(["replay", log, "--out", str(tmp_path / "a"), *changed]) == 0
    assert "switched off" in capsys.readouterr().out
    assert cli.main(["replay", log, "--out", str(tmp_path / "b"), "--config", str(tmp_path / "a" / "config.toml")]) == 0
    first, second = (json.loads((tmp_path / name / "metrics.json").read_text()) for name in "ab")
    assert first["digest"] == second["digest"]
    assert first["sensors"]["att0"]["disabled"] is True
    assert (tmp_path / "a" / "fused.csv").read_bytes() == (tmp_path / "b" / "fused.csv").read_bytes()


def test_a_changed_setting_changes_the_digest_and_is_named(run: Run) -> None:
    other = an.replay(run.flight, params={"flow.sigma_rad": "0.01"})
    assert other.metrics["digest"] != run.metrics["digest"]
    assert "flow.sigma_rad" in other.table.splitlines()[0]
    assert "0.01" in other.table.splitlines()[0]


def test_progress_ends_at_one(run: Run) -> None:
    shares: list[float] = []
    an.replay(run.flight, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_compiling_does_not_count_as_time_of_the_filter(run: Run) -> None:
    """The first replay after installation is no slower than the flight only because its kernels were compiled."""

    def compile_one(_: float) -> None:
        numba.njit(lambda x: x + 1.0)(1.0)

    timing = an.replay(run.flight, progress=compile_one).metrics["timing"]
    assert 0.0 < timing["compiled_s"] < timing["wall_s"]
    own_s = timing["wall_s"] - timing["compiled_s"]
    assert timing["real_time_factor"] == pytest.approx(timing["flight_s"] / own_s)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"without": ["uwb7"]}, "uwb7.*imu0"),
        ({"params": {"flow.sigma": "1"}}, "flow.sigma.*did you mean"),
        ({"params": {"flow.sigma_rad": "-1"}}, "sigma_rad"),
        ({"estimator": "kalman"}, "kalman.*corridor"),
    ],
)
def test_options_that_make_no_sense_are_usage_errors(run: Run, options: dict, words: str) -> None:
    with pytest.raises(an.ConfigError, match=words):
        an.replay(run.flight, **options)


def test_a_flight_without_any_reference_is_replayed_and_not_called_perfect(tmp_path: Path) -> None:
    flight = tmp_path / "blind"
    shutil.copytree(sample_flight_path(), flight)
    shutil.rmtree(flight / "mav0" / "gps0")
    done = subprocess.run(
        [sys.executable, "-m", "axialnav", "replay", str(flight), "--out", str(tmp_path / "run")],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0
    assert "NOT_EVALUATED" in done.stdout
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert metrics["reference"] == {"used": 0, "available": 0, "kind": "none"}
    assert metrics["axial_velocity_m_s"]["rmse"] is None
    assert metrics["position_rmse_3d_m"] is None
    assert metrics["nees_velocity"] is None


def test_a_flight_without_an_imu_cannot_be_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flight = tmp_path / "no_imu"
    shutil.copytree(sample_flight_path(), flight)
    shutil.rmtree(flight / "mav0" / "imu0")
    assert cli.main(["replay", str(flight), "--out", str(tmp_path / "run")]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "imu0" in error
    assert not (tmp_path / "run").exists()


def test_a_reader_that_walks_away_does_not_spoil_the_run(tmp_path: Path) -> None:
    log = str(sample_flight_path())
    command = [sys.executable, "-m", "axialnav", "replay", log, "--out", str(tmp_path / "demo")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    complaint = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=300) == 0
    assert complaint == b""
    assert (tmp_path / "demo" / "metrics.json").exists()


@pytest.mark.flights
@pytest.mark.parametrize(("name", "alignment"), [("util_los_tdoa2_bolt_short", "none"), ("isas_walk1", "rigid")])
def test_scores_equal_those_computed_from_the_files_alone(
    shared: Path, tmp_path: Path, name: str, alignment: str
) -> None:
    """Read fused.csv and the truth file with numpy alone and score them again."""
    flight = shared / "flights" / name
    run = an.replay(flight)
    run.write(tmp_path)
    fused = np.genfromtxt(tmp_path / "fused.csv", delimiter=",", names=True)
    truth = np.genfromtxt(flight / "mav0" / "state_groundtruth_estimate0" / "data.csv", delimiter=",", comments="#")
    start, end = run.flight.evaluation
    seconds = (fused["t_ns"] - fused["t_ns"][0]) * 1e-9
    scored = (seconds >= start) & (seconds <= end)
    reference = {a: np.interp(fused["t_ns"][scored], truth[:, 0], truth[:, i]) for i, a in enumerate("xyz", start=1)}
    estimate = {a: fused[f"p_{a}_m"][scored] for a in "xyz"}
    assert run.metrics["alignment"] == alignment
    assert run.metrics["reference"]["used"] == pytest.approx(scored.sum(), abs=3)
    rmse = [np.sqrt(np.mean((estimate[a] - reference[a]) ** 2)) for a in "xyz"]
    if alignment == "none":
        np.testing.assert_allclose(run.metrics["position_rmse_m"], rmse, rtol=1e-3)
    else:
        assert run.metrics["position_rmse_3d_m"] <= np.linalg.norm(rmse)


@pytest.mark.flights
def test_a_camera_only_recording_is_refused_in_one_line(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["replay", str(shared / "flights" / "davis_slider_far")]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "cam0" in error
