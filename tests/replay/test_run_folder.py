"""The run folder: exact columns, bits that survive the text, a digest anybody can recompute, strict JSON."""

from __future__ import annotations

import csv
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.outcome import Verdict
from axialnav.replay.fused import digest, write_fused_csv
from axialnav.replay.run import Run
from axialnav.replay.run_folder import metrics_text, write_run_folder
from tests.replay.made_runs import make_run

HEADER = (
    "t_ns,p_x_m,p_y_m,p_z_m,v_x_m_s,v_y_m_s,v_z_m_s,q_w,q_x,q_y,q_z,sigma_p_x_m,sigma_p_y_m,sigma_p_z_m,"
    "sigma_v_x_m_s,sigma_v_y_m_s,sigma_v_z_m_s,axial_position_m,axial_velocity_m_s,sigma_axial_velocity_m_s,flags"
)


@pytest.fixture(scope="module")
def run() -> Run:
    return make_run()


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run_folder(run, tmp_path_factory.mktemp("runs") / "deep" / "made")


def read_csv(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return dict(zip(rows[0], map(list, zip(*rows[1:], strict=True)), strict=True))


def test_a_run_folder_holds_exactly_the_promised_files(folder: Path) -> None:
    names = {path.name for path in folder.iterdir()}
    assert names == {"metrics.json", "innovations.parquet", "config.toml", "report.html", "fused.csv"}


def test_fused_csv_has_the_promised_columns_and_one_row_per_imu_sample(run: Run, folder: Path) -> None:
    lines = (folder / "fused.csv").read_text().splitlines()
    assert lines[0] == HEADER
    assert len(lines) == 1 + run.track.t_ns.size


def test_the_digest_can_be_recomputed_from_the_text_of_fused_csv(run: Run, folder: Path) -> None:
    total = hashlib.sha256()
    for name, texts in read_csv(folder / "fused.csv").items():
        kind = int if name in ("t_ns", "flags") else float
        total.update(np.array([kind(text) for text in texts], dtype="<i8" if kind is int else "<f8").tobytes())
    assert total.hexdigest() == run.metrics["digest"]


def test_the_digest_sees_the_last_bit_of_any_column(run: Run) -> None:
    for name, values in run.columns.items():
        changed = values.copy()
        changed[1234] = changed[1234] + 1 if values.dtype.kind == "i" else np.nextafter(changed[1234], np.inf)
        assert digest({**run.columns, name: changed}) != run.metrics["digest"], name


def test_extreme_floats_survive_the_text(tmp_path: Path) -> None:
    values = np.array([5e-324, -1.7976931348623157e308, 0.1, 1 / 3, -0.0, 1e22, 123456789.123456789, np.nan])
    columns = {"t_ns": np.arange(8, dtype=np.int64) + 2**60, "x": values}
    write_fused_csv(tmp_path / "x.csv", columns)
    back = read_csv(tmp_path / "x.csv")
    assert [int(t) for t in back["t_ns"]] == columns["t_ns"].tolist()
    assert np.array([float(t) for t in back["x"]]).tobytes()[:-8] == values.tobytes()[:-8]
    assert back["x"][-1] == "nan"


def test_innovations_parquet_holds_every_reading(run: Run, folder: Path) -> None:
    table = parquet.read_table(folder / "innovations.parquet")
    assert table.num_rows == run.log.t_ns.size
    sensors = table["sensor"].to_pylist()
    assert sensors == [run.log.sensors[i] for i in run.log.source]
    assert table["verdict"].to_pylist() == [Verdict(v).name.lower() for v in run.log.verdict]
    np.testing.assert_array_equal(table["nis"].to_numpy(), run.log.nis)
    np.testing.assert_array_equal(table["innovation_0"].to_numpy(), run.log.innovation[:, 0])
    group = parquet.ParquetFile(folder / "innovations.parquet").metadata.row_group(0)
    assert {group.column(i).compression for i in range(group.num_columns)} == {"ZSTD"}


def test_metrics_json_is_strict_and_equal_to_the_metrics(run: Run, folder: Path) -> None:
    def refuse(text: str) -> float:
        raise AssertionError(text)

    back = json.loads((folder / "metrics.json").read_text(), parse_constant=refuse)
    assert back == {**run.metrics, "inputs": []}  # of a flight that was never on disk
    assert json.loads(metrics_text({"a": [float("nan"), 1.0], "b": float("inf")})) == {"a": [None, 1.0], "b": None}


def test_config_toml_reads_back_to_the_resolved_settings(run: Run, folder: Path) -> None:
    assert Config.from_toml(folder / "config.toml") == run.config


def test_a_folder_that_cannot_be_made_is_one_clear_error(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(ConfigError, match=r"run folder .*file.* cannot be written .*--out") as caught:
        write_run_folder(run, tmp_path / "file" / "run")
    assert "\n" not in str(caught.value)
