"""The run folder: what a replay leaves behind for people, checks and other tools."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.outcome import InnovationLog, Reason, Verdict
from axialnav.replay.fused import write_fused_csv

if TYPE_CHECKING:
    from axialnav.replay.run import Run

REPORT = "report.html"


def write_run_folder(run: Run, folder: str | Path) -> Path:
    """Write ``metrics.json``, ``fused.csv``, ``innovations.parquet``, ``config.toml`` and ``report.html``.

    Files of an earlier run in the same folder are replaced.  Returns the folder.

    Raises
    ------
    ConfigError
        The folder cannot be made or written.
    """
    from axialnav.replay.report.page import render_report

    out = Path(folder)
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "config.toml").write_text(run.config.to_toml(), encoding="utf-8")
        write_fused_csv(out / "fused.csv", run.columns)
        write_innovations(out / "innovations.parquet", run.log)
        (out / REPORT).write_text(render_report(run), encoding="utf-8")
        (out / "metrics.json").write_text(
            metrics_text({**run.metrics, "inputs": [asdict(one) for one in run.flight.inputs]}), encoding="utf-8"
        )
    except OSError as error:
        why = error.strerror or str(error)
        raise ConfigError(f"run folder {out}: cannot be written ({why}); choose another with --out") from None
    return out


def metrics_text(metrics: dict[str, Any]) -> str:
    """Strict JSON; a number that is not finite becomes null, because JSON has no word for it."""
    return json.dumps(_finite(metrics), indent=1, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def write_innovations(path: Path, log: InnovationLog) -> None:
    """One row per reading in the order of processing, zstd-compressed Parquet.

    ``sensor``, ``verdict`` and ``reason`` are dictionary-encoded names; innovations and variances of up to three axes
    in the sensor's own unit.
    """
    import pyarrow as pa
    from pyarrow import parquet

    def names(codes: Any, words: list[str]) -> Any:
        """Codes as a column of words."""
        return pa.DictionaryArray.from_arrays(pa.array(codes.astype(np.int32)), pa.array(words, pa.string()))

    columns: dict[str, Any] = {
        "t_ns": log.t_ns,
        "sensor": names(log.source, list(log.sensors)),
        "verdict": names(log.verdict, [verdict.name.lower() for verdict in Verdict]),
        "reason": names(log.reason, [reason.name.lower() for reason in Reason]),
        "dof": log.dof,
    }
    for axis in range(3):
        columns[f"innovation_{axis}"] = np.ascontiguousarray(log.innovation[:, axis])
        columns[f"variance_{axis}"] = np.ascontiguousarray(log.variance[:, axis])
    columns |= {"nis": log.nis, "gate": log.gate, "weight": log.weight}
    floats = [name for name, values in columns.items() if getattr(values, "dtype", None) == np.float64]
    parquet.write_table(
        pa.table(columns),
        path,
        compression="zstd",
        use_dictionary=False,
        column_encoding=dict.fromkeys(floats, "BYTE_STREAM_SPLIT"),
    )
