"""Corridors are closed, beams and lines of sight agree with walking along them in small steps."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.replay.simulate.flight import fly_mission
from axialnav.replay.simulate.rays import cast, sees
from axialnav.replay.simulate.scenarios import mission_of
from axialnav.replay.simulate.world import World, build_world

Array = NDArray[np.float64]
SCENARIOS = ("straight", "stairs", "corner", "mission")


def some_points(world: World, rng: np.random.Generator, count: int) -> Array:
    """Points inside of a corridor."""
    corners = np.concatenate([f.corners for f in world.facets if f.surface != "niche"])
    points = rng.uniform(corners.min(axis=0), corners.max(axis=0), (400 * count, 3))
    return points[world.inside(points)][:count]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_no_beam_leaves_a_corridor(scenario: str) -> None:
    rng = np.random.default_rng(1)
    world = build_world(mission_of(scenario))
    points = some_points(world, rng, 2000)
    beams = rng.normal(size=(len(points), 3))
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    hits = cast(world, points, beams)
    assert (hits.facet >= 0).all()
    assert (hits.distance_m > 0.0).all()
    before = points + (hits.distance_m - 1e-3)[:, None] * beams
    plain = np.array([world.facets[f].surface != "niche" for f in hits.facet])
    in_niche = ~world.inside(before)
    assert (in_niche <= np.array([scenario == "straight"])).all() or not (in_niche & plain).any()


@pytest.mark.parametrize("scenario", ["stairs", "corner", "mission"])
def test_line_of_sight_agrees_with_small_steps(scenario: str) -> None:
    rng = np.random.default_rng(2)
    world = build_world(mission_of(scenario))
    points = some_points(world, rng, 1200)
    first, second = points[: len(points) // 2], points[len(points) // 2 : 2 * (len(points) // 2)]
    share = np.linspace(0.0, 1.0, 1500)[1:-1]
    brute = np.array([world.inside(a + share[:, None] * (b - a)).all() for a, b in zip(first, second, strict=True)])
    exact = sees(world, first, second)
    assert 0.1 < exact.mean() < 0.9
    # a line may graze a wall for less than a step: only there the two may differ
    assert (exact != brute).mean() <= 0.004
    assert not (exact & ~brute).any() or (exact & ~brute).sum() <= 1


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_flights_stay_inside_and_move_smoothly(scenario: str) -> None:
    flown = fly_mission(mission_of(scenario), seed=3)
    t = np.arange(0.0, flown.trajectory.duration_s, 0.01)
    motion = flown.trajectory.at(t)
    assert flown.world.inside(motion.position_m).all()
    steps = np.abs(np.diff(motion.accel_m_s2, axis=0)).max() / 0.01
    assert steps < 6.0  # jerk [m/s^3]
    assert np.abs(motion.velocity_m_s[0]).max() < 1e-6
    assert np.abs(motion.velocity_m_s[-1]).max() < 0.15  # hovers at the end, held by its controller
