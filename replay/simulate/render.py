"""Render a window of camera frames of a wall, with the displacement that is true for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.motion import Trajectory, displacement_px, dropped_frame, duplicated_frame
from axialnav.replay.simulate.noise import BRIGHT, DARK, DIM, LightLevel
from axialnav.replay.simulate.scene import CameraModel, Disturbance, Scene
from axialnav.replay.simulate.sensor import Sensor
from axialnav.replay.simulate.view import light_frames
from axialnav.replay.simulate.walls import Wall, brick_wall, fractal_wall, photographic_wall

__all__ = [
    "BRIGHT",
    "DARK",
    "DIM",
    "CameraModel",
    "Disturbance",
    "LightLevel",
    "Rendering",
    "Scene",
    "Trajectory",
    "Wall",
    "brick_wall",
    "displacement_px",
    "dropped_frame",
    "duplicated_frame",
    "fractal_wall",
    "photographic_wall",
    "render_frames",
]


@dataclass(frozen=True)
class Rendering:
    """Frames and what is true for them.

    Parameters
    ----------
    frames
        Pictures, uint8, shape (n, h, w).
    positions_px
        Where the wall's picture is in the middle of every exposure, x to the right and y down [px], shape (n, 2);
        under yaw in px of a camera that looks squarely at the wall.
    scene
        What was rendered.
    """

    frames: NDArray[np.uint8]
    positions_px: NDArray[np.float64]
    scene: Scene

    @property
    def displacement_px(self) -> float:
        """Mean displacement along the rows per frame, middle of exposure to middle of exposure [px].

        Taken where the optical axis meets the wall: under a yaw ``th`` the picture moves there by ``cos(th)^2`` of
        what a square camera sees. NaN for a single frame.
        """
        return self._per_frame(0) * math.cos(self.scene.trajectory.yaw_rad) ** 2

    @property
    def drift_px(self) -> float:
        """Mean displacement down the columns per frame [px]; NaN for a single frame."""
        return self._per_frame(1) * math.cos(self.scene.trajectory.yaw_rad)

    @property
    def blur_px(self) -> float:
        """Mean length of the blur of one exposure along the rows [px], never negative."""
        trajectory = self.scene.trajectory
        speed = abs(trajectory.displacement_px) * math.cos(trajectory.yaw_rad) ** 2
        return speed * self.scene.camera.exposure_ratio

    def _per_frame(self, axis: int) -> float:
        steps = len(self.positions_px) - 1
        return float(self.positions_px[-1, axis] - self.positions_px[0, axis]) / steps if steps else math.nan


def render_frames(scene: Scene, frames: int, rng: np.random.Generator) -> Rendering:
    """Render a window of frames; equal scenes and equal generators give equal bytes.

    The generator chooses the part of the wall, the random parts of the motion, fixed patterns, occluders' surfaces,
    lamp phase and noise.

    Parameters
    ----------
    scene
        What to render.
    frames
        Number of frames, at least one.
    rng
        Source of all randomness.

    Raises
    ------
    ConfigError
        If the scene contradicts itself (frame times of another number, unknown occluder).
    """
    path = scene.trajectory.path(frames, rng)
    sensor = Sensor(scene, rng)
    out = np.empty((frames, scene.camera.height, scene.camera.width), dtype=np.uint8)
    for k, light in enumerate(light_frames(scene, path, rng)):
        repeated = k > 0 and path.times[k] == path.times[k - 1]
        out[k] = out[k - 1] if repeated else sensor.picture(light, float(path.times[k]), rng)
    return Rendering(out, path.middle_px(), scene)
