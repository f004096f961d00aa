"""Every camera of every built-in flight keeps its walls in front of it while its shutter is open."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.replay.simulate.demo import demo_mission
from axialnav.replay.simulate.flight import fly_mission
from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.posed import Poses
from axialnav.replay.simulate.scenarios import BUILT_IN, mission_of
from axialnav.replay.simulate.sensors.camera import CameraOnBoard, frame_instants
from axialnav.replay.simulate.walls import fractal_wall

MISSIONS = [demo_mission(), *map(mission_of, BUILT_IN)]
NEAR_M = 0.05  # farther than any of these cameras flies during an exposure


def on_board(mission: Mission) -> tuple[CameraOnBoard, np.ndarray]:
    """A flight's camera with one small picture for all its walls, and when it takes its pictures."""
    flown = fly_mission(mission, seed=0)
    board = CameraOnBoard(mission, flown.world, flown.trajectory, flown.streams)
    wall = fractal_wall(np.random.default_rng(1), rows_px=64, cols_px=64)
    board.view = type(board.view)(flown.world, board.model, 0.01, lambda texture: wall)
    return board, frame_instants(mission, flown.trajectory.duration_s, flown.streams.of("frames"))


def passings(board: CameraOnBoard, instants: np.ndarray) -> list[tuple[Poses, int]]:
    """Pictures and groups whose plane is a few centimetres in front of the camera."""
    pairs = [(board.poses(t), t) for t in instants]
    places = np.concatenate([poses(np.zeros(1))[0] for poses, _ in pairs])
    found = []
    for number in board.view.groups:
        depth = board.view.plane(number).depth_m(places)
        found += [(pairs[k][0], number) for k in np.flatnonzero((depth > 0.0) & (depth < NEAR_M)).tolist()]
    return found


@pytest.mark.parametrize("mission", MISSIONS, ids=lambda m: m.name)
def test_no_wall_is_filmed_from_behind(mission: Mission) -> None:
    board, instants = on_board(mission)
    reach = 0.5 * (board.model.exposure_s + board.model.readout_s)
    held = 0
    for poses, number in passings(board, instants):
        filmed = board.view.poses_before(number, poses)
        held += filmed is not poses
        for position, rotation in zip(*filmed(np.linspace(-reach, reach, 5)), strict=True):
            assert np.isfinite(board.view.plane(number).homography(position, rotation, board.model)).all()
    assert held > 0 or mission.name == "stairs"  # doorways and corners are passed while the shutter is open


def test_a_doorway_passed_during_an_exposure_is_a_picture_like_its_neighbours() -> None:
    board, instants = on_board(demo_mission())
    held = [p for p, number in passings(board, instants) if board.view.poses_before(number, p) is not p]
    light = board.view.light(held[0])
    before = board.view.light(lambda delay: held[0](delay - 0.01))  # the side is wholly in front
    assert np.isfinite(light).all()
    assert np.corrcoef(light.ravel(), before.ravel())[0, 1] > 0.9
    assert (light == 0.0).mean() < 0.001
