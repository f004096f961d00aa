"""Verdicts on a run: its numbers against limits.

A number that is not there is NOT_EVALUATED, never PASS: a check that used no data is worse than one that failed.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from axialnav.replay.limits_file import Limit


class Judgement(StrEnum):
    """Outcome of a check, best first."""

    PASS = "PASS"
    WARN = "WARN"
    FAIL = "FAIL"
    NOT_EVALUATED = "NOT_EVALUATED"


EXIT_CODES = {Judgement.PASS: 0, Judgement.WARN: 0, Judgement.FAIL: 1, Judgement.NOT_EVALUATED: 3}


@dataclass(frozen=True, slots=True)
class Checked:
    """One check on one number.

    Attributes
    ----------
    name
        Name of the check, and in brackets what ``*`` stood for.
    value
        What was compared, None if there was nothing.
    judgement
        PASS, WARN, FAIL or NOT_EVALUATED.
    limit
        The limits in words.
    reason
        Why it was not evaluated, or what the check is good for.
    required
        Whether the whole verdict needs it.
    """

    name: str
    value: float | None
    judgement: Judgement
    limit: str
    reason: str
    required: bool


class _AbsentError(Exception):
    """No number to compare; the message says why."""


def check_metrics(metrics: Mapping[str, Any], limits: Mapping[str, Limit]) -> list[Checked]:
    """Compare the numbers of ``metrics.json`` with limits, in the order of the limits."""
    return [checked for name, limit in limits.items() for checked in _check(name, limit, metrics)]


def verdict(checks: Sequence[Checked]) -> Judgement:
    """Verdict on the run: NOT_EVALUATED if nothing was, or if a required check was not; else the worst of the rest."""
    evaluated = [c.judgement for c in checks if c.judgement is not Judgement.NOT_EVALUATED]
    missed = any(c.required and c.judgement is Judgement.NOT_EVALUATED for c in checks)
    if missed or not evaluated:
        return Judgement.NOT_EVALUATED
    return max(evaluated, key=list(Judgement).index)


def _check(name: str, limit: Limit, metrics: Mapping[str, Any]) -> Iterator[Checked]:
    words = _in_words(limit, metrics, ())
    try:
        stars = list(_expand(metrics, limit.metric.split("."), ()))
    except _AbsentError as error:
        yield Checked(name, None, Judgement.NOT_EVALUATED, words, str(error), limit.required)
        return
    for star in stars:
        label = f"{name} ({', '.join(star)})" if star else name
        try:
            value = _value(limit, metrics, star)
            judgement = _judge(limit, metrics, star, value)
        except _AbsentError as error:
            yield Checked(label, None, Judgement.NOT_EVALUATED, words, str(error), limit.required)
        else:
            yield Checked(label, value, judgement, _in_words(limit, metrics, star), limit.why, limit.required)


def _expand(node: Any, keys: Sequence[str], star: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield what the stars of a path can stand for."""
    if "*" not in keys:
        yield star
        return
    place = keys.index("*")
    table = _walk(node, keys[:place])
    if not isinstance(table, Mapping) or not table:
        raise _AbsentError(f"no {'.'.join(keys[:place])} in this run")
    for key, below in table.items():
        yield from _expand(below, keys[place + 1 :], (*star, key))


def _walk(node: Any, keys: Sequence[str]) -> Any:
    for depth, key in enumerate(keys):
        if not isinstance(node, Mapping) or key not in node:
            known = list(node) if isinstance(node, Mapping) else []
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise _AbsentError(f"no {'.'.join(keys[: depth + 1])} in metrics.json{hint}")
        node = node[key]
    return node


def _look_up(metrics: Mapping[str, Any], path: str, star: tuple[str, ...]) -> Any:
    filling = iter(star)
    return _walk(metrics, [next(filling, key) if key == "*" else key for key in path.split(".")])


def _value(limit: Limit, metrics: Mapping[str, Any], star: tuple[str, ...]) -> float:
    for path in (limit.unless,) if isinstance(limit.unless, str) else limit.unless:
        if _look_up(metrics, path, star):
            raise _AbsentError(f"skipped because of {path.rpartition('.')[2]}")
    value = _number(limit, _look_up_or_default(limit, metrics, star))
    if limit.divided_by:
        total = sum(_finite(_look_up(metrics, path, star)) for path in limit.divided_by)
        if total == 0.0:
            raise _AbsentError(f"nothing to divide by: {' + '.join(limit.divided_by)} is 0")
        value /= total
    return value


def _look_up_or_default(limit: Limit, metrics: Mapping[str, Any], star: tuple[str, ...]) -> Any:
    if limit.if_absent is not None:
        table, _, key = limit.metric.rpartition(".")
        holder = _look_up(metrics, table, star) if table else metrics
        if isinstance(holder, Mapping) and key not in holder:
            return limit.if_absent
    return _look_up(metrics, limit.metric, star)


def _number(limit: Limit, found: Any) -> float:
    if limit.take in {"count", "longest", "total"}:
        if not isinstance(found, list):
            raise _AbsentError("not a list of intervals")
        if limit.take == "count":
            return float(len(found))
        lengths = [_finite(end) - _finite(start) for start, end in found]
        return float(max(lengths, default=0.0) if limit.take == "longest" else sum(lengths))
    value = _finite(found)
    return abs(value) if limit.take == "size" else value


def _finite(found: Any) -> float:
    if found is None:
        raise _AbsentError("nothing was evaluated in this run")
    if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
        raise _AbsentError(f"not a finite number: {str(found)[:40]}")
    return float(found)


def _band(limit: Limit, metrics: Mapping[str, Any], star: tuple[str, ...]) -> tuple[float, float]:
    if limit.warn_outside is None:
        return -math.inf, math.inf
    band = _look_up(metrics, limit.warn_outside, star)
    if not isinstance(band, list) or len(band) != 2:
        raise _AbsentError(f"{limit.warn_outside} is not a pair of numbers in this run")
    return _finite(band[0]), _finite(band[1])


def _judge(limit: Limit, metrics: Mapping[str, Any], star: tuple[str, ...], value: float) -> Judgement:
    low, high = _band(limit, metrics, star)
    if _beyond(value, limit.fail_below, limit.fail_above):
        return Judgement.FAIL
    if _beyond(value, limit.warn_below, limit.warn_above) or not low <= value <= high:
        return Judgement.WARN
    return Judgement.PASS


def _beyond(value: float, low: float | None, high: float | None) -> bool:
    return (low is not None and value < low) or (high is not None and value > high)


def _in_words(limit: Limit, metrics: Mapping[str, Any], star: tuple[str, ...]) -> str:
    named = (("warn <", limit.warn_below), ("fail <", limit.fail_below))
    above = (("warn >", limit.warn_above), ("fail >", limit.fail_above))
    words = [f"{word} {bound:g}" for word, bound in (*named, *above) if bound is not None]
    if limit.warn_outside is not None:
        try:
            low, high = _band(limit, metrics, star)
            words.insert(0, f"warn outside {low:.3g}..{high:.3g}")
        except _AbsentError:
            words.insert(0, f"warn outside {limit.warn_outside}")
    return ", ".join(words)
