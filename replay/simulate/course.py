"""The line that is flown through a corridor, as a smooth function of its length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.world import BEHIND_M, World

Array = NDArray[np.float64]
STEP_M = 0.02
BEND_M = 2.0  # over which a slope begins and ends


@dataclass(frozen=True)
class Course:
    """Where the commanded line runs.

    Attributes
    ----------
    place
        Spline of arc length [m] to position (3,) [m].
    heading
        Spline of arc length [m] to the direction in plan view [rad].
    length_m
        Length to be flown.
    """

    place: BSpline
    heading: BSpline
    length_m: float


def smoothstep(x: Array) -> Array:
    """From 0 to 1 over [0, 1] with three continuous derivatives (degree 7)."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3))


def lay_course(mission: Mission, world: World) -> Course:
    """Round the corners and the ends of the stairs of a corridor's centre line.

    A turn changes the heading by :func:`smoothstep` of the length flown; it begins and ends where its section does.
    """
    turns, cursor = [], -BEHIND_M
    for index, plan in enumerate(mission.section):
        own = [leg for leg in world.legs if leg.section == index]
        run = sum(float(np.linalg.norm(leg.end - leg.start)) for leg in own)
        if plan.kind == "corner":
            turn = np.radians(plan.turn_deg)
            flown = plan.length_m / _reach(turn)
            turns.append((cursor, flown, turn))
            run += flown - 2.0 * plan.length_m
        cursor += run
    grid = np.arange(-BEHIND_M, cursor + STEP_M, STEP_M)
    heading = np.zeros(len(grid))
    for start, flown, turn in turns:
        heading += turn * smoothstep((grid - start) / flown)
    plan_xy = _integrate(np.column_stack([np.cos(heading), np.sin(heading)]), [-BEHIND_M, 0.0])
    height = _heights(mission, world, plan_xy) + mission.vehicle.height_m
    points = np.column_stack([plan_xy, height])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    arc -= np.interp(0.0, grid, arc)
    return Course(
        make_interp_spline(arc, points, k=5),
        make_interp_spline(arc, heading, k=5),
        float(np.interp(cursor - BEHIND_M, grid, arc)),
    )


def _reach(turn: float) -> float:
    """How far a turn of unit length lies before the crossing of its two lines."""
    share = (np.arange(2000) + 0.5) / 2000
    angle = turn * smoothstep(share)
    x, y = float(np.cos(angle).mean()), float(np.sin(angle).mean())
    return float(x - y / np.tan(turn))


def _integrate(slope: Array, start: list[float]) -> Array:
    steps = STEP_M * 0.5 * (slope[1:] + slope[:-1])
    return np.asarray(start + np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]))


def _heights(mission: Mission, world: World, plan_xy: Array) -> Array:
    """Floor under the course, its bends rounded by a smooth average over ``BEND_M``."""
    if not any(plan.rise_m for plan in mission.section):
        return np.zeros(len(plan_xy))
    floor = floor_height(world, plan_xy)
    half = round(0.5 * BEND_M / STEP_M)
    x = np.arange(-half + 0.5, half) / half
    weights = (1.0 - x**2) ** 4
    padded = np.concatenate([np.full(half, floor[0]), floor, np.full(half, floor[-1])])
    smooth = np.convolve(padded, weights / weights.sum(), mode="valid")
    return np.asarray(0.5 * (smooth[1:] + smooth[:-1]))


def floor_height(world: World, points: Array) -> Array:
    """Height of the floor under points (n, 2 or more) [m]: that of the leg whose centre line is nearest."""
    best, height = np.full(len(points), np.inf), np.zeros(len(points))
    for leg in world.legs:
        length = float(np.linalg.norm(leg.end - leg.start))
        along = np.clip((points[:, :2] - leg.start) @ leg.direction, 0.0, length)
        distance = np.linalg.norm(points[:, :2] - leg.start - along[:, None] * leg.direction, axis=1)
        here = leg.floor[0] + along / length * (leg.floor[1] - leg.floor[0])
        height = np.where(distance < best, here, height)
        best = np.minimum(best, distance)
    return height
