"""The summary page of a sweep: one HTML file that loads nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

SCORES = (
    "axial_rmse",
    "axial_mean_error",
    "axial_in_3_sigma",
    "horizontal_speed_rmse_m_s",
    "position_rmse_3d_m",
    "nees_velocity",
    "resets",
)
STYLE = """
:root { color-scheme: light dark; font: 15px/1.45 system-ui, sans-serif; }
body { margin: 2rem auto; max-width: 70rem; padding: 0 1rem; }
table { border-collapse: collapse; } th, td { padding: .25rem .7rem; text-align: right; }
th { border-bottom: 1px solid; } td:first-child, th:first-child { text-align: left; }
tr:nth-child(even) { background: color-mix(in srgb, currentColor 6%, transparent); }
.best { font-weight: 700; } .bad { color: #c0392b; text-align: left; } .wide { overflow-x: auto; }
code { font-size: .9em; }
"""


def sweep_page(rows: Sequence[dict[str, Any]]) -> str:
    """Settings averaged over the recordings first, then every replay, then what failed."""
    failed = [row for row in rows if row["error"]]
    good = [row for row in rows if not row["error"]]
    head = f"{len(rows)} replays, {len({row['log'] for row in rows})} recordings, {len(failed)} failed"
    body = [f"<h1>axialnav sweep</h1><p>{head}</p>", *_settings(good), *_replays(good), *_failures(failed)]
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>axialnav sweep</title><style>{STYLE}</style><body>{''.join(body)}</body></html>\n"
    )


def by_settings(rows: Sequence[dict[str, Any]]) -> list[tuple[dict[str, str], int, dict[str, float | None]]]:
    """Each combination of settings: how many recordings it was replayed with, and the mean of each score."""
    groups: dict[tuple[tuple[str, str], ...], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple((k, v) for k, v in row.items() if k.startswith("param.")), []).append(row)
    result = []
    for params, group in groups.items():
        means = {}
        for score in SCORES:
            values = [row[score] for row in group if row.get(score) is not None]
            means[score] = sum(values) / len(values) if values else None
        result.append(({name.removeprefix("param."): value for name, value in params}, len(group), means))
    return result


def _settings(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    groups = by_settings(rows)
    if not groups:
        return
    known = [means["axial_rmse"] for _, _, means in groups if means["axial_rmse"] is not None]
    best = min(known, default=None)
    yield "<h2>Settings, mean over the recordings</h2>"
    table = []
    for params, count, means in groups:
        name = ", ".join(f"{k} = {v}" for k, v in params.items()) or "as configured"
        mark = ' class="best"' if best is not None and means["axial_rmse"] == best else ""
        table.append(f"<tr{mark}><td>{escape(name)}</td><td>{count}</td>{_cells(means)}</tr>")
    yield _table(["settings", "recordings", *SCORES], table)


def _replays(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    if not rows:
        return
    yield "<h2>Every replay</h2>"
    table = []
    for row in rows:
        params = ", ".join(f"{k.removeprefix('param.')} = {v}" for k, v in row.items() if k.startswith("param."))
        digest = f"<td><code>{escape(row['digest'][:12])}</code></td>"
        table.append(f"<tr><td>{escape(row['flight'])}</td><td>{escape(params)}</td>{_cells(row)}{digest}</tr>")
    yield _table(["flight", "settings", *SCORES, "digest"], table)


def _failures(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    if rows:
        yield "<h2>Not replayed</h2>"
        lines = [f'<tr><td>{escape(row["log"])}</td><td class="bad">{escape(row["error"])}</td></tr>' for row in rows]
        yield _table(["recording", "why"], lines)


def _cells(values: dict[str, Any]) -> str:
    return "".join(f"<td>{'-' if values.get(s) is None else format(values[s], '.4g')}</td>" for s in SCORES)


def _table(head: Sequence[str], rows: Sequence[str]) -> str:
    titles = "".join(f"<th>{escape(name)}</th>" for name in head)
    return f'<div class="wide"><table><tr>{titles}</tr>{"".join(rows)}</table></div>'
