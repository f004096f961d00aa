"""What became of each sensor's readings, and whether its innovations look like the filter expected."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.outcome import REASONS, InnovationLog, Reason, Track, Verdict
from axialnav.fusion.sources import Kind, counts_as_fewer, kind_of
from axialnav.replay.series import lag1_autocorrelation

if TYPE_CHECKING:
    from axialnav.replay.flight import SensorTable

Array = NDArray[np.float64]


def fusable(config: Config, tables: Mapping[str, SensorTable]) -> tuple[str, ...]:
    """Names of the sensors whose readings are compared with a prediction, in the order of the tables."""
    kinds = {name: kind_of(spec) for name, spec in config.sensor.items()}
    return tuple(name for name in tables if kinds.get(name) not in (None, Kind.IMU))


def sensor_metrics(
    track: Track, log: InnovationLog, tables: Mapping[str, SensorTable], config: Config
) -> dict[str, dict[str, Any]]:
    """Counts, normalised innovations and silences per sensor.

    Beside the keys of the contract: ``reasons`` (count per sentence, fused ones apart), ``unprocessed`` (readings that
    never reached the filter, e.g. before the first IMU sample), ``disabled``, and ``correlated`` (neighbouring readings
    are known to err alike and count as fewer).
    """
    result: dict[str, dict[str, Any]] = {}
    for name in fusable(config, tables):
        chosen = log.source == log.sensors.index(name) if name in log.sensors else np.zeros(log.t_ns.size, dtype=bool)
        result[name] = _one(track, log, np.flatnonzero(chosen), int(tables[name].t_ns.size), config, name)
    return result


def _one(
    track: Track, log: InnovationLog, rows: NDArray[np.int64], available: int, config: Config, name: str
) -> dict[str, Any]:
    verdict = log.verdict[rows]
    counts = {kind.name.lower(): int((verdict == kind).sum()) for kind in Verdict}
    disabled = name in config.disabled
    fused_t_ns = log.t_ns[rows[verdict == Verdict.FUSED]]
    return {
        "available": available,
        **counts,
        "mean_nis": mean_nis(log, rows),
        "lag1": lag1(log, rows),
        "timeouts": [] if disabled else silences(track.t_ns, fused_t_ns, config.supervisor.timeout_s),
        "reasons": _reasons(log.reason[rows]),
        "unprocessed": 0 if disabled else available - int(rows.size),
        "disabled": disabled,
        "correlated": counts_as_fewer(config.sensor[name], config),
    }


def mean_nis(log: InnovationLog, rows: NDArray[np.int64]) -> float | None:
    """Mean over fused and gated readings of NIS per degree of freedom; 1 where the noise is told right.

    The NIS of a gated reading counts as the gate itself: reflections of any size weigh the same, and refusing readings
    is still not rewarded.  Blind, late, suspect and invalid readings were never compared on equal terms and stay out.
    """
    gated = log.verdict[rows] == Verdict.GATED
    chosen = (log.verdict[rows] == Verdict.FUSED) | gated
    nis = np.where(gated, np.minimum(log.nis[rows], log.gate[rows]), log.nis[rows]) / np.maximum(log.dof[rows], 1)
    nis = nis[chosen & np.isfinite(nis)]
    return float(nis.mean()) if nis.size else None


def lag1(log: InnovationLog, rows: NDArray[np.int64]) -> float | None:
    """Lag-1 autocorrelation of the fused normalised innovations in the order of processing, mean over the axes."""
    fused = rows[log.verdict[rows] == Verdict.FUSED]
    with np.errstate(invalid="ignore", divide="ignore"):
        normalised = log.innovation[fused] / np.sqrt(log.variance[fused])
    per_axis = [lag1_autocorrelation(axis[np.isfinite(axis)]) for axis in normalised.T]
    known = [value for value in per_axis if value is not None]
    return float(np.mean(known)) if known else None


def silences(track_t_ns: NDArray[np.int64], fused_t_ns: NDArray[np.int64], timeout_s: float) -> list[list[float]]:
    """Intervals longer than the time-out in which nothing of the sensor was fused, [s] after the first IMU sample.

    track_t_ns : (n,) stamps of the track; its ends bound the flight.  fused_t_ns : (k,) in any order.
    """
    if track_t_ns.size == 0:
        return []
    edges = np.concatenate((track_t_ns[:1], np.sort(fused_t_ns), track_t_ns[-1:]))
    seconds = (np.clip(edges, track_t_ns[0], track_t_ns[-1]) - track_t_ns[0]) * 1e-9
    return [[float(seconds[i]), float(seconds[i + 1])] for i in np.flatnonzero(np.diff(seconds) > timeout_s)]


def _reasons(reason: NDArray[np.int64]) -> dict[str, int]:
    values, counts = np.unique(reason, return_counts=True)
    named = zip(values.tolist(), counts.tolist(), strict=True)
    return {REASONS[Reason(value)]: count for value, count in named if value != Reason.NONE}
