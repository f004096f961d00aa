"""Where each pixel of a rolled, yawed or distorted camera looks on the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.exposure import row_delays
from axialnav.replay.simulate.kernels import resample
from axialnav.replay.simulate.motion import Path
from axialnav.replay.simulate.optics import undistorted
from axialnav.replay.simulate.scene import Scene
from axialnav.replay.simulate.walls import OVERSAMPLING

Array = NDArray[np.float64]
CUBIC_REACH_PX = 3


@dataclass(frozen=True)
class Extent:
    """Part of the wall a frame needs, in whole px of the picture; right and bottom are exclusive."""

    left: int
    right: int
    top: int
    bottom: int


class Pinhole:
    """Maps a wall picture that already has its exposure blur to the camera's pixels.

    A squarely mounted camera without distortion, roll or readout time is ``square`` and needs no resampling. Yaw and
    distortion stretch the picture, so that lens and pixel must come after them: then the map is as dense as the wall
    (``density`` 2), otherwise lens and pixel are part of the wall picture and it is as dense as the pixels (1).
    """

    def __init__(self, scene: Scene, path: Path) -> None:
        camera = scene.camera
        self.square = not (path.roll_rad.any() or path.trajectory.yaw_rad or camera.k1 or camera.k2 or camera.readout_s)
        self.density = OVERSAMPLING if path.trajectory.yaw_rad or camera.k1 or camera.k2 else 1
        self._scene, self._path = scene, path
        width, height = camera.width, camera.height
        self.centre = (0.5 * (width - 1), 0.5 * (height - 1))
        if not self.square:
            u = np.arange(width * self.density) / self.density - self.centre[0]
            v = np.arange(height) - self.centre[1]
            grid = np.meshgrid(u, v)
            self._x, self._y = undistorted(grid[0], grid[1], camera.focal_px, camera.k1, camera.k2)

    def extent(self) -> Extent:
        """The wall in view of any frame, shifts of the rolling shutter included."""
        camera = self._scene.camera
        if self.square:
            return Extent(0, camera.width, 0, camera.height)
        x, y = self._border()
        shift = np.abs(np.vstack([self.row_shift(k) for k in range(len(self._path.times))])).max(axis=0)
        pad = shift + CUBIC_REACH_PX
        return Extent(
            math.floor(x.min() - pad[0] + self.centre[0]),
            math.ceil(x.max() + pad[0] + self.centre[0]) + 1,
            math.floor(y.min() - pad[1] + self.centre[1]),
            math.ceil(y.max() + pad[1] + self.centre[1]) + 1,
        )

    def row_shift(self, frame: int) -> Array:
        """Motion of the wall's picture between the middle of a frame and the exposure of each row [px], (h, 2)."""
        delay = row_delays(self._scene.camera.height, self._scene.camera.readout_ratio)
        x, y = self._path.position_px(frame, delay)
        x0, y0 = self._path.position_px(frame, np.zeros(1))
        return np.stack([x - x0, y - y0], axis=1)

    def look(self, wall: NDArray[np.float32], left: float, top: float, frame: int) -> NDArray[np.float32]:
        """Picture of one frame, shape (h, w * density); ``left``, ``top`` place ``wall[0, 0]`` in the picture [px]."""
        out = np.empty(self._x.shape, dtype=np.float32)
        roll, yaw = float(self._path.roll_rad[frame]), self._path.trajectory.yaw_rad
        resample(
            wall,
            self._x,
            self._y,
            (math.cos(roll), math.sin(roll)),
            (math.cos(yaw), math.sin(yaw)),
            self._scene.camera.focal_px,
            self.row_shift(frame),
            left - self.centre[0],
            top - self.centre[1],
            OVERSAMPLING,
            out,
        )
        return out

    def _border(self) -> tuple[Array, Array]:
        """Wall coordinates of the picture's rim under the extreme rolls, relative to the principal point [px]."""
        rim_x = np.concatenate([self._x[0], self._x[-1], self._x[:, 0], self._x[:, -1]])
        rim_y = np.concatenate([self._y[0], self._y[-1], self._y[:, 0], self._y[:, -1]])
        yaw, focal = self._path.trajectory.yaw_rad, self._scene.camera.focal_px
        xs, ys = [], []
        for roll in (self._path.roll_rad.min(), self._path.roll_rad.max(), 0.0):
            x = math.cos(roll) * rim_x - math.sin(roll) * rim_y
            y = math.sin(roll) * rim_x + math.cos(roll) * rim_y
            depth = math.cos(yaw) + x / focal * math.sin(yaw)
            xs.append((x * math.cos(yaw) - focal * math.sin(yaw)) / depth)
            ys.append(y / depth)
        return np.concatenate(xs), np.concatenate(ys)
