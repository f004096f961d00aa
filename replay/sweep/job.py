"""One job of a sweep: replay a recording and say what came out, as one flat row."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from axialnav.fusion.config import Config
from axialnav.fusion.errors import AxialnavError
from axialnav.fusion.strict_toml import parse
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.sweep.plan import Job

KEPT_FLIGHTS = 2


def run_job(job: Job) -> dict[str, Any]:
    """Row of a job: what it was, its digest and scores; or its error in one line.

    A recording that cannot be replayed is a result too: the other jobs go on.
    """
    row: dict[str, Any] = {"key": job.key, "log": job.log, **{f"param.{name}": value for name, value in job.params}}
    try:
        return {**row, "error": None, **_scores(job)}
    except (AxialnavError, OSError) as error:
        return {**row, "error": " ".join(str(error).split())}


def _scores(job: Job) -> dict[str, Any]:
    from axialnav.replay.run import replay

    config = None if job.config is None else Config.from_dict(parse(job.config, where="--config"), where="--config")
    run = replay(
        _flight(job.log, job.mapping, _changed_ns(job.log), _changed_ns(job.mapping)),
        config,
        without=job.without,
        params=dict(job.params),
        estimator=job.estimator,
    )
    metrics = run.metrics
    axial = {f"axial_{key}": value for key, value in metrics["axial_velocity_m_s"].items()}
    sensors = {
        f"{name}.{key}": sensor[key]
        for name, sensor in metrics["sensors"].items()
        for key in ("available", "fused", "gated", "mean_nis", "lag1")
    }
    return {
        "flight": metrics["flight"],
        "digest": metrics["digest"],
        "reference_used": metrics["reference"]["used"],
        **axial,
        "position_rmse_3d_m": metrics["position_rmse_3d_m"],
        "horizontal_speed_rmse_m_s": metrics["horizontal_speed_rmse_m_s"],
        "nees_velocity": metrics["nees_velocity"],
        "resets": metrics["resets"],
        "flight_s": metrics["timing"]["flight_s"],
        "wall_s": metrics["timing"]["wall_s"],
        **sensors,
    }


@functools.lru_cache(KEPT_FLIGHTS)
def _flight(log: str, mapping: str | None, *_: int) -> Flight:
    """A recording stays in memory while its settings are varied and its files stay as they are."""
    return load_flight(log, mapping=mapping)


def _changed_ns(path: str | None) -> int:
    """When a file was changed [ns]: workers of a cluster live longer than a file may stay as it is."""
    return Path(path).stat().st_mtime_ns if path is not None and Path(path).exists() else 0
