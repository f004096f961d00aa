"""The paper's field flights, small: the table says what was asked, and the filter is better than the paper's method."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from axialnav.replay.experiments import field


@pytest.mark.slow
def test_a_field_flight_scores_the_filter_beside_the_papers_method(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(field, "SECTIONS", ("straight",))
    for name, value in (("WIDTH_PX", 160), ("HEIGHT_PX", 120), ("FOCAL_PX", 120.0)):
        monkeypatch.setattr(field, name, value)
    result = field.run(tmp_path, seed=3, trials=12)
    rows = list(csv.DictReader((tmp_path / "field.csv").read_text(encoding="utf-8").splitlines()))
    by_name = {(row["flight"], row["estimate"]): row for row in rows}
    fused = by_name["straight, UWB-referenced", "fused"]
    stripes = by_name["straight, UWB-referenced", field.STRIPES]
    assert float(fused["RMSE [m/s]"]) < 0.06
    assert float(fused["RMSE [m/s]"]) < float(stripes["RMSE [m/s]"])
    assert float(fused["in 3 sigma"]) > 0.97
    assert by_name["straight", "the paper"]["RMSE [m/s]"] == "0.1964"
    assert (tmp_path / "field.svg").stat().st_size < 400_000
    assert "UWB and IMU alone" in result.text
