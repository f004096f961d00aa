"""From a mission to a flight folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from axialnav.fusion.config import Config, Initial
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.flight_writer import write_flight
from axialnav.replay.simulate.course import lay_course
from axialnav.replay.simulate.data_sheet import append_data_sheets
from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.readings import read_all
from axialnav.replay.simulate.rig import anchors_of, build_rig
from axialnav.replay.simulate.sensors.imu import ImuSheet
from axialnav.replay.simulate.sensors.tof import TofSheet
from axialnav.replay.simulate.streams import Streams
from axialnav.replay.simulate.surfaces import surfaces_of
from axialnav.replay.simulate.vehicle import Trajectory, fly
from axialnav.replay.simulate.world import World, build_world

GRAVITY_M_S2 = 9.80665
START_POSITION_M, START_VELOCITY_M_S, START_YAW_RAD = 0.05, 0.02, 0.01  # how well take-off is known


@dataclass(frozen=True)
class Flown:
    """A mission with its corridor and the way that was flown through it."""

    mission: Mission
    world: World
    trajectory: Trajectory
    streams: Streams


def fly_mission(mission: Mission, seed: int = 0) -> Flown:
    """Build the corridor of a checked mission and fly it; equal missions and seeds give equal flights.

    Raises
    ------
    ConfigError
        An anchor lies inside of a wall.
    """
    world = build_world(mission)
    _check_anchors(mission, world)
    streams = Streams(seed)
    course = lay_course(mission, world)
    trajectory = fly(mission.vehicle, course, mission.duration_s, GRAVITY_M_S2, streams.of("vehicle"))
    return Flown(mission, world, trajectory, streams)


def simulate(
    mission: Mission,
    out: Path,
    *,
    seed: int = 0,
    frames: bool = True,
    progress: Callable[[float], None] | None = None,
) -> Flight:
    """Fly a mission and write it as a flight folder.

    Parameters
    ----------
    mission
        Checked, see :func:`~axialnav.replay.simulate.scenarios.mission_of`.
    out
        Folder to write; equal missions and seeds write equal bytes.
    seed
        Of everything random.
    frames
        Whether to render the camera.
    progress
        Called with the share done.

    Raises
    ------
    ConfigError
        A mission that cannot be flown.
    FlightError
        ``out`` holds a flight already or cannot be written.
    """
    if (out / "flight.toml").exists() or (out / "mav0").exists():
        raise FlightError(f"{out}: holds a flight already; remove it or choose another folder")
    flown = fly_mission(mission, seed)
    flight = sensed(flown, out, frames=frames)
    if frames:
        flight = replace(flight, tables={**flight.tables, "cam0": _film(flown, out, progress)})
    write_flight(flight, out)
    append_data_sheets(out, mission, ImuSheet(), TofSheet())
    return flight


def sensed(flown: Flown, path: Path, *, frames: bool) -> Flight:
    """The flight in memory with all readings but the camera's pictures."""
    mission = flown.mission
    sheets = ImuSheet(), TofSheet()
    rig = build_rig(mission, *sheets, frames, flown.streams.of("calibration"))
    readings = read_all(mission, flown.world, flown.trajectory, rig, sheets, flown.streams)
    config = Config(
        gravity_m_s2=GRAVITY_M_S2,
        corridor=flown.world.corridor,
        initial=_initial(flown),
        surface=surfaces_of(flown.world, mission.camera.side, sheets[1].rate_hz / mission.vehicle.speed_m_s),
        sensor=rig,
    )
    info = {"source": "axialnav simulate", "licence": "CC0-1.0", "note": f"simulated, seed {flown.streams.seed}"}
    window = (0.5 * mission.vehicle.still_s, None)
    return Flight(mission.name, path, info, config, readings.tables, readings.truth, None, window)


def _film(flown: Flown, out: Path, progress: Callable[[float], None] | None) -> SensorTable:
    from axialnav.replay.simulate.sensors.camera import CameraOnBoard, frame_instants, take_pictures

    mission, folder = flown.mission, out / "mav0" / "cam0" / "data"
    board = CameraOnBoard(mission, flown.world, flown.trajectory, flown.streams)
    instants = frame_instants(mission, flown.trajectory.duration_s, flown.streams.of("frames"))
    try:
        return take_pictures(mission, board, instants, folder, progress)
    except OSError as error:
        raise FlightError(f"{out}: cannot be written: {error.strerror or error}") from None


def _initial(flown: Flown) -> Initial:
    """What is known at take-off: the truth and an error of the size that is stated."""
    start, rng = flown.trajectory.at(np.zeros(1)), flown.streams.of("initial")
    x, y, z = (start.position_m[0] + START_POSITION_M * rng.normal(size=3)).tolist()
    u, v, w = (start.velocity_m_s[0] + START_VELOCITY_M_S * rng.normal(size=3)).tolist()
    yaw = float(start.rotation_WB[0].as_euler("ZYX")[0]) + START_YAW_RAD * float(rng.normal())
    return Initial(
        position_m=(x, y, z),
        velocity_m_s=(u, v, w),
        yaw_rad=yaw,
        sigma_position_m=START_POSITION_M,
        sigma_velocity_m_s=START_VELOCITY_M_S,
        sigma_yaw_rad=START_YAW_RAD,
    )


def _check_anchors(mission: Mission, world: World) -> None:
    if mission.uwb.condition == "none":
        return
    for name, place in anchors_of(mission).items():
        if not bool(world.inside(np.array([place]))[0]):
            raise ConfigError(
                f"mission {mission.name}: anchor {name} at {place} is inside a wall or outside of the corridor; "
                "place it between floor, ceiling and side walls"
            )
    few = len(anchors_of(mission))
    if few < 2 and mission.uwb.measurement == "tdoa":
        raise ConfigError(f"mission {mission.name}: range differences need at least 2 anchors, got {few}; add one")
