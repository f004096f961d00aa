"""What the filter believes about its own sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.report.figure import AXIS_COLOURS, BLUE, GREEN, GREY, ORANGE, PURPLE, RED, Figure, line
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

Array = NDArray[np.float64]
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, GREY)


def build(run: Run) -> Section:
    """Accelerometer and gyro bias in body axes; scale and surface offset; UWB biases."""
    track = run.track
    seconds = (track.t_ns - track.t_ns[0]) * 1e-9
    figures = [
        _three(seconds, track.accel_bias_m_s2, "accelerometer bias [m/s^2]"),
        _three(seconds, np.degrees(track.gyro_bias_rad_s), "gyro bias [deg/s]"),
        _others(run, seconds),
    ]
    if track.uwb_bias_m.any():
        figures.append(_paths(run, seconds))
    return Section("Biases", figures, note="A bias that runs away tells of a sensor fault or of a wrong mounting.")


def _three(seconds: Array, values: Array, title: str) -> Figure:
    traces = [line(seconds, values[:, i], axis, AXIS_COLOURS[i]) for i, axis in enumerate("xyz")]
    return Figure(traces, title, height_px=260)


def _others(run: Run, seconds: Array) -> Figure:
    track = run.track
    traces = [
        line(seconds, track.blur_scale, "blur scale [-]", BLUE),
        line(seconds, track.wall_offset_m, "surface offset [m]", GREEN),
    ]
    return Figure(traces, "scale [-] and offset [m]", height_px=260)


def _paths(run: Run, seconds: Array) -> Figure:
    """The eight places of UWB paths; one may change its owner where more than eight anchors are heard in turn."""
    biases = run.track.uwb_bias_m
    used = np.flatnonzero(biases.any(axis=0))
    traces = [line(seconds, biases[:, k], f"path {k + 1}", COLOURS[k % len(COLOURS)]) for k in used]
    return Figure(traces, "UWB biases, by path [m]", height_px=260)
