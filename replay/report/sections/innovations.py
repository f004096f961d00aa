"""Innovations per sensor in units of their predicted sigma, with the gate and what it refused."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import InnovationLog, Verdict
from axialnav.replay.report.decimate import scatter_rows
from axialnav.replay.report.figure import AXIS_COLOURS, GREY, ORANGE, PURPLE, Figure, points
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

Array = NDArray[np.float64]
FUSED_COLOURS = (AXIS_COLOURS[0], AXIS_COLOURS[2], PURPLE)
DRAWN = (
    (Verdict.FUSED, FUSED_COLOURS, "circle"),
    (Verdict.GATED, (ORANGE,) * 3, "x"),
    (Verdict.SUSPECT, (PURPLE,) * 3, "diamond"),
)
MAX_PER_TRACE = 2000


def build(run: Run) -> Section | None:
    """One figure per sensor that was compared with a prediction at least once."""
    figures = [figure for index in range(len(run.log.sensors)) if (figure := _figure(run, index))]
    note = (
        "Innovation (reading minus prediction) divided by its predicted sigma. Honest noise: 95 % within 2, no pattern "
        "in time. Points beyond the drawn range sit on its edge; the pointer shows their value. "
        "Long recordings are thinned; extremes stay."
    )
    return Section("Innovations", figures, note=note) if figures else None


def _figure(run: Run, index: int) -> Figure | None:
    log = run.log
    rows = np.flatnonzero((log.source == index) & (log.dof > 0) & np.isfinite(log.innovation[:, 0]))
    if rows.size == 0:
        return None
    seconds = (log.t_ns - run.track.t_ns[0]) * 1e-9
    gate = float(np.sqrt(np.nanmedian(log.gate[rows])))
    edge = 1.6 * gate
    traces: list[dict[str, Any]] = []
    for style in DRAWN:
        chosen = rows[log.verdict[rows] == style[0]]
        for axis in range(int(log.dof[rows].max())):
            traces += _axis(log, seconds, chosen, axis, edge, style)
    scores = run.metrics["sensors"].get(log.sensors[index], {})
    caption = _caption(log.sensors[index], scores, gate)
    return Figure(traces, f"{log.sensors[index]} [sigma]", caption, layout=_gate_lines(gate, edge))


def _axis(
    log: InnovationLog,
    seconds: Array,
    rows: NDArray[np.int64],
    axis: int,
    edge: float,
    style: tuple[Verdict, tuple[str, ...], str],
) -> list[dict[str, Any]]:
    verdict, colours, symbol = style
    name = verdict.name.lower()
    with np.errstate(invalid="ignore", divide="ignore"):
        value = log.innovation[rows, axis] / np.sqrt(log.variance[rows, axis])
    finite = np.isfinite(value)
    rows, value = rows[finite], value[finite]
    if value.size == 0:
        return []
    kept = scatter_rows(value, MAX_PER_TRACE)
    label = name if int(log.dof[rows].max()) == 1 else f"{name} {'xyz'[axis]}"
    trace = points(
        seconds[rows[kept]], np.clip(value[kept], -edge, edge), label, colours[axis], symbol=symbol, opacity=0.6
    )
    trace["marker"]["size"] = 3 if name == "fused" else 5
    trace["text"] = [f"{v:.2f}" for v in value[kept]]
    trace["hovertemplate"] = "%{x:.2f} s: %{text} sigma<extra>" + label + "</extra>"
    return [trace]


def _caption(sensor: str, scores: dict[str, Any], gate: float) -> str:
    if not scores:
        return sensor
    nis = "-" if scores["mean_nis"] is None else f"{scores['mean_nis']:.2f}"
    lag = "-" if scores["lag1"] is None else f"{scores['lag1']:+.2f}"
    return (
        f"{sensor}: {scores['fused']} fused, {scores['gated']} gated at {gate:.2f} sigma, {scores['blind']} blind. "
        f"Mean NIS {nis} (1 is honest), lag-1 {lag} (0 is white)."
    )


def _gate_lines(gate: float, edge: float) -> dict[str, Any]:
    line = {"color": GREY, "width": 1, "dash": "dash"}
    shapes = [
        {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y, "line": line} for y in (-gate, gate)
    ]
    return {"shapes": shapes, "yaxis": {"range": [-1.05 * edge, 1.05 * edge]}}
