"""What "axial" means where: the axis of the corridor section a position is in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Corridor

Array = NDArray[np.float64]
DEFAULT_AXIS = (1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class AxialFrame:
    """Axis and axial position for a list of points.

    Attributes
    ----------
    names
        Sections in flight order, ``straight_1``, ``corner_2`` ...; empty for a corridor without sections.
    section
        (n,) index into ``names``; -1 without sections.
    axis
        (n, 3) unit vectors in the world frame.
    position_m
        (n,) distance along the corridor: arc length where there are sections, projection on the axis elsewhere [m].
    """

    names: tuple[str, ...]
    section: NDArray[np.int64]
    axis: Array
    position_m: Array


def axial_frame(corridor: Corridor | None, position_m: Array) -> AxialFrame:
    """Axis and axial position at each point.

    A point belongs to the section whose centre line is nearest (the earlier one when two are equally near).

    position_m : (n, 3) in the world frame [m].
    """
    if corridor is None or not corridor.section:
        axis = np.asarray(DEFAULT_AXIS if corridor is None else corridor.axis, dtype=np.float64)
        axis = axis / np.linalg.norm(axis)
        count = position_m.shape[0]
        return AxialFrame((), np.full(count, -1), np.broadcast_to(axis, (count, 3)), position_m @ axis)
    start = np.array([s.start for s in corridor.section], dtype=np.float64)
    along = np.array([s.end for s in corridor.section], dtype=np.float64) - start
    length = np.linalg.norm(along, axis=1)
    axes = along / np.maximum(length, 1e-12)[:, None]
    relative = position_m[:, None, :] - start
    travelled = np.einsum("nsi,si->ns", relative, axes)
    nearest_m = np.clip(travelled, 0.0, length)
    distance = np.linalg.norm(relative - nearest_m[..., None] * axes, axis=2)
    section = np.argmin(np.nan_to_num(distance, nan=np.inf), axis=1)
    before = np.concatenate(([0.0], np.cumsum(length)[:-1]))
    position = before[section] + np.take_along_axis(travelled, section[:, None], axis=1)[:, 0]
    names = tuple(f"{s.kind}_{i}" for i, s in enumerate(corridor.section, start=1))
    return AxialFrame(names, section.astype(np.int64), axes[section], position)


def along(axis: Array, vector: Array) -> Array:
    """Component of each vector along its axis: (n, 3), (n, 3) -> (n,)."""
    component: Array = np.einsum("ni,ni->n", axis, vector)
    return component


def sigma_along(axis: Array, covariance: Array) -> Array:
    """Standard deviation along each axis: (n, 3), (n, 3, 3) -> (n,)."""
    variance: Array = np.einsum("ni,nij,nj->n", axis, covariance, axis)
    return np.sqrt(np.maximum(variance, 0.0))
