"""The wall camera: pictures along a flight, written as they are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.camera_codec import LOSSLESS_PNG
from axialnav.replay.flight import SensorTable
from axialnav.replay.simulate.corridor_view import CorridorView
from axialnav.replay.simulate.mission import CameraPlan, Mission
from axialnav.replay.simulate.noise import BRIGHT, DARK, DIM
from axialnav.replay.simulate.rig import CAMERA_M, side_axes
from axialnav.replay.simulate.scene import CameraModel, Disturbance, Scene
from axialnav.replay.simulate.sensor import Sensor
from axialnav.replay.simulate.streams import START_NS, Streams, stamps
from axialnav.replay.simulate.vehicle import Trajectory
from axialnav.replay.simulate.walls import Wall, brick_wall, photographic_wall
from axialnav.replay.simulate.world import World

Array = NDArray[np.float64]
LEVELS = {"bright": BRIGHT, "dim": DIM, "dark": DARK}
DROP_SHARE = 0.01
FIRST_FRAME_S = 0.05
SHAKE_HZ = (61.0, 87.0)
SHAKE_RAD = 1.5e-4  # of the airframe per m/s^2 of vibration
ROWS_PX, COLS_PX = 960, 4224
PHOTOGRAPHS = {"mixed": ("concrete", "plaster", "rock")}


@dataclass(frozen=True)
class Shake:
    """Small rotations of the airframe that are faster than the inertial samples."""

    amplitude_rad: float
    phase: Array

    def at(self, t_s: Array) -> Array:
        """Rotation vectors in camera axes [rad], shape (n, 3)."""
        waves = np.sin(2.0 * np.pi * t_s[:, None, None] * np.array(SHAKE_HZ) + self.phase)
        return np.asarray(self.amplitude_rad * waves.sum(axis=2))


def camera_model(plan: CameraPlan) -> CameraModel:
    """The renderer's camera for a plan."""
    return CameraModel(
        width=plan.width_px,
        height=plan.height_px,
        focal_px=plan.focal_px,
        frame_period_s=1.0 / plan.rate_hz,
        exposure_s=plan.exposure_s,
        readout_s=plan.readout_s,
        vignette=plan.vignette,
        pixel_pattern=plan.pixel_pattern,
        column_pattern=plan.column_pattern,
    )


class CameraOnBoard:
    """Takes pictures along a trajectory.

    Parameters
    ----------
    mission, world, trajectory
        What is flown, and where.
    streams
        Random numbers.
    """

    def __init__(self, mission: Mission, world: World, trajectory: Trajectory, streams: Streams) -> None:
        plan = mission.camera
        self.model = camera_model(plan)
        self._trajectory = trajectory
        self._axes = side_axes(plan.side)
        self._lever = np.array(CAMERA_M[plan.side])
        pitch_m = mission.camera_distance_m / plan.focal_px
        self._walls: dict[str, Wall] = {}
        self._streams = streams
        self.view = CorridorView(world, self.model, pitch_m, self._picture)
        rng = streams.of("cam0")
        light = Disturbance(flicker_depth=plan.flicker_depth, flicker_hz=plan.flicker_hz)
        scene = Scene(
            Wall("none", np.zeros((1, 2), dtype=np.float32)), 0.0, LEVELS[plan.light], self.model, disturbance=light
        )
        self._sensor = Sensor(scene, rng)
        phase = rng.uniform(0.0, 2.0 * np.pi, (1, 3, len(SHAKE_HZ)))
        self._shake = Shake(SHAKE_RAD * mission.vehicle.vibration_m_s2, phase)
        self._rng = rng

    def poses(self, t_s: float) -> Callable[[Array], tuple[Array, Array]]:
        """Camera poses around an instant: position [m] and rotation R_WS at delays [s]."""

        def at(delay: Array) -> tuple[Array, Array]:
            """State a delay (n,) [s] after the stamps."""
            t = t_s + delay
            body = self._trajectory.rotation(t)
            position = self._trajectory.position(t) + body.apply(self._lever)
            rotation = body.as_matrix() @ self._axes @ Rotation.from_rotvec(self._shake.at(t)).as_matrix()
            return position, rotation

        return at

    def light(self, t_s: float) -> NDArray[np.float32]:
        """Relative light on the sensor around an instant, shape (h, w)."""
        return self.view.light(self.poses(t_s))

    def picture(self, t_s: float) -> NDArray[np.uint8]:
        """Picture whose exposure has its middle at ``t_s`` [s], shape (h, w); advances the noise."""
        return self._sensor.picture(self.light(t_s), t_s / self.model.frame_period_s, self._rng)

    def _picture(self, texture: str) -> Wall:
        if texture not in self._walls:
            rng = self._streams.of(f"texture {texture}")
            if texture == "brick":
                self._walls[texture] = brick_wall(rng, rows_px=ROWS_PX, cols_px=COLS_PX)
            else:
                self._walls[texture] = photographic_wall(rng, PHOTOGRAPHS.get(texture, (texture,)), ROWS_PX, COLS_PX)
        return self._walls[texture]


def frame_instants(mission: Mission, duration_s: float, rng: np.random.Generator) -> Array:
    """Middles of the exposures [s]; the fault ``frame_drops`` leaves some out."""
    count = int((duration_s - 2.0 * FIRST_FRAME_S) * mission.camera.rate_hz)
    t = FIRST_FRAME_S + np.arange(count) / mission.camera.rate_hz
    if "frame_drops" in mission.faults:
        t = t[rng.random(count) >= DROP_SHARE]
    return t


def take_pictures(
    mission: Mission,
    board: CameraOnBoard,
    instants_s: Array,
    folder: Path,
    progress: Callable[[float], None] | None = None,
) -> SensorTable:
    """Write one PNG per instant into ``folder`` and list them.

    Raises
    ------
    FlightError
        A picture cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    t_ns = stamps(instants_s)
    names = [f"{stamp}.png" for stamp in t_ns.tolist()]
    for k, (stamp, name) in enumerate(zip(t_ns.tolist(), names, strict=True)):
        picture = board.picture((stamp - START_NS) * 1e-9)
        if not cv2.imwrite(str(folder / name), picture, LOSSLESS_PNG):
            raise FlightError(f"{folder / name}: cannot be written; is the disk full?")
        if progress is not None:
            progress((k + 1) / len(names))
    exposure = np.full(len(names), mission.camera.exposure_s)
    return SensorTable(t_ns, {"filename": np.array(names, dtype=np.str_), "exposure_s": exposure})
