"""Run against run: equal bits, known differences, other stamps, and what cannot be compared."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.errors import FlightError
from axialnav.replay import cli
from axialnav.replay.compare import compare_runs
from axialnav.replay.fused import Column, digest, write_fused_csv
from axialnav.replay.run_reader import StoredRun, read_fused_csv, read_run
from tests.replay.made_runs import make_run

COLUMNS = make_run(count=500).columns


def stored(columns: dict[str, Column], name: str = "run") -> StoredRun:
    return StoredRun(name, columns, None, digest(columns))


def changed(**values: Column) -> StoredRun:
    return stored({**COLUMNS, **values})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "a"
    path.mkdir()
    write_fused_csv(path / "fused.csv", COLUMNS)
    return path


def test_a_file_reads_back_to_the_same_digest(folder: Path) -> None:
    assert read_run(folder).digest == digest(COLUMNS)


def test_equal_runs_are_identical() -> None:
    comparison = compare_runs(stored(COLUMNS), stored(dict(COLUMNS)))
    assert comparison.identical
    assert comparison.differences == ()
    assert comparison.beyond(0.0) == ()


def test_the_largest_difference_is_found_where_it_is() -> None:
    speed = COLUMNS["v_x_m_s"].copy()
    speed[100] += 0.25
    speed[200] -= 0.125
    comparison = compare_runs(stored(COLUMNS), changed(v_x_m_s=speed))
    by_name = {d.channel: d for d in comparison.differences}
    (found,) = comparison.beyond(0.0)
    assert found is by_name["v_x_m_s"]
    assert found.largest == pytest.approx(0.25)
    assert found.at_s == pytest.approx(0.4)
    assert found.rms == pytest.approx(np.sqrt((0.25**2 + 0.125**2) / 500))
    assert found.in_sigma == pytest.approx(0.25 / COLUMNS["sigma_v_x_m_s"][100])
    assert by_name["v_y_m_s"].largest == 0.0
    assert comparison.beyond(0.2) == (found,)
    assert comparison.beyond(0.3) == ()


def test_attitudes_differ_by_their_angle_and_not_by_the_sign_of_q() -> None:
    angle = 0.3
    turned = changed(q_w=np.full(500, -np.cos(angle / 2)), q_z=np.full(500, -np.sin(angle / 2)))
    by_name = {d.channel: d for d in compare_runs(stored(COLUMNS), turned).differences}
    assert by_name["attitude_rad"].largest == pytest.approx(angle)
    mirrored = changed(q_w=-COLUMNS["q_w"], q_x=-COLUMNS["q_x"], q_y=-COLUMNS["q_y"], q_z=-COLUMNS["q_z"])
    by_name = {d.channel: d for d in compare_runs(stored(COLUMNS), mirrored).differences}
    assert by_name["attitude_rad"].largest == 0.0


def test_a_number_that_became_none_differs_by_infinity() -> None:
    speed = COLUMNS["v_x_m_s"].copy()
    speed[7] = np.nan
    (found,) = compare_runs(stored(COLUMNS), changed(v_x_m_s=speed)).beyond(1e300)
    assert found.largest == np.inf
    both = compare_runs(changed(v_x_m_s=speed), changed(v_x_m_s=speed.copy(), v_y_m_s=speed))
    assert {d.channel for d in both.beyond(1e300)} == {"v_y_m_s"}


def test_flags_count_rows() -> None:
    flags = COLUMNS["flags"].copy()
    flags[250:300] ^= 2
    (found,) = compare_runs(stored(COLUMNS), changed(flags=flags)).beyond(0.0)
    assert (found.channel, found.largest, found.at_s) == ("flags", 0.1, pytest.approx(1.0))


def test_other_stamps_are_interpolated_and_gaps_are_left_out() -> None:
    """Every second row and a hole of 0.2 s: a straight line is met exactly, the hole is not compared."""
    t_s = (COLUMNS["t_ns"] - COLUMNS["t_ns"][0]) * 1e-9
    line = {"t_ns": COLUMNS["t_ns"], "v_x_m_s": 3.0 * t_s}
    keep = np.r_[0:200:2, 250:500:2]
    comparison = compare_runs(stored(line), stored({name: values[keep] for name, values in line.items()}))
    assert not comparison.exact_stamps
    assert comparison.compared == 500 - 51 - 1  # 199..249 lie in the hole, 499 after the end
    (found,) = comparison.differences
    assert found.largest < 1e-12


def test_the_verb_says_same_digest_first_and_fails_beyond_the_tolerance(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    same, other = folder.parent / "same", folder.parent / "other"
    shutil.copytree(folder, same)
    other.mkdir()
    write_fused_csv(other / "fused.csv", {**COLUMNS, "p_x_m": COLUMNS["p_x_m"] + 0.01})
    assert cli.main(["compare", str(folder), str(same), "--tolerance", "0"]) == 0
    assert "identical" in capsys.readouterr().out.splitlines()[1]
    assert cli.main(["compare", str(folder), str(other)]) == 0
    assert cli.main(["compare", str(folder), str(same), str(other), "--tolerance", "0.02"]) == 0
    assert cli.main(["compare", str(folder), str(same), str(other), "--tolerance", "0.001"]) == 1
    assert "p_x_m" in capsys.readouterr().out
    assert cli.main(["compare", str(folder), str(other), "--tolerance", "0.001", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["comparisons"][0]["beyond_tolerance"] == ["p_x_m"]


def test_runs_without_a_common_instant_are_unusable(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    late = folder.parent / "late"
    late.mkdir()
    write_fused_csv(late / "fused.csv", {**COLUMNS, "t_ns": COLUMNS["t_ns"] + 10**12})
    assert cli.main(["compare", str(folder), str(late)]) == 3
    assert "no instant in common" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [[], ["a"], ["a", "b", "--tolerance", "-1"], ["a", "b", "--tolerance", "nan"]])
def test_wrong_use_is_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"t_ns\n",
        b"time,v\n1,2\n",
        b"t_ns,v_x_m_s\n1,2\n3\n",
        b"t_ns,v_x_m_s\n1,x\n",
        b"t_ns\n2\n1\n",
        bytes(range(256)),
    ],
)
def test_a_bad_fused_csv_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "fused.csv").write_bytes(content)
    with pytest.raises(FlightError) as caught:
        read_fused_csv(tmp_path / "fused.csv")
    assert "\n" not in str(caught.value)
