"""Rays through the corridor: what a beam meets, and whether two points see each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.world import World

Array = NDArray[np.float64]
TOLERANCE_M = 1e-6
CHUNK = 4096


@dataclass(frozen=True)
class Hits:
    """Where rays end.

    Attributes
    ----------
    distance_m
        Along the ray, infinite where nothing is met, shape (n,).
    facet
        Index of the piece met, -1 where none, shape (n,).
    cosine
        Of the angle of incidence, shape (n,).
    """

    distance_m: Array
    facet: NDArray[np.int64]
    cosine: Array


def cast(world: World, origin: Array, direction: Array) -> Hits:
    """First piece that each ray meets from its front.

    Parameters
    ----------
    world
        The corridor.
    origin, direction
        Start points [m] and unit directions in the world frame, shape (n, 3) each.
    """
    parts = [_cast(world, origin[i : i + CHUNK], direction[i : i + CHUNK]) for i in range(0, len(origin), CHUNK)]
    if not parts:
        return Hits(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0))
    return Hits(
        np.concatenate([p.distance_m for p in parts]),
        np.concatenate([p.facet for p in parts]),
        np.concatenate([p.cosine for p in parts]),
    )


def _cast(world: World, origin: Array, direction: Array) -> Hits:
    distance, cosine = _meet(world, origin, direction)
    facet = np.argmin(distance, axis=1)
    rows = np.arange(len(origin))
    nearest = distance[rows, facet]
    return Hits(nearest, np.where(np.isfinite(nearest), facet, -1), cosine[rows, facet])


def _meet(world: World, origin: Array, direction: Array) -> tuple[Array, Array]:
    """Distance (n, F) at which each ray meets each facet from its front, infinite where not, and cosines (n, F)."""
    normals, offsets = world.planes
    inward, limits = world.edges
    cosine = -direction @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (origin @ normals.T - offsets) / cosine
    good = (cosine > 1e-9) & (distance > 0.0)
    where, which = np.nonzero(good)
    points = origin[where] + distance[where, which][:, None] * direction[where]
    inside = (np.einsum("kei,ki->ke", inward[which], points) >= limits[which] - TOLERANCE_M).all(axis=1)
    good[where[~inside], which[~inside]] = False
    return np.where(good, distance, np.inf), cosine


def sees(world: World, first: Array, second: Array) -> NDArray[np.bool_]:
    """Whether the straight line between points stays free of walls; first, second : (n, 3) or (3,) [m] -> (n,)."""
    first, second = np.broadcast_arrays(np.atleast_2d(first), np.atleast_2d(second))
    way = second - first
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
    free = np.ones(len(way), dtype=np.bool_)
    for i in range(0, len(way), CHUNK):
        part = slice(i, i + CHUNK)
        distance, _ = _meet(world, first[part], way[part] / length[part, None])
        free[part] = (distance >= length[part, None] - TOLERANCE_M).all(axis=1)
    return free
