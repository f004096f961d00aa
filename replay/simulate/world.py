"""The corridor as flat pieces: walls, floors, ceilings and doorways of a chain of sections.

Every section is one prismatic leg (a corner: two), cut where its neighbour begins, mitred where the direction changes.
World frame: x along the first section, z up, origin on the floor under the take-off point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Corridor, Section
from axialnav.replay.simulate.mission import Mission, Opening, SectionPlan, WallLook

Array = NDArray[np.float64]
BEHIND_M = 2.0  # of corridor behind take-off
TREAD_M = 0.28  # of a stair


@dataclass(frozen=True)
class Facet:
    """A flat convex piece of the corridor.

    Attributes
    ----------
    surface
        ``left``, ``right``, ``floor``, ``ceiling``, ``end`` or ``niche``.
    section
        Index of the section it belongs to.
    corners
        In order around the piece, shape (4, 3) [m].
    look
        What the camera sees there.
    riser_m
        Height of the steps, 0 where it is smooth [m].
    """

    surface: str
    section: int
    corners: Array
    look: WallLook
    riser_m: float = 0.0

    @cached_property
    def normal(self) -> Array:
        """Unit normal into free space (the side from which the corners run counter-clockwise), shape (3,)."""
        cross = np.cross(self.corners[1] - self.corners[0], self.corners[3] - self.corners[0])
        return np.asarray(cross / np.linalg.norm(cross))

    @cached_property
    def offset_m(self) -> float:
        """``normal . p`` on the piece [m]."""
        return float(self.normal @ self.corners[0])


@dataclass(frozen=True)
class Leg:
    """A stretch between two cross-sections, given in plan view.

    ``start`` and ``end`` are centre points (x, y); ``floor`` the floor's height at either end; ``left`` and ``right``
    the wall's points at either end, shape (2, 2) each.
    """

    section: int
    plan: SectionPlan
    start: Array
    end: Array
    floor: tuple[float, float]
    left: Array
    right: Array

    @property
    def riser_m(self) -> float:
        """Height of one step, 0 without stairs [m]."""
        steps = max(1, round(self.plan.length_m / TREAD_M))
        return self.plan.rise_m / steps if self.plan.kind == "stairs" else 0.0

    @property
    def direction(self) -> Array:
        """Unit vector along the leg in plan view, shape (2,)."""
        along = self.end - self.start
        return np.asarray(along / np.linalg.norm(along))


@dataclass(frozen=True)
class World:
    """All pieces of a corridor and the line through its middle.

    Attributes
    ----------
    legs, facets
        In flight order.
    corridor
        The sections as ``flight.toml`` lists them, at the height at which is flown.
    """

    legs: tuple[Leg, ...]
    facets: tuple[Facet, ...]
    corridor: Corridor

    @cached_property
    def planes(self) -> tuple[Array, Array]:
        """Normals (F, 3) and offsets (F,) of the facets."""
        return np.stack([f.normal for f in self.facets]), np.array([f.offset_m for f in self.facets])

    @cached_property
    def edges(self) -> tuple[Array, Array]:
        """Per facet the inward edge normals (F, 4, 3) and their offsets (F, 4): inside where ``n . p >= offset``."""
        normals, offsets = [], []
        for facet in self.facets:
            along = np.roll(facet.corners, -1, axis=0) - facet.corners
            inward = np.cross(facet.normal, along)
            inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-12)
            normals.append(inward)
            offsets.append(np.einsum("ij,ij->i", inward, facet.corners))
        return np.stack(normals), np.stack(offsets)

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie within the corridor (its niches not counted)."""
        found = np.zeros(len(points), dtype=np.bool_)
        for leg in self.legs:
            quad = np.array([leg.right[0], leg.right[1], leg.left[1], leg.left[0]])
            along = np.roll(quad, -1, axis=0) - quad
            offset = points[:, None, :2] - quad
            within = (along[:, 0] * offset[..., 1] - along[:, 1] * offset[..., 0] >= 0.0).all(axis=1)
            share = np.clip((points[:, :2] - leg.start) @ leg.direction / np.linalg.norm(leg.end - leg.start), 0.0, 1.0)
            above = points[:, 2] - (leg.floor[0] + share * (leg.floor[1] - leg.floor[0]))
            found |= within & (above >= 0.0) & (above <= leg.plan.height_m)
        return found


