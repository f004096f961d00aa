"""``fused.csv``: the estimate at every IMU sample, and the digest that names it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Corridor
from axialnav.fusion.outcome import Track
from axialnav.replay.axial import along, axial_frame, sigma_along

Column = NDArray[Any]
AXES = ("x", "y", "z")


def fused_columns(track: Track, corridor: Corridor | None) -> dict[str, Column]:
    """Columns of ``fused.csv`` in file order, each (n,); ``t_ns`` and ``flags`` int64, the rest float64.

    World frame of the flight, SI units, quaternion body to world scalar first; "axial" is along the axis of the section
    the estimate is in.
    """
    frame = axial_frame(corridor, track.position_m)
    columns: dict[str, Column] = {"t_ns": track.t_ns}
    columns |= {f"p_{a}_m": track.position_m[:, i] for i, a in enumerate(AXES)}
    columns |= {f"v_{a}_m_s": track.velocity_m_s[:, i] for i, a in enumerate(AXES)}
    columns |= {f"q_{a}": track.quaternion_WB[:, i] for i, a in enumerate(("w", *AXES))}
    columns |= {f"sigma_p_{a}_m": _sigma(track.position_covariance, i) for i, a in enumerate(AXES)}
    columns |= {f"sigma_v_{a}_m_s": _sigma(track.velocity_covariance, i) for i, a in enumerate(AXES)}
    columns["axial_position_m"] = frame.position_m
    columns["axial_velocity_m_s"] = along(frame.axis, track.velocity_m_s)
    columns["sigma_axial_velocity_m_s"] = sigma_along(frame.axis, track.velocity_covariance)
    columns["flags"] = track.flags
    return columns


def _sigma(covariance: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    root: NDArray[np.float64] = np.sqrt(np.maximum(covariance[:, axis, axis], 0.0))
    return root


def digest(columns: dict[str, Column]) -> str:
    """SHA-256 over every number of ``fused.csv``: column after column in file order, 8-byte little-endian each.

    ``t_ns`` and ``flags`` enter as int64, the rest as float64, so equal digests mean equal bits, not equal print-outs.
    """
    total = hashlib.sha256()
    for values in columns.values():
        kind = "<i8" if values.dtype.kind == "i" else "<f8"
        total.update(np.ascontiguousarray(values, dtype=kind).tobytes())
    return total.hexdigest()


def write_fused_csv(path: Path, columns: dict[str, Column]) -> None:
    """Write the columns; floats in the shortest form that reads back to the same bits, NaN as ``nan``."""
    import pyarrow as pa
    from pyarrow import csv

    with path.open("wb") as file:
        file.write((",".join(columns) + "\n").encode())
        csv.write_csv(pa.table(columns), file, csv.WriteOptions(include_header=False))
