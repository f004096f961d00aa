"""The paper's experiments from the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


def axialnav(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "axialnav", *words], capture_output=True, text=True)


@pytest.mark.slow
def test_an_experiment_prints_its_table_and_names_its_files(tmp_path: Path) -> None:
    done = axialnav("motion", "--experiment", "frames", "--trials", "1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "joint" in done.stdout
    assert {f.name for f in tmp_path.iterdir()} == {"frames.csv", "frames.svg"}
    assert all(str(f) in done.stdout for f in tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "needs a flight"),
        (("--experiment", "fig9"), "single-vs-composite"),
        (("a-flight", "--experiment", "frames"), "leave out a-flight"),
        (("--experiment", "frames", "--trials", "0"), "at least 1 trial"),
        (("--experiment", "frames", "--method", "dct", "--distance-m", "2"), "leave out --method, --distance-m"),
        (("a-flight", "--trials", "3"), "belong to an experiment"),
        (("a-flight", "--out", "."), "is a folder"),
        (("a-flight", "--out", "a-flight/mav0/cam0/data.csv"), "part of a recorded flight"),
    ],
)
def test_nonsense_is_a_usage_error_in_one_line(words: tuple[str, ...], says: str) -> None:
    done = axialnav("motion", *words)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
