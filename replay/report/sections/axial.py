"""Axial velocity with its 3-sigma band against truth, and the error inside the band."""

from __future__ import annotations

import numpy as np

from axialnav.replay.alignment import IDENTITY, RigidMotion
from axialnav.replay.axial import along, axial_frame, sigma_along
from axialnav.replay.image_velocity import image_velocities
from axialnav.replay.reference import Matched, match
from axialnav.replay.report.corridor import section_marks
from axialnav.replay.report.decimate import scatter_rows
from axialnav.replay.report.figure import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    Figure,
    Trace,
    band,
    line,
    points,
)
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

IMAGE_COLOURS = (GREEN, PURPLE)
DOT = {"size": 3, "opacity": 0.45}
CROSS = {"size": 5, "opacity": 0.8, "symbol": "x"}
CAPTION = "Shaded: 3 sigma as the filter states it. The line breaks where the IMU was silent."
IMAGE_CAPTION = (
    " Dots: the velocity that each reading of the image motion asks for at the calibrated scale, with the filter's "
    "distance and attitude; crosses were refused by the gate."
)


def build(run: Run) -> Section:
    """Estimate over the whole flight; error only where there is truth."""
    matched = _matched(run)
    if matched is None:
        note = "NOT_EVALUATED: there is no ground truth inside the scoring window."
        return Section("Axial velocity", [_velocity(run, IDENTITY)], note=note)
    aligned = run.metrics["alignment"] == "rigid"
    note = "The estimate is shown after rigid alignment with the truth: the frames are unrelated." if aligned else ""
    figures = [_velocity(run, matched.alignment)]
    if np.isfinite(matched.truth_velocity_m_s).any():
        figures.append(_error(run, matched))
    return Section("Axial velocity", figures, note=note)


def _matched(run: Run) -> Matched | None:
    if run.flight.truth is None:
        return None
    matched = match(run.track, run.flight.truth, run.flight.evaluation, align=run.config.initial is None)
    return matched if matched.row.size else None


def _velocity(run: Run, motion: RigidMotion) -> Figure:
    track, truth = run.track, run.flight.truth
    seconds = (track.t_ns - track.t_ns[0]) * 1e-9
    axis = axial_frame(run.config.corridor, motion.points(track.position_m)).axis
    velocity = along(axis, motion.vectors(track.velocity_m_s))
    sigma = sigma_along(axis, motion.covariances(track.velocity_covariance))
    image = _image(run) if motion is IDENTITY else []
    traces = [*image]  # first, so that the lines are drawn over the dots
    traces += band(seconds, velocity - 3.0 * sigma, velocity + 3.0 * sigma, "3 sigma", BLUE)
    traces.append(line(seconds, velocity, "fused", BLUE))
    if truth is not None:
        frame = axial_frame(run.config.corridor, truth.position_m)
        true_seconds = (truth.t_ns - track.t_ns[0]) * 1e-9
        traces.append(line(true_seconds, along(frame.axis, truth.velocity_m_s), "truth", ORANGE, dash="dot"))
    # a wide band at the start must not flatten the flight
    low, high = np.nanpercentile(np.append(velocity, 0.0), (0.5, 99.5)).tolist()
    room = 0.3 + 0.4 * (high - low)
    layout = {"yaxis": {"range": [low - room, high + room]}, **section_marks(run, motion)}
    caption = CAPTION + IMAGE_CAPTION * bool(image)
    return Figure(traces, "axial velocity [m/s]", caption, height_px=400, layout=layout)


def _image(run: Run) -> list[Trace]:
    """Readings of image sensors as velocities: dots where they were fused, crosses where the gate refused them."""
    traces = []
    for colour, found in zip(IMAGE_COLOURS * 4, image_velocities(run), strict=False):
        seconds = (found.t_ns - run.track.t_ns[0]) * 1e-9
        for chosen, verdict, look in ((found.fused, "", DOT), (~found.fused, " gated", CROSS)):
            rows = np.flatnonzero(chosen)
            rows = rows[scatter_rows(found.velocity_m_s[rows])]
            if rows.size:
                name = f"image motion, {found.sensor}{verdict}"
                traces.append(points(seconds[rows], found.velocity_m_s[rows], name, colour, **look))
    return traces


def _error(run: Run, matched: Matched) -> Figure:
    axis = axial_frame(run.config.corridor, matched.truth_position_m).axis
    error = along(axis, matched.velocity_m_s - matched.truth_velocity_m_s)
    sigma = sigma_along(axis, matched.velocity_covariance)
    seconds = (run.track.t_ns[matched.row] - run.track.t_ns[0]) * 1e-9
    traces = band(seconds, -3.0 * sigma, 3.0 * sigma, "3 sigma", GREY)
    traces.append(line(seconds, error, "error", RED))
    share = run.metrics["axial_velocity_m_s"]["in_3_sigma"]
    caption = f"Fused minus truth, scored samples. {100.0 * share:.1f} % lie within 3 sigma; 99.7 % would be honest."
    return Figure(traces, "axial velocity error [m/s]", caption)
