"""Axial velocity with its 3-sigma band against truth, and the error inside the band."""

from __future__ import annotations

import numpy as np

from axialnav.replay.axial import along, axial_frame, sigma_along
from axialnav.replay.reference import match
from axialnav.replay.report.figure import BLUE, GREY, ORANGE, RED, Figure, band, line
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run


def build(run: Run) -> Section:
    """Estimate over the whole flight; error only where there is truth."""
    figures = [_velocity(run)]
    error = _error(run)
    note = "" if error else "NOT_EVALUATED: there is no ground truth inside the scoring window."
    return Section("Axial velocity", [*figures, error] if error else figures, note=note)


def _velocity(run: Run) -> Figure:
    seconds = (run.track.t_ns - run.track.t_ns[0]) * 1e-9
    velocity, sigma = run.columns["axial_velocity_m_s"], run.columns["sigma_axial_velocity_m_s"]
    traces = band(seconds, velocity - 3.0 * sigma, velocity + 3.0 * sigma, "3 sigma", BLUE)
    traces.append(line(seconds, velocity, "fused", BLUE))
    truth = run.flight.truth
    if truth is not None and run.metrics["alignment"] == "none":
        frame = axial_frame(run.config.corridor, truth.position_m)
        true_seconds = (truth.t_ns - run.track.t_ns[0]) * 1e-9
        traces.append(line(true_seconds, along(frame.axis, truth.velocity_m_s), "truth", ORANGE, dash="dot"))
    shown = np.concatenate((velocity, [0.0]))
    room = 0.5 + 1.5 * float(np.nanpercentile(np.abs(shown), 99.5))
    caption = "Shaded: 3 sigma as the filter states it. The line breaks where the IMU was silent."
    return Figure(traces, "axial velocity [m/s]", caption, height_px=380, layout={"yaxis": {"range": [-room, room]}})


def _error(run: Run) -> Figure | None:
    if run.flight.truth is None:
        return None
    matched = match(run.track, run.flight.truth, run.flight.evaluation, align=run.config.initial is None)
    if matched.row.size == 0 or not np.isfinite(matched.truth_velocity_m_s).any():
        return None
    frame = axial_frame(run.config.corridor, matched.truth_position_m)
    error = along(frame.axis, matched.velocity_m_s - matched.truth_velocity_m_s)
    sigma = sigma_along(frame.axis, matched.velocity_covariance)
    seconds = (run.track.t_ns[matched.row] - run.track.t_ns[0]) * 1e-9
    traces = band(seconds, -3.0 * sigma, 3.0 * sigma, "3 sigma", GREY)
    traces.append(line(seconds, error, "error", RED))
    share = run.metrics["axial_velocity_m_s"]["in_3_sigma"]
    caption = (
        f"Fused minus truth, scored samples only. {100.0 * share:.1f} % lie within 3 sigma; 99.7 % would be honest."
    )
    return Figure(traces, "axial velocity error [m/s]", caption)
