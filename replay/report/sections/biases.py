"""What the filter believes about its own sensors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.state import E_ACCEL_BIAS, E_BLUR_SCALE, E_GYRO_BIAS, E_UWB_BIAS, E_WALL_OFFSET
from axialnav.replay.report.figure import (
    AXIS_COLOURS,
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
)
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run

Array = NDArray[np.float64]
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, GREY)


def build(run: Run) -> Section:
    """Accelerometer and gyro bias in body axes; scale and surface offset; UWB biases; each with its sigma."""
    track = run.track
    figures = [
        _three(run, track.accel_bias_m_s2, E_ACCEL_BIAS, "accel. bias [m/s²]"),
        _three(run, np.degrees(track.gyro_bias_rad_s), E_GYRO_BIAS, "gyro bias [deg/s]", math.degrees(1.0)),
        *_others(run),
    ]
    if track.uwb_bias_m.any():
        figures.append(_paths(run))
    note = (
        "Shaded: one sigma. A bias that runs away, or whose sigma does not shrink, tells of a fault or of a wrong rig."
    )
    return Section("Biases", figures, note=note)


def _with_sigma(run: Run, values: Array, state: int, name: str, colour: str, unit: float = 1.0) -> list[Trace]:
    """Line and band of one error state; ``unit`` turns its SI sigma into the unit of ``values``."""
    seconds = (run.track.t_ns - run.track.t_ns[0]) * 1e-9
    sigma = unit * run.track.sigma_error[:, state]
    shade = band(seconds, values - sigma, values + sigma, f"sigma {name}", colour)
    for trace in shade:
        trace |= {"legendgroup": name, "showlegend": False}
    return [*shade, {**line(seconds, values, name, colour), "legendgroup": name}]


def _three(run: Run, values: Array, first: int, title: str, unit: float = 1.0) -> Figure:
    each = [_with_sigma(run, values[:, i], first + i, axis, AXIS_COLOURS[i], unit) for i, axis in enumerate("xyz")]
    return Figure([t for traces in each for t in traces], title, height_px=260)


def _others(run: Run) -> list[Figure]:
    """Scale of the image and offset of the surface, where the flight lets them be estimated."""
    track, figures = run.track, []
    named = (
        (track.blur_scale, E_BLUR_SCALE, "image scale [-]", BLUE),
        (track.wall_offset_m, E_WALL_OFFSET, "surface offset [m]", GREEN),
    )
    for values, state, title, colour in named:
        if np.ptp(values) > 0.0:
            figures.append(Figure(_with_sigma(run, values, state, title, colour), title, height_px=220))
    return figures


def _paths(run: Run) -> Figure:
    """The eight places of UWB paths; one may change its owner where more than eight anchors are heard in turn."""
    biases = run.track.uwb_bias_m
    traces: list[Trace] = []
    for k in np.flatnonzero(biases.any(axis=0)).tolist():
        traces += _with_sigma(run, biases[:, k], E_UWB_BIAS + k, f"path {k + 1}", COLOURS[k % len(COLOURS)])
    return Figure(traces, "UWB biases, by path [m]", height_px=300)
