"""Position and velocity of all axes against truth, and the path from above."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.alignment import IDENTITY, RigidMotion
from axialnav.replay.reference import match
from axialnav.replay.report.decimate import MAX_POINTS
from axialnav.replay.report.figure import AXIS_COLOURS, BLUE, ORANGE, Figure, Trace, line, numbers
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

Array = NDArray[np.float64]


def build(run: Run) -> Section:
    """Estimate in the truth's frame where the two had to be aligned."""
    motion = alignment_of(run)
    note = "Estimate after rigid alignment with the truth: the frames are unrelated." if motion is not IDENTITY else ""
    figures = [_axes(run, motion, "position", "m"), _axes(run, motion, "velocity", "m/s"), _path(run, motion)]
    return Section("Position and velocity", figures, note=note)


def alignment_of(run: Run) -> RigidMotion:
    """What takes the estimate into the frame of the truth, where the two are unrelated."""
    if run.flight.truth is None or run.metrics["alignment"] != "rigid":
        return IDENTITY
    return match(run.track, run.flight.truth, run.flight.evaluation, align=True).alignment


def _axes(run: Run, motion: RigidMotion, what: str, unit: str) -> Figure:
    track, truth = run.track, run.flight.truth
    seconds = (track.t_ns - track.t_ns[0]) * 1e-9
    fused = motion.points(track.position_m) if what == "position" else motion.vectors(track.velocity_m_s)
    traces = [line(seconds, fused[:, i], f"{a} fused", AXIS_COLOURS[i]) for i, a in enumerate("xyz")]
    if truth is not None:
        true_seconds = (truth.t_ns - track.t_ns[0]) * 1e-9
        values = truth.position_m if what == "position" else truth.velocity_m_s
        for i, axis in enumerate("xyz"):
            traces.append(line(true_seconds, values[:, i], f"{axis} truth", AXIS_COLOURS[i], dash="dot", width=1))
    return Figure(traces, f"{what} [{unit}]", "Solid: fused. Dotted: truth.")


def _path(run: Run, motion: RigidMotion) -> Figure:
    traces = [_curve(motion.points(run.track.position_m), "fused", BLUE, "solid")]
    if run.flight.truth is not None:
        traces.append(_curve(run.flight.truth.position_m, "truth", ORANGE, "dot"))
    layout = {"yaxis": {"scaleanchor": "x", "scaleratio": 1}}
    return Figure(traces, "y [m]", "Path from above, equal scales.", x_title="x [m]", height_px=420, layout=layout)


def _curve(position_m: Array, name: str, colour: str, dash: str) -> Trace:
    step = max(1, -(-position_m.shape[0] // MAX_POINTS))
    thinned = position_m[::step]
    shape = {"color": colour, "width": 1.5, "dash": dash}
    x, y = numbers(thinned[:, 0]), numbers(thinned[:, 1])
    return {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": y, "line": shape}
