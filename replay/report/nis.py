"""Histogram of the normalised innovations squared against the chi-square law they should follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import InnovationLog
from axialnav.replay.report.figure import GREY, SENSOR_COLOURS, Figure, Trace, numbers

Array = NDArray[np.float64]
BINS = 30
TOP = {1: 15.0, 2: 18.0, 3: 21.0}  # one in ten thousand honest readings lies above
MIN_READINGS = 30
LEAST_SHARE = 1e-5


def nis_histograms(log: InnovationLog) -> list[Figure]:
    """One figure for each number of axes; sensors with fewer than thirty compared readings are left out."""
    figures = []
    for dof in (1, 2, 3):
        found = {name: nis for k, name in enumerate(log.sensors) if (nis := _nis(log, k, dof)).size >= MIN_READINGS}
        if found:
            figures.append(_figure(found, sensor_colours(log), dof))
    return figures


def sensor_colours(log: InnovationLog) -> dict[str, str]:
    """One colour per sensor, the same in all figures."""
    return dict(zip(log.sensors, SENSOR_COLOURS * len(log.sensors), strict=False))


def _nis(log: InnovationLog, source: int, dof: int) -> Array:
    values: Array = log.nis[(log.source == source) & (log.dof == dof)]
    return values[np.isfinite(values)]


def _figure(found: dict[str, Array], colours: dict[str, str], dof: int) -> Figure:
    edges = np.linspace(0.0, TOP[dof], BINS + 1)
    traces = [_steps(edges, chi_square_shares(edges, dof), "chi-square", GREY, dash="dot")]
    for name, nis in found.items():
        shares = np.histogram(np.minimum(nis, edges[-1]), edges)[0] / nis.size
        traces.append(_steps(edges, shares, f"{name} ({nis.size})", colours[name]))
    caption = (
        f"Share of the readings with {dof} ax{'is' if dof == 1 else 'es'} in each bin, fused and gated, logarithmic; "
        "the last bin holds all beyond. Above the dotted law on the right: outliers, or noise told too small. "
        "Below it: noise told too large."
    )
    layout = {"yaxis": {"type": "log", "range": [np.log10(LEAST_SHARE), 0.1], "exponentformat": "power"}}
    return Figure(traces, "share of readings", caption, x_title="NIS", layout=layout)


def chi_square_shares(edges: Array, dof: int) -> Array:
    """Probability of each bin under the chi-square law; the last bin holds all beyond.  (n + 1,) -> (n,)."""
    from scipy.special import gammainc  # costs a third of a second: only when a page is made

    below = gammainc(0.5 * dof, 0.5 * edges)
    below[-1] = 1.0
    shares: Array = np.diff(below)
    return shares


def _steps(edges: Array, shares: Array, name: str, colour: str, **style: str) -> Trace:
    """Outline of a histogram; empty bins are gaps."""
    middle = 0.5 * (edges[1:] + edges[:-1])
    look = {"color": colour, "width": 1.5, "shape": "hvh", **style}
    visible = np.where(shares > 0.0, shares, np.nan)
    return {"type": "scatter", "mode": "lines", "name": name, "x": numbers(middle), "y": numbers(visible), "line": look}
