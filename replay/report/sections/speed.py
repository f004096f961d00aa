"""Horizontal speed against GPS, for flights that have no ground truth."""

from __future__ import annotations

import numpy as np

from axialnav.replay.report.figure import BLUE, ORANGE, Figure, line
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run


def build(run: Run) -> Section | None:
    """Nothing where there is ground truth or no GPS."""
    gps = run.flight.gps
    if gps is None or run.flight.truth is not None:
        return None
    first = run.track.t_ns[0]
    fused = np.hypot(run.track.velocity_m_s[:, 0], run.track.velocity_m_s[:, 1])
    reference = np.hypot(gps.velocity_m_s[:, 0], gps.velocity_m_s[:, 1])
    traces = [
        line((run.track.t_ns - first) * 1e-9, fused, "fused", BLUE),
        line((gps.t_ns - first) * 1e-9, reference, "GPS", ORANGE),
    ]
    note = "The heading of the filter's world against north is unknown, so speeds are compared and not components."
    return Section("Horizontal speed against GPS", [Figure(traces, "horizontal speed [m/s]", height_px=380)], note=note)
