"""The corridor bench: what it calls short, and that it goes on where it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.bench import bench_corridor
from tests.bench.bench_corridor import ESTIMATES, Score, flown, mission_of, row

GOOD = Score(0.01, 0.1, 1.0, 0.001)


def test_a_row_names_what_falls_short() -> None:
    assert row("corner", ESTIMATES[0], [GOOD, GOOD])[-1] == "ok"
    bad = Score(0.2, 0.4, 0.9, 0.01)
    assert row("corner", ESTIMATES[1], [GOOD, bad])[-1] == "SHORT: RMSE, max, 3 sigma, drift"
    assert row("straight", ESTIMATES[0], [Score(0.01, 0.4, 1.0, 0.01)])[-1] == "ok"
    assert row("stairs", ESTIMATES[2], [Score(0.5, 1.0, np.nan, np.nan, 0.6)])[-3:] == ["-", "60 %", "-"]


def test_a_flight_that_was_flown_is_not_flown_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flights = []

    def fly(section: str, seed: int, seconds: float) -> list[Score]:
        flights.append((section, seed, seconds))
        return [GOOD] * 3

    monkeypatch.setattr(bench_corridor, "fly", fly)
    monkeypatch.setattr(bench_corridor, "KEPT", tmp_path)
    assert flown("straight", 3, 20.0) == flown("straight", 3, 20.0) == [GOOD] * 3
    flown("straight", 3, 30.0)
    assert flights == [("straight", 3, 20.0), ("straight", 3, 30.0)]


def test_walls_go_from_strong_to_nearly_blank() -> None:
    contrasts = {mission_of("corner", seed, 20.0).section[0].left.contrast for seed in range(4)}
    assert contrasts == {0.2, 0.1, 0.05, 0.02}
