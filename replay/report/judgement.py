"""The verdict on a run for the top of the page: the default limits of ``axialnav check``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from axialnav.replay.checks import Checked, Judgement, check_metrics, verdict
from axialnav.replay.limits_file import read_limits

WORST_FIRST = (Judgement.FAIL, Judgement.WARN, Judgement.NOT_EVALUATED, Judgement.PASS)
MEANING = {
    Judgement.PASS: "every check that could be made lies within its limits",
    Judgement.WARN: "nothing failed, but some numbers ask for a look",
    Judgement.FAIL: "at least one number is beyond its limit: do not fly on this",
    Judgement.NOT_EVALUATED: "nothing, or not enough, could be checked: this is no pass",
}


@dataclass(frozen=True, slots=True)
class Row:
    """One check as texts for a table; ``kind`` is its judgement."""

    kind: str
    name: str
    value: str
    limit: str
    remark: str


def judge(metrics: dict[str, Any]) -> dict[str, Any]:
    """Overall verdict with its meaning, the number of checks by judgement, and the rows: what stands out, the rest."""
    checks = check_metrics(metrics, read_limits())
    overall = verdict(checks)
    rows = [_row(c) for kind in WORST_FIRST for c in checks if c.judgement is kind]
    loud = {str(Judgement.FAIL), str(Judgement.WARN)}
    return {
        "verdict": str(overall),
        "meaning": MEANING[overall],
        "counts": [(str(kind), sum(c.judgement is kind for c in checks)) for kind in WORST_FIRST],
        "loud": [row for row in rows if row.kind in loud],
        "quiet": [row for row in rows if row.kind not in loud],
    }


def _row(check: Checked) -> Row:
    value = "-" if check.value is None else f"{check.value:.4g}"
    return Row(str(check.judgement), check.name, value, check.limit, check.reason)