def build_world(mission: Mission) -> World:
    """Lay out the sections of a mission, one after the other."""
    legs = _legs(mission)
    facets: list[Facet] = []
    for leg in legs:
        facets += _leg_facets(leg)
    facets += _steps_in_width(legs)
    facets += [_cap(legs[0], first=True), _cap(legs[-1], first=False)]
    return World(tuple(legs), tuple(facets), _corridor(mission, legs))


def _legs(mission: Mission) -> list[Leg]:
    """Centre lines first, then the walls, mitred between neighbours of one width."""
    lines = _centre_lines(mission)
    directions = [_unit(end - start) for _, _, start, end, _ in lines]
    legs = []
    for i, (section, plan, start, end, floor) in enumerate(lines):
        before = directions[i - 1] if i > 0 else directions[i]
        after = directions[i + 1] if i + 1 < len(lines) else directions[i]
        cross = [_mitre(before, directions[i]), _mitre(directions[i], after)]
        half = 0.5 * plan.width_m
        left = np.array([start + half * cross[0], end + half * cross[1]])
        right = np.array([start - half * cross[0], end - half * cross[1]])
        legs.append(Leg(section, plan, start, end, floor, left, right))
    return legs


def _centre_lines(mission: Mission) -> list[tuple[int, SectionPlan, Array, Array, tuple[float, float]]]:
    place, heading, floor = np.array([-BEHIND_M, 0.0]), 0.0, 0.0
    lines = []
    for index, plan in enumerate(mission.section):
        turns = (heading, heading + np.radians(plan.turn_deg)) if plan.kind == "corner" else (heading,)
        for leg, angle in enumerate(turns):
            extra = BEHIND_M if index == 0 and leg == 0 else 0.0
            extra += BEHIND_M if index == len(mission.section) - 1 and leg == len(turns) - 1 else 0.0
            end = place + (plan.length_m + extra) * np.array([np.cos(angle), np.sin(angle)])
            lines.append((index, plan, place, end, (floor, floor + plan.rise_m)))
            place, heading, floor = end, float(angle), floor + plan.rise_m
    return lines


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _mitre(before: Array, after: Array) -> Array:
    """From the centre to the left wall where two directions meet, for a half width of one."""
    left = np.array([-(before + after)[1], (before + after)[0]])
    left /= np.linalg.norm(left)
    return np.asarray(left / (left @ np.array([-after[1], after[0]])))


def _leg_facets(leg: Leg) -> list[Facet]:
    plan, index = leg.plan, leg.section
    low, high = np.array(leg.floor), np.array(leg.floor) + plan.height_m
    corners = {
        "left": _quad(leg.left[0], leg.left[1], low[0], low[1], high[1], high[0]),
        "right": _quad(leg.right[1], leg.right[0], low[1], low[0], high[0], high[1]),
        "floor": np.vstack([_at(leg.right, low), _at(leg.left[::-1], low[::-1])]),
        "ceiling": np.vstack([_at(leg.left, high), _at(leg.right[::-1], high[::-1])]),
    }
    facets = [
        Facet("floor", index, corners["floor"], plan.floor, leg.riser_m),
        Facet("ceiling", index, corners["ceiling"], plan.ceiling),
    ]
    for side, look in (("left", plan.left), ("right", plan.right)):
        openings = sorted((o for o in plan.opening if o.side == side), key=lambda o: o.start_m)
        facets += _with_openings(Facet(side, index, corners[side], look), leg, openings)
    return facets


def _at(points: Array, heights: Array) -> Array:
    return np.column_stack([points, heights])


def _quad(near: Array, far: Array, low_near: float, low_far: float, high_far: float, high_near: float) -> Array:
    """Upright quad from ``near`` to ``far``, seen with ``near`` on the left."""
    return np.array([[*near, low_near], [*far, low_far], [*far, high_far], [*near, high_near]])


def _with_openings(wall: Facet, leg: Leg, openings: list[Opening]) -> list[Facet]:
    """The wall with doorways cut out and the niches behind them."""
    if not openings:
        return [wall]
    first = BEHIND_M if leg.section == 0 else 0.0
    cuts = [0.0]
    for opening in openings:
        cuts += [first + opening.start_m, first + opening.start_m + opening.length_m]
    length = float(np.linalg.norm(leg.end - leg.start))
    cuts.append(length)
    parts = zip(cuts[::2], cuts[1::2], strict=True)
    facets = [_part(wall, leg, a, b) for a, b in parts if b > a]
    for opening, start in zip(openings, cuts[1::2], strict=False):
        facets += _niche(wall, leg, start, opening)
    return facets


