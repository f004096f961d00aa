"""Sentences about a run that a person should read before believing its numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

MIN_COVERAGE = 0.95
MANY_GATED = 0.1
NOTABLE_LAG1 = 0.1  # a smaller correlation may be real, but is of no consequence


def nees_verdict(metrics: dict[str, Any]) -> str:
    """Word for the mean NEES against its band: consistent, overconfident (too large) or pessimistic (too small)."""
    low, high = metrics["nees_velocity_band"]
    if metrics["nees_velocity"] > high:
        return "overconfident"
    return "pessimistic" if metrics["nees_velocity"] < low else "consistent"


def findings(metrics: dict[str, Any]) -> list[str]:
    """What stands out, the gravest first: coverage, consistency, conditions, silent or refused sensors, whiteness."""
    return [*_coverage(metrics), *_consistency(metrics), *_condition(metrics), *_sensors(metrics), *_whiteness(metrics)]


def _coverage(metrics: dict[str, Any]) -> Iterator[str]:
    used, available = metrics["reference"]["used"], metrics["reference"]["available"]
    if used == 0:
        yield "Nothing was scored: there is no reference inside the scoring window."
    elif used < MIN_COVERAGE * available:
        share = 100.0 * used / available
        yield f"Only {used} of {available} samples were scored ({share:.0f} %): the reference has gaps."
    if metrics["alignment"] == "rigid":
        yield "The world frames are unrelated: position and velocity were scored after a rigid alignment."


def _consistency(metrics: dict[str, Any]) -> Iterator[str]:
    if metrics["nees_velocity"] is None:
        return
    verdict = nees_verdict(metrics)
    if verdict != "consistent":
        low, high = metrics["nees_velocity_band"]
        size = math.sqrt(metrics["nees_velocity"] / 3.0)
        yield (
            f"The velocity covariance is {verdict}: mean NEES {metrics['nees_velocity']:.2f} is outside "
            f"{low:.2f}..{high:.2f}; errors are {size:.2f} times what the filter states."
        )


def _condition(metrics: dict[str, Any]) -> Iterator[str]:
    for name, share in metrics["health"].items():
        yield f"Condition '{name.replace('_', ' ')}' during {100.0 * share:.1f} % of the flight."
    if metrics["resets"]:
        yield f"The position was re-anchored {metrics['resets']} time{'s' * (metrics['resets'] > 1)}."


def _sensors(metrics: dict[str, Any]) -> Iterator[str]:
    for name, sensor in metrics["sensors"].items():
        if sensor["disabled"]:
            yield f"{name} was switched off."
        else:
            yield from (f"{name}: {words}" for words in _sensor(sensor))


def _sensor(sensor: dict[str, Any]) -> Iterator[str]:
    if sensor["timeouts"]:
        longest = max(end - start for start, end in sensor["timeouts"])
        count = len(sensor["timeouts"])
        times = "once" if count == 1 else f"{count} times"
        yield f"not fused for longer than its time-out {times} (longest {longest:.1f} s)."
    compared = sensor["fused"] + sensor["gated"]
    if sensor["gated"] > MANY_GATED * compared:
        yield f"{100.0 * sensor['gated'] / compared:.0f} % of the readings were gated."


def _whiteness(metrics: dict[str, Any]) -> Iterator[str]:
    coloured = [f"{name} {s['lag1']:+.2f}" for name, s in metrics["sensors"].items() if _is_coloured(s)]
    if coloured:
        yield (
            f"Innovations are not white (lag-1 {', '.join(coloured)}): errors that last longer than one "
            f"reading, or noise told wrong."
        )


def _is_coloured(sensor: dict[str, Any]) -> bool:
    limit = max(2.0 / math.sqrt(max(sensor["fused"], 1)), NOTABLE_LAG1)
    return sensor["lag1"] is not None and abs(sensor["lag1"]) > limit
