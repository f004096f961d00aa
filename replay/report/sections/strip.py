"""Who contributed when: one row per sensor and one per condition of the estimate, over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import Health, Verdict
from axialnav.replay.report.corridor import section_marks
from axialnav.replay.report.figure import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, Figure
from axialnav.replay.report.rows import CELLS, Row, cell_edges, cell_map, cells_of, strip_height_px
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

COLOURS = {
    Verdict.FUSED: GREEN,
    Verdict.GATED: ORANGE,
    Verdict.LATE: BLUE,
    Verdict.BLIND: "#b9bec6",
    Verdict.SUSPECT: PURPLE,
    Verdict.INVALID: RED,
}
CONDITION = len(COLOURS)
MAGENTA = "#d633b0"
OTHER_COLOURS = (("condition of the estimate", GREY), ("underlined: time-out", MAGENTA))
MAX_TIMEOUTS = 100


def build(run: Run) -> Section:
    """Each cell has the colour of what happened to most readings in it; the pointer shows all counts."""
    edges = cell_edges(run)
    rows = [*_sensor_rows(run, edges), *_condition_rows(run, edges)]
    note = (
        "Colour: what happened to most readings of that moment. White space: no reading. Underlined: not fused for "
        "longer than its time-out. Blind is not a rejection. Dotted grey: the next section of the corridor begins."
    )
    marks = section_marks(run, inside=False)
    layout = {
        **marks,
        "shapes": [*marks.get("shapes", ()), *_reset_lines(run), *_timeout_lines(run, [name for name, _, _ in rows])],
        "yaxis": {"autorange": "reversed", "fixedrange": True},
    }
    cells = cell_map(rows, edges, [*COLOURS.values(), GREY])
    figure = Figure(cells, "", _resets_caption(run), height_px=strip_height_px(rows), layout=layout)
    legend = [(verdict.name.lower(), colour) for verdict, colour in COLOURS.items()]
    return Section("Sensors over time", [figure], "strip.html.j2", note, {"legend": [*legend, *OTHER_COLOURS]})


def _sensor_rows(run: Run, edges: NDArray[np.float64]) -> list[Row]:
    log = run.log
    seconds = (log.t_ns - run.track.t_ns[0]) * 1e-9
    cell = cells_of(seconds, edges)
    rows = []
    for index, name in enumerate(log.sensors):
        mine = log.source == index
        if not mine.any():
            continue
        counts = np.bincount(cell[mine] * len(Verdict) + log.verdict[mine], minlength=CELLS * len(Verdict))
        counts = counts.reshape(CELLS, len(Verdict))
        codes = [int(c) if total else None for c, total in zip(counts.argmax(1), counts.sum(1), strict=True)]
        rows.append((name, codes, [_words(row) for row in counts.tolist()]))
    return rows


def _words(counts: list[int]) -> str:
    return ", ".join(f"{verdict.name.lower()} {n}" for verdict, n in zip(Verdict, counts, strict=True) if n)


def _condition_rows(run: Run, edges: NDArray[np.float64]) -> list[Row]:
    seconds = (run.track.t_ns - run.track.t_ns[0]) * 1e-9
    rows = []
    for flag in Health:
        hit = (run.track.flags & int(flag)) != 0
        if flag and hit.any():
            name = str(flag.name).replace("_", " ").lower()
            present = np.histogram(seconds[hit], edges)[0] > 0
            rows.append((name, [CONDITION if p else None for p in present], [name if p else "" for p in present]))
    return rows


def _reset_seconds(run: Run) -> list[float]:
    rows = np.flatnonzero(np.diff(run.track.resets) > 0) + 1
    return [float(s) for s in (run.track.t_ns[rows] - run.track.t_ns[0]) * 1e-9]


def _reset_lines(run: Run) -> list[dict[str, Any]]:
    style = {"color": RED, "width": 1.5, "dash": "dot"}
    at = _reset_seconds(run)[:50]
    return [{"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": s, "x1": s, "line": style} for s in at]


def _timeout_lines(run: Run, names: list[str]) -> list[dict[str, Any]]:
    """A line under the row of a sensor while it was not fused for longer than its time-out."""
    style = {"color": MAGENTA, "width": 3}
    spans = [
        (place + 0.46, start, end)
        for place, name in enumerate(names)
        for start, end in run.metrics["sensors"].get(name, {}).get("timeouts", ())
    ]
    return [{"type": "line", "x0": a, "x1": b, "y0": y, "y1": y, "line": style} for y, a, b in spans[:MAX_TIMEOUTS]]


def _resets_caption(run: Run) -> str:
    at = _reset_seconds(run)
    if not at:
        return "No position reset."
    listed = ", ".join(f"{s:.1f} s" for s in at[:10])
    return f"{len(at)} position reset{'s' * (len(at) > 1)} (dotted): {listed}{' ...' * (len(at) > 10)}"
