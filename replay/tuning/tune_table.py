"""What tuning prints, and the file it writes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.strict_toml import dump
from axialnav.replay.flight import Flight
from axialnav.replay.table import aligned
from axialnav.replay.tuning.tune import Score, Tuned, Tuning, tuned_config

STRONG_CORRELATION = 0.9


def summary(tuning: Tuning) -> str:
    """Settings before and after with standard errors, warnings, and the flights before and after."""
    lines = [f"search     {tuning.evaluations} replays in {tuning.search_s:.1f} s"]
    rows = [_cells(t) for t in tuning.tuned]
    lines += aligned([["setting", "before", "after", "error", ""], *rows], left=(0, 4))
    lines += _couples(tuning)
    lines += ["", *_scores(tuning.scores)]
    return "\n".join(lines)


def _cells(tuned: Tuned) -> list[str]:
    start, kept = _number(tuned.parameter.start), _number(_kept(tuned))
    return [tuned.parameter.name, start, kept, error_words(tuned), _remark(tuned)]


def error_words(tuned: Tuned) -> str:
    """Standard error: a factor for what is searched as a logarithm."""
    if not math.isfinite(tuned.sigma):
        return "unknown"
    return f"x/: {math.exp(tuned.sigma):.2f}" if tuned.parameter.is_log else f"+- {tuned.sigma:.2g}"


def _kept(tuned: Tuned) -> float:
    return tuned.parameter.start if tuned.unidentifiable else tuned.value


def _remark(tuned: Tuned) -> str:
    if tuned.unidentifiable:
        return "not determined by these flights: left as it was"
    return "at its bound: the flights ask for more, look at the data" if tuned.at_bound else ""


def _couples(tuning: Tuning) -> Iterator[str]:
    names = [t.parameter.name for t in tuning.tuned]
    for i, j in zip(*np.nonzero(np.tril(np.abs(tuning.correlation), -1) > STRONG_CORRELATION), strict=True):
        yield f"coupled    {names[i]} and {names[j]} ({tuning.correlation[i, j]:+.2f}): only their combination is known"


def _scores(scores: Sequence[Score]) -> Iterator[str]:
    head = ["flight", "", "log-likelihood", "velocity RMSE", "sensor", "mean NIS", "lag-1", "gated"]
    rows = [head]
    for score in scores:
        rmse = [_velocity_rmse(m) for m in (score.before, score.after)]
        per = score.gain_nats / max(score.readings, 1.0)
        row = [score.flight, "held out" if score.held_out else "", f"{score.gain_nats:+.1f} ({per:+.3f} a reading)"]
        row.append(_pair(rmse, ".3f"))
        for name, after in score.after["sensors"].items():
            before = score.before["sensors"][name]
            if not after["disabled"]:
                both = (before, after)
                cells = [
                    name,
                    _pair([s["mean_nis"] for s in both], ".2f"),
                    _pair([s["lag1"] for s in both], "+.2f"),
                    _pair([_gated(s) for s in both], ".1%"),
                ]
                rows.append([*row, *cells])
                row = [""] * 4
        if row[0]:
            rows.append([*row, "", "", "", ""])
    yield from aligned(rows, left=(0, 1, 4))


def _velocity_rmse(metrics: dict[str, Any]) -> float | None:
    """Of the axial velocity; of the horizontal speed where there is only GPS."""
    axial: float | None = metrics["axial_velocity_m_s"]["rmse"]
    speed: float | None = metrics["horizontal_speed_rmse_m_s"]
    return speed if axial is None else axial


def _gated(sensor: dict[str, Any]) -> float | None:
    compared = sensor["fused"] + sensor["gated"]
    return sensor["gated"] / compared if compared else None


def _pair(values: Sequence[float | None], form: str) -> str:
    before, after = ("-" if value is None else format(value, form) for value in values)
    return f"{before} -> {after}"


def _number(value: float) -> str:
    return f"{value:.4g}"


def config_text(tuning: Tuning, config: Config | None, flights: Sequence[Flight]) -> str:
    """The TOML file: found settings, with where they come from in comments."""
    lines = [
        "# Found by axialnav tune; give it to axialnav replay --config.",
        f"# Flights: {', '.join(flight.name for flight in flights)}",
        *(f"# {'   '.join(_cells(t))}".rstrip() for t in tuning.tuned),
    ]
    return "\n".join([*lines, "", dump(tuned_config(config, flights[0], tuning.values))])
