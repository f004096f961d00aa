"""A wall in space, seen by a camera whose pose changes while the shutter is open: what a simulated flight needs.

``render`` moves a picture by pixels; this moves a camera by metres and radians past a plane.  Distance, yaw, pitch,
roll, rotation during the exposure and the rolling shutter all follow from the poses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.exposure import row_delays
from axialnav.replay.simulate.optics import lens_taps, row_taps
from axialnav.replay.simulate.scene import CameraModel
from axialnav.replay.simulate.walls import OVERSAMPLING, Image, Wall

Array = NDArray[np.float64]
Poses = Callable[[Array], tuple[Array, Array]]
"""Delays against the middle of the exposure [s] (m,) to camera positions [m] (m, 3) and rotations R_WS (m, 3, 3)."""
NODES, NODES_PER_PX = 3, 0.8  # enough for waves of two pixels and more, all that lens and pixel leave
MAX_VIEW_PX = 40_000_000
ROWS_TOGETHER = 16  # of a rolling shutter share their poses


@dataclass(frozen=True)
class WallPlane:
    """A wall picture on a plane in world coordinates.

    Parameters
    ----------
    wall
        The picture; it repeats endlessly.
    pitch_m
        Size of one px of the wall [m]; about one camera px at the usual distance.
    origin_m
        World position of the picture's first sample [m].
    right, down
        Unit world vectors along the picture's rows and columns, as seen by who looks at the wall.
    contrast
        Standard deviation over mean of the whole picture [-].

    Raises
    ------
    ConfigError
        If the pitch is not positive or the axes are not orthonormal.
    """

    wall: Wall
    pitch_m: float
    origin_m: tuple[float, float, float]
    right: tuple[float, float, float]
    down: tuple[float, float, float]
    contrast: float = 0.05

    def __post_init__(self) -> None:
        if not self.pitch_m > 0.0:
            raise ConfigError(f"pitch_m of a wall must be positive, got {self.pitch_m}")
        gram = self.axes[:2] @ self.axes[:2].T
        if not np.allclose(gram, np.eye(2), atol=1e-6):
            raise ConfigError(
                f"right and down of a wall must be orthogonal unit vectors, got {self.right}, {self.down}"
            )

    @cached_property
    def axes(self) -> Array:
        """Rows: right, down and the normal into the wall, shape (3, 3)."""
        right, down = np.array(self.right, dtype=np.float64), np.array(self.down, dtype=np.float64)
        return np.stack([right, down, np.cross(right, down)])

    @cached_property
    def scale(self) -> tuple[float, float]:
        """Mean of the picture and what its deviations are multiplied with to reach the contrast."""
        deviation = float(self.wall.image.std())
        return float(self.wall.image.mean()), self.contrast / max(deviation, 1e-12)

    def view(self, low: Array, high: Array) -> tuple[Image, Array]:
        """Relative light, mean 1, of the part between two corners [px], and the px at which it starts, (x, y)."""
        start = np.floor(low).astype(int) - 1
        size = np.ceil(high).astype(int) + 2 - start
        if int(size[0]) * int(size[1]) > MAX_VIEW_PX:
            raise ConfigError(
                f"the camera sees {size[0]} x {size[1]} px of a wall, the limit is {MAX_VIEW_PX} in all; "
                "turn it towards the wall, come closer or give the wall a larger pitch_m"
            )
        mean, gain = self.scale
        part = self.wall.crop(int(start[1]), int(size[1]), int(start[0]), int(size[0]))
        part -= np.float32(mean)
        part *= np.float32(gain)
        part += np.float32(1.0)
        return part, start.astype(np.float64)

    def depth_m(self, position_m: Array) -> Array:
        """Distance in front of the plane, negative behind it; position_m (..., 3) [m] -> (...)."""
        return np.asarray((np.array(self.origin_m) - position_m) @ self.axes[2])

    def homography(self, position_m: Array, rotation_WS: Array, camera: CameraModel) -> Array:
        """Matrix from homogeneous pixels to wall px, shape (3, 3).

        Raises
        ------
        ConfigError
            If the camera is on or behind the wall.
        """
        to_ray = np.array(
            [
                [1.0 / camera.focal_px, 0.0, -0.5 * (camera.width - 1) / camera.focal_px],
                [0.0, 1.0 / camera.focal_px, -0.5 * (camera.height - 1) / camera.focal_px],
                [0.0, 0.0, 1.0],
            ]
        )
        ray = self.axes @ rotation_WS @ to_ray
        offset = self.axes @ (position_m - np.array(self.origin_m))
        if not offset[2] < 0.0:
            raise ConfigError(f"the camera is {offset[2]:.3g} m behind the wall; keep it in front")
        rows = (offset[:2, None] * ray[2] - offset[2] * ray[:2]) / self.pitch_m
        return np.vstack([rows, ray[2]])


@dataclass(frozen=True)
class Window:
    """Part of a picture [px]: left and top corner, width and height."""

    left: int
    top: int
    width: int
    height: int


def posed_light(
    plane: WallPlane,
    camera: CameraModel,
    poses: Poses,
    window: Window | None = None,
    extent_px: tuple[Array, Array] | None = None,
) -> Image:
    """Relative light on the sensor while the shutter is open, 1 = mean of the wall.

    Parameters
    ----------
    plane
        The wall in view; it must fill the window.
    camera
        Size, focal length, exposure, readout and lens; its distortion is not applied.
    poses
        Where the camera is around the middle of the exposure.
    window
        Part of the picture to make; None for all of it.
    extent_px
        Lowest and highest point of the wall that matter [px of the wall], (2,) each; beyond them its rim repeats.
        None: all that the window sees.

    Returns
    -------
    ndarray, float32, shape (height, width) of the window

    Raises
    ------
    ConfigError
        If the camera is behind the wall or looks past it.
    """
    window = window or Window(0, 0, camera.width, camera.height)
    bands = _bands(camera, window)
    delays = row_delays(camera.height, camera.readout_s)
    exposures = [_exposure(plane, camera, poses, float(delays[band].mean())) for band in bands]
    if extent_px is None:
        rims = [_rim(maps, window, band) for (maps, _), band in zip(exposures, bands, strict=True)]
        extent_px = np.min([r.min(axis=0) for r in rims], axis=0), np.max([r.max(axis=0) for r in rims], axis=0)
    light, start = plane.view(*extent_px)
    to_sample = np.array([[OVERSAMPLING, 0.0, -OVERSAMPLING * start[0]], [0.0, 1.0, -start[1]], [0.0, 0.0, 1.0]])
    raw = np.empty((window.height, OVERSAMPLING * window.width), dtype=np.float32)
    for band, (maps, weights) in zip(bands, exposures, strict=True):
        to_pixel = np.array([[1.0 / OVERSAMPLING, 0.0, window.left], [0.0, 1.0, band.start], [0.0, 0.0, 1.0]])
        _expose(light, to_sample @ maps @ to_pixel, weights, raw[band.start - window.top : band.stop - window.top])
    return _decimated(raw, row_taps(camera.lens_sigma_px, OVERSAMPLING), _column(camera))


def _bands(camera: CameraModel, window: Window) -> list[slice]:
    """Rows that are exposed together."""
    step = ROWS_TOGETHER if camera.readout_s > 0.0 else window.height
    bottom = window.top + window.height
    return [slice(first, min(first + step, bottom)) for first in range(window.top, bottom, step)]


def _expose(light: Image, maps: Array, weights: NDArray[np.float32], out: Image) -> None:
    """Weighted sum of a plane picture over several homographies, bilinear between its samples."""
    size = (out.shape[1], out.shape[0])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    out[:] = 0.0
    for matrix, weight in zip(maps, weights.tolist(), strict=True):
        seen = cv2.warpPerspective(
            light, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE, hint=cv2.ALGO_HINT_ACCURATE
        )
        cv2.scaleAdd(seen, weight, out, out)


def _decimated(raw: Image, taps: NDArray[np.float32], column: NDArray[np.float32]) -> Image:
    """Filter rows and columns and keep every second sample of a row, computing only what is kept."""
    centre, parts = len(taps) // 2, []
    for phase in range(OVERSAMPLING):  # samples 2 u + phase + 2 j meet the taps centre + phase + 2 j
        reach = (centre - phase) // OVERSAMPLING + phase
        offsets = phase + OVERSAMPLING * np.arange(-reach, reach + 1)
        index = centre + offsets
        part = np.where((index >= 0) & (index < len(taps)), taps[np.clip(index, 0, len(taps) - 1)], np.float32(0.0))
        samples = np.ascontiguousarray(raw[:, phase::OVERSAMPLING])
        parts.append(cv2.sepFilter2D(samples, cv2.CV_32F, part, column, borderType=cv2.BORDER_REPLICATE))
    return np.asarray(sum(parts[1:], start=parts[0]), dtype=np.float32)


def _exposure(plane: WallPlane, camera: CameraModel, poses: Poses, delay_s: float) -> tuple[Array, NDArray[np.float32]]:
    """Homographies (m, 3, 3) at the Gauss-Legendre nodes of an exposure, as many as its blur needs; weights (m,)."""
    ends = delay_s + camera.exposure_s * np.array([-0.5, 0.5])
    first, last = (plane.homography(p, r, camera) for p, r in zip(*poses(ends), strict=True))
    blur = max(_motion(first, last, u, v) for u in (0, camera.width) for v in (0, camera.height))
    abscissae, weights = np.polynomial.legendre.leggauss(NODES + math.ceil(NODES_PER_PX * blur))
    times = delay_s + 0.5 * camera.exposure_s * abscissae
    maps = np.stack([plane.homography(p, r, camera) for p, r in zip(*poses(times), strict=True)])
    return maps, np.asarray(0.5 * weights, dtype=np.float32)


def _rim(maps: Array, window: Window, band: slice) -> Array:
    """Where the corners of some rows of a window lie on the wall during the exposure [px], shape (4 m, 2)."""
    left, right = window.left, window.left + window.width
    corners = np.array([[u, v, 1.0] for u in (left, right) for v in (band.start, band.stop)])
    seen = (maps @ corners.T).swapaxes(1, 2).reshape(-1, 3)
    if not float(seen[:, 2].min()) > 0.0:
        raise ConfigError("the camera looks past the end of the wall; turn it towards the wall or narrow its view")
    return np.asarray(seen[:, :2] / seen[:, 2:])


def _motion(first: Array, last: Array, u: float, v: float) -> float:
    """How far the picture at a pixel moves between two homographies [px]."""
    back = np.linalg.solve(last, first @ np.array([u, v, 1.0]))
    return float(np.hypot(back[0] / back[2] - u, back[1] / back[2] - v))


def _column(camera: CameraModel) -> Image:
    """Lens and pixel along the columns, which are sampled once per px: the lens and a second-order pixel."""
    pixel = np.array([1.0, 22.0, 1.0], dtype=np.float32) / 24.0
    return np.convolve(lens_taps(camera.lens_sigma_px), pixel).astype(np.float32)
