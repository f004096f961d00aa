"""Are the innovations what the filter thinks they are: distribution against the normal curve, memory against none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import Verdict
from axialnav.replay.report.figure import GREY, Figure, numbers
from axialnav.replay.report.nis import nis_histograms, sensor_colours
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run
from axialnav.replay.series import autocorrelation

Array = NDArray[np.float64]
EDGES = np.linspace(-4.0, 4.0, 41)
LAGS = 25
MIN_READINGS = 30
HIGHEST_DENSITY = 1.2  # three times the honest peak; what is higher is cut and plain enough


def build(run: Run) -> Section | None:
    """All sensors in one figure each; nothing where no sensor fused enough readings to tell."""
    fused = {name: values for name in run.log.sensors if (values := _normalised(run, name)).size}
    if not fused:
        return None
    note = (
        "NIS is the squared innovation over its predicted variance, all axes together. The lower two plots take the "
        "fused innovations of each sensor's first axis."
    )
    colours = sensor_colours(run.log)
    figures = [*nis_histograms(run.log), _distribution(fused, colours), _memory(fused, colours)]
    return Section("Are the innovations honest?", figures, note=note)


def _normalised(run: Run, name: str) -> Array:
    log = run.log
    rows = (log.source == log.sensors.index(name)) & (log.verdict == Verdict.FUSED) & (log.dof > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        values: Array = log.innovation[rows, 0] / np.sqrt(log.variance[rows, 0])
    values = values[np.isfinite(values)]
    return values if values.size >= MIN_READINGS and np.ptp(values) > 0.0 else values[:0]


def _distribution(fused: dict[str, Array], colours: dict[str, str]) -> Figure:
    middle = 0.5 * (EDGES[1:] + EDGES[:-1])
    honest = np.exp(-0.5 * middle**2) / math.sqrt(2.0 * math.pi)
    traces = [_line(middle, honest, "honest", GREY, dash="dot", shape="linear")]
    for name, values in fused.items():
        density = np.histogram(values, EDGES)[0] / (values.size * (EDGES[1] - EDGES[0]))
        traces.append(_line(middle, density, name, colours[name], shape="hvh"))
    caption = "Narrower than the dotted curve: noise told too large. Wider: told too small."
    return Figure(
        traces, "density", caption, x_title="innovation [sigma]", layout={"yaxis": {"range": [0.0, HIGHEST_DENSITY]}}
    )


def _memory(fused: dict[str, Array], colours: dict[str, str]) -> Figure:
    lags = np.arange(1, LAGS + 1, dtype=np.float64)
    traces = []
    for name, values in fused.items():
        found = autocorrelation(values)[1 : LAGS + 1]
        traces.append(_line(lags[: found.size], found, name, colours[name], shape="linear", mode="lines+markers"))
    fewest = min(values.size for values in fused.values())
    caption = (
        "Correlation of innovations with those that many readings later. White noise stays near 0: within "
        f"{2.0 / math.sqrt(fewest):.2f} even for the sensor with fewest readings."
    )
    layout = {"yaxis": {"range": [-1.0, 1.0]}}
    return Figure(traces, "autocorrelation", caption, x_title="lag [readings]", layout=layout)


def _line(x: Array, y: Array, name: str, colour: str, *, mode: str = "lines", **style: Any) -> dict[str, Any]:
    look = {"color": colour, "width": 1.5, **style}
    return {"type": "scatter", "mode": mode, "name": name, "x": numbers(x), "y": numbers(y), "line": look}
