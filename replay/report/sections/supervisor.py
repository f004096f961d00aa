"""What the supervisor made of every source, over the sections of the corridor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.supervisor import SOURCE_STATES, SourceState
from axialnav.replay.report.corridor import section_marks, section_spans
from axialnav.replay.report.figure import BLUE, GREEN, ORANGE, PURPLE, RED, Figure
from axialnav.replay.report.rows import CELLS, Row, cell_edges, cell_map, cells_of, strip_height_px
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

COLOURS = {
    SourceState.OFF: "#b9bec6",
    SourceState.ALIGNING: BLUE,
    SourceState.OK: GREEN,
    SourceState.SUSPECT: PURPLE,
    SourceState.REACQUIRE: ORANGE,
    SourceState.LOST: RED,
}
# of several states in one cell the one that a person has to see
BY_WEIGHT = (
    SourceState.OFF,
    SourceState.OK,
    SourceState.ALIGNING,
    SourceState.REACQUIRE,
    SourceState.LOST,
    SourceState.SUSPECT,
)


def build(run: Run) -> Section | None:
    """One row a source; None where no supervisor ran."""
    states = run.track.source_states
    watched = [i for i in range(states.shape[1]) if states[:, i].any()]
    if not watched:
        return None
    edges = cell_edges(run)
    cell = cells_of((run.track.t_ns - run.track.t_ns[0]) * 1e-9, edges)
    places = _places(run, edges)
    rows = [_row(run.log.sensors[i], states[:, i], cell, places) for i in watched]
    layout = {**section_marks(run, inside=False), "yaxis": {"autorange": "reversed", "fixedrange": True}}
    height = strip_height_px(rows)
    figure = Figure(
        cell_map(rows, edges, list(COLOURS.values())), "", _caption(run, watched), height_px=height, layout=layout
    )
    note = (
        "Sources, not single readings: UWB is compared with a shadow of the filter that does without it, image motion "
        "with one that does without the image. Where a moment holds several states the one that calls for attention is "
        "drawn; the pointer tells it, and the section of the corridor."
    )
    legend = [(state.name.lower(), colour) for state, colour in COLOURS.items()]
    return Section("Supervisor", [figure], "strip.html.j2", note, {"legend": legend})


def _row(name: str, states: NDArray[np.int8], cell: NDArray[np.int64], places: list[str]) -> Row:
    counts = np.bincount(cell * len(SourceState) + states, minlength=CELLS * len(SourceState))
    present = counts.reshape(CELLS, len(SourceState)) > 0
    codes: list[int | None] = [None] * CELLS
    for state in BY_WEIGHT:
        codes = [int(state) if there else code for there, code in zip(present[:, state], codes, strict=True)]
    words = [
        "" if code is None else f"{place}{SourceState(code).name.lower()}: {SOURCE_STATES[SourceState(code)]}"
        for code, place in zip(codes, places, strict=True)
    ]
    return name, codes, words


def _places(run: Run, edges: NDArray[np.float64]) -> list[str]:
    """Section of the corridor in the middle of each cell, as the beginning of a sentence."""
    middle = 0.5 * (edges[1:] + edges[:-1])
    places = [""] * CELLS
    for name, start, end in section_spans(run):
        for k in np.flatnonzero((middle >= start) & (middle <= end)).tolist():
            places[k] = f"{name.replace('_', ' ')}, "
    return places


def _caption(run: Run, watched: list[int]) -> str:
    """Share of the flight in which each source was not believed."""
    parts = []
    for i in watched:
        share = float(np.isin(run.track.source_states[:, i], (SourceState.SUSPECT, SourceState.REACQUIRE)).mean())
        parts.append(f"{run.log.sensors[i]} {share:.1%}")
    return f"Share of the flight held suspect or sought again: {', '.join(parts)}."
