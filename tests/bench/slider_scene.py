"""What the slider's frames show apart from its motor's record: a poster that is not flat, a carriage with a ripple.

OpenCV's Lucas-Kanade follows 72 points of a grid.  What it says is split into what belongs to a place in the picture
(the lens), to a place on the wall (nearer and farther pieces, each in view for some fifty frames) and to a moment (the
carriage): ``d = mean + lens(row, column) + wall(row, column + way) + carriage(time)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
ROWS, COLUMNS = 6, 12
PLACE_PX = 10.0  # width of a piece of wall
LK_WINDOW, EDGE_PX = (21, 31), 20
OUTLIER_PX, LEAST_TEXTURE = 0.25, 20.0
PASSES = 40
HARMONICS, TURN_FRAMES = 4, np.arange(6.0, 12.0, 0.02)
SLOPE = np.array([0.2, 0.3, 0.3, 0.2])  # steps between five frames, as the line through their positions weighs them


@dataclass(frozen=True)
class PointMotion:
    """Motion of the grid's points between frames k and k + lag, stamped in the middle.

    Parameters
    ----------
    lag
        Frames between the two.
    along, across
        Displacement per frame along and across the rows [px], shape (k, rows, columns).
    weight
        Texture around the point, 0 where it was not found, shape like ``along``.
    """

    lag: int
    along: Array
    across: Array
    weight: Array


@dataclass(frozen=True)
class Scene:
    """What moves how fast [px per frame]: mean, lens (rows, columns), wall (rows, places) and carriage (k,)."""

    mean: float
    lens: Array
    wall: Array
    carriage: Array


def point_motion(frames: Sequence[Picture], lag: int, speed_px: float) -> PointMotion:
    """Follow a grid of points over ``lag`` frames that move by about ``speed_px`` each."""
    height, width = frames[0].shape
    u, v = _middles(width, COLUMNS), _middles(height, ROWS)
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    half = np.array([0.5 * lag * speed_px, 0.0])
    start, guess = (grid - half).astype(np.float32), (grid + half).astype(np.float32)
    motion, weight = [], []
    for first, second in zip(frames[:-lag], frames[lag:], strict=True):
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            first, second, start, guess.copy(), winSize=LK_WINDOW, maxLevel=1,
            criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 1e-3), flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )  # fmt: skip
        slope = cv2.Sobel(first, cv2.CV_32F, 1, 0, scale=0.125)
        texture = cv2.boxFilter(slope * slope, -1, LK_WINDOW)[np.ix_(v.astype(int), u.astype(int))]
        motion.append((found - start).reshape(ROWS, COLUMNS, 2) / lag)
        weight.append(texture * (texture > LEAST_TEXTURE) * status.reshape(ROWS, COLUMNS))
    both = np.array(motion, dtype=np.float64)
    return PointMotion(lag, both[..., 0], both[..., 1], np.array(weight, dtype=np.float64))


def _middles(size: int, count: int) -> Array:
    return (np.arange(count) + 0.5) * size / count - 0.5


def fit_scene(points: PointMotion, width: int, leave_out: int | None = None, frames: int = 5) -> Scene:
    """Split the motion of the points, by weighted means in turn; pairs that share a frame with a window are left out.

    Parameters
    ----------
    points
        Motion of the grid.
    width
        Of the picture [px].
    leave_out, frames
        First frame and length of the window whose frames are not to be used; None: all are.
    """
    weight, along = points.weight.copy(), points.along
    if leave_out is not None:
        weight[max(leave_out - points.lag, 0) : leave_out + frames] = 0.0
    middle = float(np.median(along[weight > 0]))
    moment = np.arange(len(along), dtype=np.float64) + 0.5 * points.lag
    place = ((_middles(width, COLUMNS) - middle * moment[:, None]) / PLACE_PX).astype(np.intp)
    row = np.broadcast_to(np.arange(ROWS)[None, :, None], along.shape)
    index = row * (int(place.max()) + 1) + place[:, None, :]
    lens, wall, carriage = np.zeros((ROWS, COLUMNS)), np.zeros(int(index.max()) + 1), np.zeros(len(along))
    weight = weight * (np.abs(along - middle) < 0.5)
    for k in range(PASSES):
        rest = along - middle - lens - wall[index] - carriage[:, None, None]
        if k == PASSES // 2:
            weight = weight * (np.abs(rest) < OUTLIER_PX)
        lens = lens + _mean(rest, weight, 0)
        rest = along - middle - lens - carriage[:, None, None]
        total = np.asarray(np.bincount(index.ravel(), weight.ravel(), len(wall)), dtype=np.float64)
        wall = np.bincount(index.ravel(), (weight * rest).ravel(), len(wall)) / np.maximum(total, 1e-9)
        rest = along - middle - lens - wall[index]
        carriage = _mean(rest.reshape(len(along), -1), weight.reshape(len(along), -1), 1)
        carriage -= carriage[weight.any(axis=(1, 2))].mean()
    return Scene(middle, _filled(lens, weight.sum(axis=0)), _filled(wall.reshape(ROWS, -1), total), carriage)


def _mean(values: Array, weight: Array, axis: int) -> Array:
    return np.asarray((values * weight).sum(axis=axis) / np.maximum(weight.sum(axis=axis), 1e-9))


def _filled(values: Array, weight: Array) -> Array:
    """Each row with what is missing taken from its neighbours."""
    known = weight.reshape(values.shape) > 0
    at = np.arange(values.shape[1])
    return np.stack([np.interp(at, at[k], line[k]) if k.any() else line for line, k in zip(values, known, strict=True)])


def motion_field(scene: Scene, shape: tuple[int, int], frame: float) -> Array:
    """Displacement per frame along the rows of every pixel at a frame, without the carriage's part [px], (h, w)."""
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float64)
    row = (v + 0.5) * ROWS / shape[0] - 0.5
    column = (u + 0.5) * COLUMNS / shape[1] - 0.5
    place = (u - scene.mean * frame) / PLACE_PX - 0.5
    wall = ndimage.map_coordinates(scene.wall, [row, place], order=1, mode="nearest")
    return np.asarray(scene.mean + wall + ndimage.map_coordinates(scene.lens, [row, column], order=1, mode="nearest"))


