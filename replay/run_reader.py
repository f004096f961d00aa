"""Run folders read back: the numbers for checks, the estimate for comparisons."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from axialnav.fusion.errors import FlightError
from axialnav.replay.fused import Column, digest

INTEGER_COLUMNS = ("t_ns", "flags")
MAX_JSON_BYTES = 64_000_000


@dataclass(frozen=True)
class StoredRun:
    """A run folder in memory.

    Attributes
    ----------
    name
        Path as given, for tables and errors.
    columns
        Columns of ``fused.csv``, at least ``t_ns``.
    metrics
        ``metrics.json``, or None where the folder has none (a recording from the vehicle).
    digest
        Over the numbers in ``fused.csv``.
    """

    name: str
    columns: dict[str, Column]
    metrics: dict[str, Any] | None
    digest: str


def read_metrics(run: Path) -> dict[str, Any]:
    """Numbers of a run; ``run`` is its folder or the file itself.

    Raises
    ------
    FlightError
        There is no such file, or it does not hold a JSON object.
    """
    path = run / "metrics.json" if run.is_dir() else run
    try:
        if path.stat().st_size > MAX_JSON_BYTES:
            raise FlightError(f"{path}: {path.stat().st_size} bytes, no metrics.json is larger than {MAX_JSON_BYTES}")
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FlightError(f"{path}: {error.strerror}; give a run folder that axialnav replay has written") from None
    except (ValueError, RecursionError):
        raise FlightError(f"{path}: not valid JSON; write the run again with axialnav replay") from None
    if not isinstance(found, dict):
        raise FlightError(f"{path}: holds a {type(found).__name__}, not the numbers of a run")
    return found


def read_run(run: Path) -> StoredRun:
    """A run folder, or the folder of a recording that has a ``fused.csv`` alone.

    Raises
    ------
    FlightError
        No ``fused.csv``, or one that cannot be read.
    """
    columns = read_fused_csv(run / "fused.csv")
    metrics = read_metrics(run) if (run / "metrics.json").exists() else None
    return StoredRun(str(run), columns, metrics, digest(columns))


def read_fused_csv(path: Path) -> dict[str, Column]:
    """Columns of a ``fused.csv``; integers stay integers, the rest float64 to the last bit.

    Raises
    ------
    FlightError
        The file is absent, empty, cut in the middle of a line, or holds something else.
    """
    import pyarrow as pa
    from pyarrow import csv

    try:
        with path.open("rb") as file:
            names = file.readline(10_000).decode("utf-8").strip().split(",")
        if "t_ns" not in names:
            raise FlightError(f"{path}: the first line names no column t_ns; is this a fused.csv?")
        kinds = {name: pa.int64() if name in INTEGER_COLUMNS else pa.float64() for name in names}
        table = csv.read_csv(path, convert_options=csv.ConvertOptions(column_types=kinds, null_values=[]))
    except OSError as error:
        raise FlightError(f"{path}: {error.strerror}; give a run folder that axialnav replay has written") from None
    except (UnicodeDecodeError, pa.ArrowInvalid) as error:
        raise FlightError(f"{path}: not a readable fused.csv ({str(error)[:120]})") from None
    if table.num_rows == 0:
        raise FlightError(f"{path}: no rows; nothing was estimated in this run")
    columns: dict[str, Column] = {name: table.column(name).to_numpy() for name in table.column_names}
    if np.any(np.diff(columns["t_ns"]) < 0):
        raise FlightError(f"{path}: stamps run backwards; sort the rows by t_ns")
    return columns
