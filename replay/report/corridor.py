"""Corridor sections along a time axis: where the flight was when."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from axialnav.replay.alignment import IDENTITY, RigidMotion
from axialnav.replay.axial import axial_frame
from axialnav.replay.report.figure import GREY
from axialnav.replay.run import Run

Span = tuple[str, float, float]
LEAST_LABELLED = 0.06  # of the flight
MAX_SPANS = 40


def section_spans(run: Run, motion: RigidMotion = IDENTITY) -> list[Span]:
    """Name, start and end [s after the first IMU sample] of each stay in a section; empty without sections."""
    track = run.track
    frame = axial_frame(run.config.corridor, motion.points(track.position_m))
    if not frame.names:
        return []
    seconds = (track.t_ns - track.t_ns[0]) * 1e-9
    cuts = [0, *(np.flatnonzero(np.diff(frame.section)) + 1).tolist(), seconds.size - 1]
    return [(frame.names[frame.section[a]], float(seconds[a]), float(seconds[b])) for a, b in pairwise(cuts) if b > a]


def section_marks(run: Run, motion: RigidMotion = IDENTITY, *, inside: bool = True) -> dict[str, Any]:
    """Layout entries that draw a line where a section ends and write the names of the longer ones at the top."""
    spans = section_spans(run, motion)[:MAX_SPANS]
    if len(spans) < 2:
        return {}
    style = {"color": GREY, "width": 1, "dash": "dot"}
    lines = [
        {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": start, "x1": start, "line": style}
        for _, start, _ in spans[1:]
    ]
    flight_s = spans[-1][2] - spans[0][1]
    names = [
        _label(*span, "top" if inside else "bottom") for span in spans if span[2] - span[1] > LEAST_LABELLED * flight_s
    ]
    return {"shapes": lines, "annotations": names}


def _label(name: str, start_s: float, end_s: float, anchor: str) -> dict[str, Any]:
    return {
        "text": name.replace("_", " "),
        "x": 0.5 * (start_s + end_s),
        "y": 1,
        "yref": "paper",
        "yanchor": anchor,
        "showarrow": False,
        "font": {"size": 10, "color": GREY},
    }
