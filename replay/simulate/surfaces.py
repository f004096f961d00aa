"""The planes of a corridor that the filter is told about."""

from __future__ import annotations

from axialnav.models.rig import Surface
from axialnav.replay.simulate.world import Facet, World


def surfaces_of(world: World, side: str) -> dict[str, Surface]:
    """``wall`` and ``floor``: the plane of the first piece on the camera's side, and the first floor."""
    return {"wall": _surface(world, side), "floor": _surface(world, "floor")}


def _surface(world: World, name: str) -> Surface:
    piece: Facet = next(f for f in world.facets if f.surface == name)
    x, y, z = piece.normal.tolist()
    return Surface(normal=(x, y, z), offset_m=piece.offset_m)