def _part(wall: Facet, leg: Leg, start_m: float, end_m: float) -> Facet:
    points = leg.left if wall.surface == "left" else leg.right
    a, b = (points[0] + d * leg.direction for d in (start_m, end_m))
    return Facet(wall.surface, wall.section, _upright(wall.surface, a, b, leg), wall.look)


def _upright(side: str, a: Array, b: Array, leg: Leg) -> Array:
    """Wall of a level leg between two plan points, its normal towards the middle."""
    low, high = leg.floor[0], leg.floor[0] + leg.plan.height_m
    near, far = (a, b) if side == "left" else (b, a)
    return _quad(near, far, low, low, high, high)


def _niche(wall: Facet, leg: Leg, start_m: float, opening: Opening) -> list[Facet]:
    """Back and side walls, floor and ceiling of a doorway."""
    points = leg.left if wall.surface == "left" else leg.right
    outward = np.array([-leg.direction[1], leg.direction[0]]) * (1.0 if wall.surface == "left" else -1.0)
    a, b = points[0] + start_m * leg.direction, points[0] + (start_m + opening.length_m) * leg.direction
    deep = opening.depth_m * outward
    look = WallLook(texture=wall.look.texture, contrast=wall.look.contrast, albedo=0.5 * wall.look.albedo)
    ring = [(a, a + deep), (a + deep, b + deep), (b + deep, b)]
    facets = [Facet("niche", wall.section, _upright(wall.surface, p, q, leg), look) for p, q in ring]
    low, high = leg.floor[0], leg.floor[0] + leg.plan.height_m
    plan = np.array([a, b, b + deep, a + deep])
    if wall.surface == "right":
        plan = plan[::-1]
    facets.append(Facet("niche", wall.section, _at(plan, np.full(4, low)), look))
    facets.append(Facet("niche", wall.section, _at(plan[::-1], np.full(4, high)), look))
    return facets


def _steps_in_width(legs: list[Leg]) -> list[Facet]:
    """Walls across the corridor where width or height change from one section to the next."""
    facets = []
    for before, after in pairwise(legs):
        low = max(before.floor[1], after.floor[0])
        wide, narrow, flip = (before, after, 1) if before.plan.width_m > after.plan.width_m else (after, before, -1)
        if wide.plan.width_m > narrow.plan.width_m:
            height = min(before.plan.height_m, after.plan.height_m)
            end = 1 if wide is before else 0
            for side in ("left", "right"):
                points = getattr(wide, side)[end], getattr(narrow, side)[1 - end]
                near, far = points if (side == "left") == (flip > 0) else points[::-1]
                quad = _quad(near, far, low, low, low + height, low + height)
                facets.append(Facet("end", wide.section, quad, wide.plan.left))
        if before.plan.height_m != after.plan.height_m:
            facets.append(_lintel(before, after, low))
    return facets


def _lintel(before: Leg, after: Leg, floor: float) -> Facet:
    tall, end = (before, 1) if before.plan.height_m > after.plan.height_m else (after, 0)
    low, high = (floor + h for h in sorted((before.plan.height_m, after.plan.height_m)))
    near, far = (tall.left[end], tall.right[end]) if end == 1 else (tall.right[end], tall.left[end])
    return Facet("end", tall.section, _quad(near, far, low, low, high, high), tall.plan.ceiling)


def _cap(leg: Leg, *, first: bool) -> Facet:
    at = 0 if first else 1
    low, high = leg.floor[at], leg.floor[at] + leg.plan.height_m
    near, far = (leg.right[at], leg.left[at]) if first else (leg.left[at], leg.right[at])
    return Facet("end", leg.section, _quad(near, far, low, low, high, high), leg.plan.left)


def _corridor(mission: Mission, legs: list[Leg]) -> Corridor:
    sections = []
    for index, plan in enumerate(mission.section):
        own = [leg for leg in legs if leg.section == index]
        height = mission.vehicle.height_m
        start, end = (*own[0].start, own[0].floor[0] + height), (*own[-1].end, own[-1].floor[1] + height)
        sections.append(
            Section(
                kind=plan.kind,
                start=(float(start[0]), float(start[1]), float(start[2])),
                end=(float(end[0]), float(end[1]), float(end[2])),
                width=plan.width_m,
                height=plan.height_m,
            )
        )
    return Corridor(axis=(1.0, 0.0, 0.0), section=tuple(sections))
