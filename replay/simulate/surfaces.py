"""The planes of a corridor that the filter is told about: the wall on the camera's side and the floor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import Face, Surface, Vector3
from axialnav.replay.simulate.world import TREAD_M, Leg, World

LEFT_RIGHT = {"left": 1.0, "right": -1.0}


def surfaces_of(world: World, side: str, beams_per_m: float) -> dict[str, Surface]:
    """Surfaces ``wall`` and ``floor``: one plane each where the corridor is straight and level, else one face a leg.

    Doorways are not told: a survey does not know which doors stand open.  Neighbouring beams on one tread are off the
    incline together, so that the roughness of stairs is that of a step times the root of the beams per tread:
    ``beams_per_m`` is the floor range finder's rate over the usual speed.
    """
    walls = [_wall(leg, side) for leg in world.legs]
    floors = [_floor(level, beams_per_m) for level in _levels(world.legs)]
    return {"wall": _surface(walls), "floor": _surface(floors)}


def _surface(faces: list[Face]) -> Surface:
    first = faces[0]
    if all(_same_plane(first, face) for face in faces[1:]):
        return Surface(normal=first.normal, offset_m=first.offset_m)
    return Surface(normal=first.normal, offset_m=first.offset_m, face=tuple(faces))


def _same_plane(a: Face, b: Face) -> bool:
    return (
        math.dist(a.normal, b.normal) < 1e-9 and abs(a.offset_m - b.offset_m) < 1e-9 and a.roughness_m == b.roughness_m
    )


def _wall(leg: Leg, side: str) -> Face:
    ends = leg.left if side == "left" else leg.right
    x, y = leg.direction
    normal = LEFT_RIGHT[side] * np.array([y, -x, 0.0])
    start, end = np.array([*ends[0], leg.floor[0]]), np.array([*ends[1], leg.floor[0]])  # level: ends are upright
    return Face(normal=_tuple(normal), offset_m=float(normal @ start), start=_tuple(start), end=_tuple(end))


def _levels(legs: tuple[Leg, ...]) -> list[list[Leg]]:
    """Neighbouring legs whose floor is one plane: all that is level between stairs, and each flight of stairs."""
    levels: list[list[Leg]] = []
    for leg in legs:
        if levels and not leg.riser_m and not levels[-1][-1].riser_m:
            levels[-1].append(leg)
        else:
            levels.append([leg])
    return levels


def _floor(level: list[Leg], beams_per_m: float) -> Face:
    """A face has no limit across its line: that of a level runs along its first leg, as far as any of its legs does."""
    leg = level[0]
    reach = max(float(np.max((np.vstack([part.left, part.right]) - leg.start) @ leg.direction)) for part in level)
    flat = leg.start + reach * leg.direction if len(level) > 1 else leg.end
    start, end = np.array([*leg.start, leg.floor[0]]), np.array([*flat, leg.floor[1]])
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.cross(along, [-leg.direction[1], leg.direction[0], 0.0])
    rough = leg.riser_m * math.sqrt(max(1.0, beams_per_m * TREAD_M) / 12.0)
    return Face(
        normal=_tuple(normal),
        offset_m=float(normal @ start),
        start=_tuple(start),
        end=_tuple(end),
        roughness_m=round(abs(rough), 4),
    )


def _tuple(vector: NDArray[np.float64]) -> Vector3:
    x, y, z = (np.asarray(vector) + 0.0).tolist()
    return x, y, z