def twin(window: Sequence[Picture], field: Array, across: float, rng: np.random.Generator) -> list[Picture]:
    """The same wall in as many frames that move exactly as ``field`` says: sharpened from all, noise as in them."""
    v, u = np.mgrid[0 : field.shape[0], 0 : field.shape[1]].astype(np.float64)
    steps = np.arange(len(window)) - len(window) // 2
    aligned = [_sampled(f, v + s * across, u + s * field) for f, s in zip(window, steps, strict=True)]
    wall = np.mean(aligned, axis=0)
    inside = (slice(EDGE_PX, -EDGE_PX),) * 2
    noise = float(np.std(np.stack(aligned)[:, *inside] - wall[inside], ddof=0)) * np.sqrt(
        len(window) / (len(window) - 1)
    )
    out = []
    for step in steps:
        source = u.copy()
        for _ in range(3):
            source = u - step * ndimage.map_coordinates(field, [v, source], order=1, mode="nearest")
        frame = _sampled(wall, v - step * across, source) + rng.normal(0.0, noise, field.shape)
        out.append(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
    return out


def _sampled(picture: Picture | Array, row: Array, column: Array) -> Array:
    return np.asarray(ndimage.map_coordinates(picture.astype(np.float64), [row, column], order=5, mode="nearest"))


def ripple(carriage: Array) -> tuple[float, Array]:
    """Period [frames] of what repeats itself in the carriage's motion, and what other turns say about each frame."""
    frame = np.arange(len(carriage), dtype=np.float64)
    period = min(TURN_FRAMES, key=lambda p: _left(_waves(frame, p), carriage, np.ones(len(frame), dtype=np.bool_)))
    waves, turn, told = _waves(frame, period), (frame // period).astype(int), np.empty(len(frame))
    for one in np.unique(turn):
        told[turn == one] = waves[turn == one] @ np.linalg.lstsq(waves[turn != one], carriage[turn != one])[0]
    return float(period), told


def _waves(frame: Array, period: float) -> Array:
    angle = 2.0 * np.pi * np.outer(frame, np.arange(1, HARMONICS + 1)) / period
    return np.hstack([np.cos(angle), np.sin(angle)])


def _left(waves: Array, values: Array, use: NDArray[np.bool_]) -> float:
    found = np.linalg.lstsq(waves[use], values[use])[0]
    return float(np.sum((values[use] - waves[use] @ found) ** 2))
