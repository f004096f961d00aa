"""What the filter is told of a corridor is what the beams meet."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.models.faces import nearest_face
from axialnav.models.rig import Surface
from axialnav.replay.simulate.demo import demo_mission
from axialnav.replay.simulate.flight import fly_mission
from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.rays import cast
from axialnav.replay.simulate.rig import DOWN, LEFT
from axialnav.replay.simulate.scenarios import mission_of
from axialnav.replay.simulate.surfaces import surfaces_of


@pytest.mark.parametrize("mission", [demo_mission(), mission_of("mission"), mission_of("corner")], ids=lambda m: m.name)
@pytest.mark.parametrize(("name", "axes"), [("wall", LEFT), ("floor", DOWN)])
def test_a_told_surface_is_as_far_as_the_corridor_itself(mission: Mission, name: str, axes: np.ndarray) -> None:
    flown = fly_mission(mission, seed=1)
    surface: Surface = surfaces_of(flown.world, "left", 50.0)[name]
    faces = surface.face or ()
    rows = np.array([(*f.normal, f.offset_m, *f.start, *f.end, f.roughness_m) for f in faces])
    if not faces:
        rows = np.array([(*surface.normal, surface.offset_m, -1e3, -1e3, 0, 1e3, 1e3, 0, 0.0)])
    motion = flown.trajectory.at(np.arange(0.0, flown.trajectory.duration_s, 0.1))
    rotation = motion.rotation_WB.as_matrix()
    hits = cast(flown.world, motion.position_m, rotation @ axes[:, 2])
    work, agree, seen = np.zeros(8), 0, 0
    for position, R, distance, facet in zip(motion.position_m, rotation, hits.distance_m, hits.facet, strict=True):
        if flown.world.facets[facet].surface == "niche":
            continue
        seen += 1
        face = nearest_face(rows, np.int64(len(rows)), position, R, np.zeros(3), axes[:, 2].copy(), work)
        if face >= 0:
            normal, offset = rows[face, :3], rows[face, 3]
            told = (offset - normal @ position) / (normal @ (R @ axes[:, 2]))
            agree += abs(told - distance) < 1e-6
    assert agree >= 0.99 * seen
