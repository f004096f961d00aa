"""The benches of tuning and of the tools run on a little data, so that they cannot rot between two uses."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.bench_tools import make_logs, sweep_rows, time_rows
from tests.bench.bench_tune import FOUND_HEAD, OURS, flown_tables, found_rows


def test_every_way_to_tune_has_a_row(tmp_path: Path) -> None:
    rows = list(found_rows(seeds=(1,), duration_s=6.0, trials=3))
    assert [row[0] for row in rows] == ["0%"] * 3 + ["8%"] * 3
    assert all(len(row) == len(FOUND_HEAD) for row in rows)
    ours = rows[0]
    assert ours[1] == OURS
    assert int(ours[2]) > 30
    assert ours[7] != rows[2][7]  # the image motion, which six seconds tell to ours and not to mean NIS
    assert flown_tables(tmp_path).startswith("skipped: ")


@pytest.mark.slow
def test_the_tools_are_timed(tmp_path: Path) -> None:
    logs = make_logs(tmp_path, minutes=0.05, seeds=(1,))
    replay, doctor, report = time_rows(logs[0], tmp_path, repeats=1)
    assert float(replay[1]) > 0.0
    assert float(doctor[1]) > 0.0
    assert report[-1] == "ok"
    rows = list(sweep_rows(logs, tmp_path, count=2))
    assert len(rows) == 3
    assert all(float(row[2]) > 0.0 for row in rows)
