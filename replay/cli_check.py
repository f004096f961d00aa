"""The verbs ``check`` and ``compare``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.cli_output import emit

if TYPE_CHECKING:
    from axialnav.replay.checks import Checked
    from axialnav.replay.compare import Comparison, Difference

Flag = Annotated[bool, Parameter(negative=())]


def check(run: Path, /, *, limits: Path | None = None, json: Flag = False) -> int:
    """Compare the numbers of a run with limits and give a verdict: PASS, WARN, FAIL or NOT_EVALUATED.

    Exit code 0: passed, warnings included. 1: a check failed. 3: nothing was evaluated, or a required check was not.

    Parameters
    ----------
    run
        Run folder, or a metrics.json.
    limits
        TOML file with one [check.NAME] table per check; the limits that come with axialnav if not given.
    json
        Print JSON instead of the table.
    """
    from axialnav.replay.checks import EXIT_CODES, check_metrics, verdict
    from axialnav.replay.limits_file import read_limits
    from axialnav.replay.run_reader import read_metrics

    checks = check_metrics(read_metrics(run), read_limits(limits))
    overall = verdict(checks)
    source = str(limits) if limits else "default"
    if json:
        emit(_checks_json(checks, str(run), source, overall))
    else:
        emit("\n".join(_checks_table(checks, str(run), source, overall)))
    return EXIT_CODES[overall]


def _counts(checks: list[Checked]) -> dict[str, int]:
    from axialnav.replay.checks import Judgement

    return {str(kind): sum(c.judgement is kind for c in checks) for kind in Judgement}


def _checks_json(checks: list[Checked], run: str, limits: str, overall: str) -> str:
    from dataclasses import asdict

    from axialnav.replay.run_folder import metrics_text

    rows = [{**asdict(c), "judgement": str(c.judgement)} for c in checks]
    head: dict[str, Any] = {"run": run, "limits": limits, "verdict": str(overall), "counts": _counts(checks)}
    return metrics_text({**head, "checks": rows}).rstrip("\n")


def _checks_table(checks: list[Checked], run: str, limits: str, overall: str) -> list[str]:
    from axialnav.replay.table import aligned

    rows = [["verdict", "check", "value", "limits", ""]]
    for c in checks:
        value = "-" if c.value is None else f"{c.value:.4g}"
        remark = c.reason if c.judgement != "PASS" else ""
        rows.append([str(c.judgement), c.name, value, c.limit, remark])
    lines = [f"run        {run}", f"limits     {limits}", *aligned(rows, left=(0, 1, 3, 4))]
    counts = "   ".join(f"{kind} {count}" for kind, count in _counts(checks).items())
    return [*lines, f"{counts}   verdict {overall}"]


def compare(*runs: Path, tolerance: float | None = None, json: Flag = False) -> int:
    """Compare runs with the first one: the largest difference of every channel, and when.

    Equal digests are said first and settle the matter. Without --tolerance differences are shown and the exit code is
    0; with it, a difference beyond it is a failed check (exit code 1). 3: the runs have no instant in common.

    Parameters
    ----------
    runs
        Two run folders or more; a folder with nothing but a fused.csv (a recording of the vehicle) will do.
    tolerance
        Largest difference allowed in every channel, in its own unit (m, m/s, rad); 0 asks for equal bits.
    json
        Print JSON instead of the table.
    """
    from axialnav.replay.compare import compare_runs
    from axialnav.replay.run_reader import read_run

    if len(runs) < 2:
        raise ConfigError(f"compare needs two run folders or more, got {len(runs)}")
    if tolerance is not None and not 0.0 <= tolerance < math.inf:
        raise ConfigError(f"--tolerance must be 0 or more and finite, got {tolerance:g}")
    first, *others = (read_run(run) for run in runs)
    comparisons = [compare_runs(first, other) for other in others]
    for comparison in comparisons:
        if not comparison.compared:
            raise FlightError(f"{comparison.first} and {comparison.second} have no instant in common; nothing compared")
    if json:
        emit(_comparisons_json(comparisons, tolerance))
    else:
        emit("\n".join(line for c in comparisons for line in _comparison_table(c, tolerance)))
    return int(tolerance is not None and any(c.beyond(tolerance) for c in comparisons))


def _comparisons_json(comparisons: list[Comparison], tolerance: float | None) -> str:
    from dataclasses import asdict

    from axialnav.replay.run_folder import metrics_text

    rows = [asdict(c) for c in comparisons]
    for row, c in zip(rows, comparisons, strict=True):
        row["beyond_tolerance"] = None if tolerance is None else [d.channel for d in c.beyond(tolerance)]
    return metrics_text({"tolerance": tolerance, "comparisons": rows}).rstrip("\n")


def _comparison_table(comparison: Comparison, tolerance: float | None) -> list[str]:
    from axialnav.replay.table import aligned

    head = f"compare    {comparison.second} with {comparison.first}"
    if comparison.identical:
        return [head, f"identical  same digest: every number of {comparison.rows} rows is equal"]
    share = 100.0 * comparison.compared / comparison.rows
    stamps = "equal stamps" if comparison.exact_stamps else "stamps differ: interpolated where needed"
    lines = [head, f"rows       compared {comparison.compared}/{comparison.rows} ({share:.0f} %), {stamps}"]
    columns = ["channel", "largest difference", "at", "RMS", "in sigma", ""]
    over = set() if tolerance is None else {d.channel for d in comparison.beyond(tolerance)}
    lines += aligned([columns, *(_difference_cells(d, over) for d in comparison.differences)], left=(0, 5))
    if tolerance is not None:
        verdict = f"FAIL: {len(over)} channels beyond {tolerance:g}" if over else f"PASS: all within {tolerance:g}"
        lines.append(f"tolerance  {verdict}")
    return lines


def _difference_cells(d: Difference, over: set[str]) -> list[str]:
    if d.largest == 0.0:
        return [d.channel, "0", "-", "0", "-", "equal"]
    if d.channel == "flags":
        return ["flags", f"{100.0 * d.largest:.2g} % of rows", f"{d.at_s:.2f} s", "-", "-", _mark(d, over)]
    sigma = "-" if d.in_sigma is None else f"{d.in_sigma:.2g}"
    return [d.channel, f"{d.largest:.3g}", f"{d.at_s:.2f} s", f"{d.rms:.3g}", sigma, _mark(d, over)]


def _mark(d: Difference, over: set[str]) -> str:
    return "beyond tolerance" if d.channel in over else ""
