"""Figures as plain data for plotly.js; colours that read well on light and on dark paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.report.decimate import envelope, gap_starts, line_points

Array = NDArray[np.float64]
Trace = dict[str, Any]

BLUE, ORANGE, GREEN, RED = "#3b82d6", "#e0851b", "#2fa36b", "#dc4b4b"
PURPLE, GREY = "#9a6bd8", "#8b929c"
TEAL, BROWN = "#1fa5b5", "#a3713f"
AXIS_COLOURS = (BLUE, ORANGE, GREEN)
SENSOR_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED, TEAL, BROWN, GREY)
MAX_BAND_STRETCHES = 40
MAX_BAND_POINTS = 1000
TIME = "time after the first IMU sample [s]"


@dataclass(frozen=True, slots=True)
class Figure:
    """One plot: traces and axis titles in the form plotly.js takes; ``caption`` says how to read it."""

    traces: Sequence[Trace]
    y_title: str
    caption: str = ""
    x_title: str = TIME
    height_px: int = 320
    layout: Mapping[str, Any] = field(default_factory=dict)

    def as_data(self, span_s: float) -> dict[str, Any]:
        """Traces and layout for the page's script, which adds the colours of paper and grid.

        Time axes all show ``span_s``, so that the plots of a page can be compared by eye.
        """
        layout: dict[str, Any] = {"height": self.height_px, "xaxis": {"title": {"text": self.x_title}}}
        layout["yaxis"] = {"title": {"text": self.y_title}}
        if self.x_title == TIME:
            layout["xaxis"]["range"] = [0.0, span_s]
        for key, value in self.layout.items():
            layout[key] = {**layout[key], **value} if isinstance(layout.get(key), dict) else value
        return {"traces": list(self.traces), "layout": layout, "time": self.x_title == TIME}


def numbers(values: Array) -> dict[str, str]:
    """Array in the compact form plotly.js reads: single precision, base64."""
    raw = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"dtype": "f4", "bdata": base64.b64encode(raw).decode("ascii")}


def line(seconds: Array, values: Array, name: str, colour: str, **style: Any) -> Trace:
    """Decimated line that breaks where the series is silent."""
    x, y = line_points(seconds, values)
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": numbers(x),
        "y": numbers(y),
        "line": {"color": colour, "width": 1.5, **style},
        "connectgaps": False,
    }


def points(seconds: Array, values: Array, name: str, colour: str, **marker: Any) -> Trace:
    """Dots, not decimated: the caller chooses the rows."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": numbers(seconds),
        "y": numbers(values),
        "marker": {"color": colour, "size": 4, **marker},
    }


def band(seconds: Array, low: Array, high: Array, name: str, colour: str) -> list[Trace]:
    """Shaded area between two series, one stretch between gaps each, one entry in the legend."""
    cuts = gap_starts(seconds)[: MAX_BAND_STRETCHES - 1] + 1
    traces: list[Trace] = []
    share = max(MAX_BAND_POINTS // (cuts.size + 1), 2)
    for rows in np.split(np.arange(seconds.size), cuts):
        x, lower, upper = envelope(seconds[rows], low[rows], high[rows], share)
        around = np.concatenate((x, x[::-1])), np.concatenate((upper, lower[::-1]))
        traces.append(_area(*around, name, colour, first=not traces))
    return traces


def _area(x: Array, y: Array, name: str, colour: str, *, first: bool) -> Trace:
    return {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "legendgroup": name,
        "showlegend": first,
        "x": numbers(x),
        "y": numbers(y),
        "fill": "toself",
        "fillcolor": f"{colour}2e",
        "line": {"width": 0},
        "hoverinfo": "skip",
    }
