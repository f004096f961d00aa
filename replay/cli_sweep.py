"""The verb ``sweep``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError
from axialnav.replay.cli_output import emit, progress_bar
from axialnav.replay.cli_tune import write_text

Names = Annotated[list[str] | None, Parameter(negative=(), consume_multiple=False)]


COLUMNS = {
    "axial_rmse": "axial RMSE",
    "horizontal_speed_rmse_m_s": "speed RMSE",
    "position_rmse_3d_m": "position RMSE",
    "nees_velocity": "NEES",
}


def sweep(
    *logs: Path,
    param: Names = None,
    workers: int | None = None,
    scheduler: str | None = None,
    out: Path = Path("runs/sweep"),
    config: Path | None = None,
    without: Names = None,
    estimator: str = "corridor",
    mapping: Path | None = None,
) -> int:
    """Replay many flights with many settings, on this machine or on a Dask cluster.

    Writes results.parquet (one row per replay, with its digest) and summary.html. A sweep that was killed goes on where
    it was when it is started again with the same --out. Exit code 1: some flights could not be replayed; 3: none could.

    Parameters
    ----------
    logs
        Flights, one or more.
    param
        One setting and its values as NAME=V1,V2,...; may be repeated, all combinations are replayed.
    workers
        Local processes; the number of cores if not given.
    scheduler
        Address of a Dask scheduler, e.g. tcp://10.0.0.1:8786, instead of local processes. Its workers need axialnav
        and the flights under the same paths.
    out
        Folder of the sweep.
    config
        TOML file with settings for all replays.
    without
        Sensors to switch off, separated by commas.
    estimator
        Which filter: corridor or axial.
    mapping
        TOML file that says which topics and fields of the logs are which sensor; for logs of one kind.
    """
    from axialnav.fusion.config import Config
    from axialnav.replay.run import ESTIMATORS
    from axialnav.replay.sweep.page import sweep_page
    from axialnav.replay.sweep.plan import parse_grid, plan
    from axialnav.replay.sweep.sweep import sweep as run_sweep

    grid = parse_grid(param or ())
    if workers is not None and workers < 1:
        raise ConfigError(f"--workers must be 1 or more, got {workers}")
    if estimator not in ESTIMATORS:
        raise ConfigError(f"no estimator named {estimator!r}; there are {', '.join(ESTIMATORS)}")
    text = Config.from_toml(config).to_toml() if config else None
    names = [name.strip() for item in without or () for name in item.split(",") if name.strip()]
    jobs = plan(logs, grid, config_text=text, without=names, estimator=estimator, mapping=mapping)
    with progress_bar("sweep") as progress:
        done = run_sweep(jobs, out, workers=workers or os.cpu_count() or 1, scheduler=scheduler, progress=progress)
    write_text(out / "summary.html", sweep_page(done.rows))
    emit("\n".join(_table(done.rows, done.done_before, out)))
    failed = sum(row["error"] is not None for row in done.rows)
    return 0 if not failed else 3 if failed == len(done.rows) else 1


def _table(rows: list[dict[str, Any]], before: int, out: Path) -> list[str]:
    from axialnav.replay.sweep.page import by_settings
    from axialnav.replay.table import aligned

    good = [row for row in rows if row["error"] is None]
    cells = [["settings", "flights", *COLUMNS.values()]]
    for params, count, means in by_settings(good):
        name = ", ".join(f"{k}={v}" for k, v in params.items()) or "as configured"
        scores = [means[key] for key in COLUMNS]
        cells.append([name, str(count), *("-" if value is None else f"{value:.4g}" for value in scores)])
    lines = [f"sweep      {len(rows)} replays, {before} of them done before, {len(rows) - len(good)} failed"]
    lines += aligned(cells) if good else []
    lines += [f"failed     {row['log']}: {row['error']}" for row in rows if row["error"] is not None]
    return [*lines, f"written    {out / 'results.parquet'}, {out / 'summary.html'}"]
