"""Rows of coloured cells over time: one heat map for every strip of the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.run import Run

Row = tuple[str, list[int | None], list[str]]
CELLS = 400


def cell_edges(run: Run) -> NDArray[np.float64]:
    """Borders of the cells [s after the first IMU sample], (CELLS + 1,)."""
    return np.linspace(0.0, max((run.track.t_ns[-1] - run.track.t_ns[0]) * 1e-9, 1e-3), CELLS + 1)


def cells_of(seconds: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cell of each instant; what lies outside belongs to the first or last."""
    return np.clip(np.searchsorted(edges, seconds, side="right") - 1, 0, len(edges) - 2).astype(np.int64)


def cell_map(rows: Sequence[Row], edges: NDArray[np.float64], colours: Sequence[str]) -> list[dict[str, Any]]:
    """Traces of a strip: name, codes (None: empty) and words of each row; a code is an index into ``colours``."""
    steps = [(i + k) / len(colours) for i in range(len(colours)) for k in (0, 1)]
    return [
        {
            "type": "heatmap",
            "x": [round(float(x), 4) for x in 0.5 * (edges[1:] + edges[:-1])],
            "y": [name for name, _, _ in rows],
            "z": [codes for _, codes, _ in rows],
            "text": [words for _, _, words in rows],
            "hovertemplate": "%{y} at %{x:.1f} s: %{text}<extra></extra>",
            "zmin": -0.5,
            "zmax": len(colours) - 0.5,
            "colorscale": [[step, colours[i // 2]] for i, step in enumerate(steps)],
            "showscale": False,
            "ygap": 6,
        }
    ]


def strip_height_px(rows: Sequence[Row]) -> int:
    """Height of a strip with that many rows."""
    return 110 + 34 * len(rows)
