"""Limits on a run: what passes, what fails, and that nothing evaluated is never a pass."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay import cli
from axialnav.replay.checks import Judgement, check_metrics, verdict
from axialnav.replay.limits_file import Limit, read_limits
from axialnav.replay.run_folder import metrics_text
from axialnav.replay.run_reader import read_metrics
from tests.replay.made_runs import make_run

METRICS: dict[str, Any] = {
    "axial_velocity_m_s": {"rmse": 0.2, "mean_error": -0.05},
    "nees_velocity": 4.0,
    "band": [2.0, 3.5],
    "health": {"good": 1.0},
    "nothing": None,
    "sensors": {
        "tof0": {"fused": 90, "gated": 10, "disabled": False, "timeouts": [[1.0, 2.5], [4.0, 4.5]]},
        "uwb0": {"fused": 0, "gated": 0, "disabled": False, "timeouts": []},
        "flow0": {"fused": 5, "gated": 0, "disabled": True, "timeouts": []},
    },
}


def judge(**limit: Any) -> list[tuple[str, float | None]]:
    return [(str(c.judgement), c.value) for c in check_metrics(METRICS, {"it": Limit(**limit)})]


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        ({"fail_above": 0.2}, ("PASS", 0.2)),  # the limit itself is allowed
        ({"fail_above": 0.19}, ("FAIL", 0.2)),
        ({"warn_above": 0.1, "fail_above": 0.3}, ("WARN", 0.2)),
        ({"warn_below": 0.5, "fail_below": 0.3}, ("FAIL", 0.2)),
        ({"fail_below": 0.2}, ("PASS", 0.2)),
    ],
)
def test_a_number_against_its_limits(limit: dict[str, float], expected: tuple[str, float]) -> None:
    assert judge(metric="axial_velocity_m_s.rmse", **limit) == [expected]


def test_size_band_and_absence() -> None:
    assert judge(metric="axial_velocity_m_s.mean_error", take="size", fail_above=0.04) == [("FAIL", 0.05)]
    assert judge(metric="nees_velocity", warn_outside="band", fail_above=9) == [("WARN", 4.0)]
    assert judge(metric="health.lost", if_absent=0.0, warn_above=0) == [("PASS", 0.0)]
    assert judge(metric="illness.lost", if_absent=0.0, warn_above=0) == [("NOT_EVALUATED", None)]


def test_stars_stand_for_every_sensor_and_divide_row_by_row() -> None:
    shares = check_metrics(
        METRICS,
        {
            "gated": Limit(
                metric="sensors.*.gated",
                divided_by=("sensors.*.fused", "sensors.*.gated"),
                unless="sensors.*.disabled",
                fail_above=0.05,
            )
        },
    )
    assert [(c.name, c.value, str(c.judgement)) for c in shares] == [
        ("gated (tof0)", 0.1, "FAIL"),
        ("gated (uwb0)", None, "NOT_EVALUATED"),
        ("gated (flow0)", None, "NOT_EVALUATED"),
    ]
    assert "disabled" in shares[2].reason


def test_one_of_several_reasons_is_enough_to_skip_a_check() -> None:
    sensors = {"baro0": {"lag1": 0.9, "disabled": False, "correlated": True}}
    sensors |= {"uwb0": {"lag1": 0.9, "disabled": False, "correlated": False}}
    limit = Limit(metric="sensors.*.lag1", unless=("sensors.*.disabled", "sensors.*.correlated"), warn_above=0.4)
    skipped, judged = check_metrics({"sensors": sensors}, {"white": limit})
    assert (skipped.judgement, skipped.reason) == (Judgement.NOT_EVALUATED, "skipped because of correlated")
    assert judged.judgement is Judgement.WARN


@pytest.mark.parametrize(("take", "value"), [("count", 2.0), ("longest", 1.5), ("total", 2.0)])
def test_intervals_are_counted_and_measured(take: Any, value: float) -> None:
    assert judge(metric="sensors.*.timeouts", take=take, fail_above=10.0)[0] == ("PASS", value)


@pytest.mark.parametrize(
    "metric", ["nothing", "axial_velocity_m_s", "axial_velocity_m_s.rms", "band", "sections.*.rmse"]
)
def test_what_is_not_a_number_is_not_evaluated(metric: str) -> None:
    (checked,) = check_metrics(METRICS, {"it": Limit(metric=metric, fail_above=1e9)})
    assert checked.judgement is Judgement.NOT_EVALUATED
    assert checked.reason
    assert verdict([checked]) is Judgement.NOT_EVALUATED


def test_a_misspelt_metric_is_told_the_nearest() -> None:
    (checked,) = check_metrics(METRICS, {"it": Limit(metric="axial_velocity_m_s.rms", fail_above=1.0)})
    assert "did you mean rmse?" in checked.reason


def test_the_verdict_is_the_worst_and_a_required_gap_is_worse_than_a_failure() -> None:
    good = Limit(metric="nees_velocity", fail_above=9.0)
    bad = Limit(metric="nees_velocity", fail_above=1.0)
    gap = Limit(metric="nothing", fail_above=1.0)
    needed = Limit(metric="nothing", fail_above=1.0, required=True)
    for limits, expected in (
        ([good], Judgement.PASS),
        ([good, gap], Judgement.PASS),
        ([good, bad, gap], Judgement.FAIL),
        ([good, bad, needed], Judgement.NOT_EVALUATED),
        ([gap], Judgement.NOT_EVALUATED),
        ([], Judgement.NOT_EVALUATED),
    ):
        assert verdict(check_metrics(METRICS, dict(zip("abc", limits, strict=False)))) is expected


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    """A folder with the numbers of a made run."""
    (tmp_path / "metrics.json").write_text(metrics_text(make_run().metrics))
    return tmp_path


def limits_file(folder: Path, text: str) -> str:
    path = folder / "limits.toml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ('[check.a]\nmetric = "axial_velocity_m_s.rmse"\nfail_above = 1.0\n', 0),
        ('[check.a]\nmetric = "axial_velocity_m_s.rmse"\nwarn_above = 0.0\n', 0),
        ('[check.a]\nmetric = "axial_velocity_m_s.rmse"\nfail_above = 0.0\n', 1),
        ('[check.a]\nmetric = "horizontal_speed_rmse_m_s"\nfail_above = 1.0\n', 3),
    ],
)
def test_the_exit_code_is_the_verdict(
    run_folder: Path, text: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = limits_file(run_folder, text)
    assert cli.main(["check", str(run_folder), "--limits", limits]) == code
    table = capsys.readouterr().out
    assert cli.main(["check", str(run_folder / "metrics.json"), "--limits", limits, "--json"]) == code
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] in table.splitlines()[-1]
    assert sum(found["counts"].values()) == len(found["checks"]) == 1


def test_the_limits_that_come_along_look_at_every_sensor(run_folder: Path) -> None:
    checks = check_metrics(read_metrics(run_folder), read_limits())
    names = {c.name for c in checks}
    assert {"mean_nis (tof0)", "mean_nis (uwb0)", "axial_velocity_rmse", "velocity_nees"} <= names
    by_name = {c.name: c for c in checks}
    assert by_name["gated_share (uwb0)"].value == pytest.approx(0.1, abs=0.02)
    assert by_name["resets"].judgement is Judgement.WARN
    assert verdict(checks) in {Judgement.WARN, Judgement.FAIL}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no [check.NAME]"),
        ("[check.a]\nmetric = 'x'\n", "no limit"),
        ("[check.a]\nmetric = 'x'\nfail_abov = 1\n", "did you mean `fail_above`"),
        ("[check.a]\nmetric = 'a..b'\nfail_above = 1\n", "metric"),
        ("[check.a]\nfail_above = 1\n", "metric"),
        ("[check.a]\nmetric = 'x'\nfail_above = nan\n", "finite"),
        ("check = 3 4", "not valid TOML"),
    ],
)
def test_a_bad_limits_file_is_a_usage_error(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_limits(Path(limits_file(tmp_path, text)))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\x00\xff\xfe" * 50, b"[" * 100_000])
def test_a_bad_metrics_file_is_unusable_input(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "metrics.json").write_bytes(content)
    with pytest.raises(FlightError):
        read_metrics(tmp_path)


def test_no_run_and_no_limits_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", str(tmp_path)]) == 3
    assert "No such file" in capsys.readouterr().err
    (tmp_path / "metrics.json").write_text("{}")
    assert cli.main(["check", str(tmp_path), "--limits", str(tmp_path / "none.toml")]) == 2
    assert cli.main(["check", str(tmp_path), "--limits", str(tmp_path)]) == 2
    assert cli.main(["check", str(tmp_path)]) == 3
    assert cli.main(["check"]) == 2
