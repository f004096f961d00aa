"""Light on the sensor: wall, exposure integral, lens and pixel, frame by frame.

Rows are filtered as spectra: the motion during an exposure, the lens and the pixel are one transfer function, and
leaving out every second sample folds the spectrum as a sensor does, aliasing included.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.exposure import LANCZOS_LOBES, motion_transfer
from axialnav.replay.simulate.geometry import Extent, Pinhole
from axialnav.replay.simulate.kernels import filter_rows, fold_rows
from axialnav.replay.simulate.motion import Path
from axialnav.replay.simulate.optics import half_spectrum, lens_taps, lens_transfer, pixel_transfer, row_taps
from axialnav.replay.simulate.scene import Scene
from axialnav.replay.simulate.walls import OVERSAMPLING, Image

Array = NDArray[np.float64]
RING_MARGIN_PX = 8  # keeps the wrapped edges of a transformed strip out of the picture


@dataclass(frozen=True)
class Strip:
    """Rectangle of wall that serves several frames, in wall px, and the whole px taken out of their positions."""

    frames: range
    origin: tuple[int, int]
    left: int
    top: int
    cols: int
    rows: int


def light_frames(scene: Scene, path: Path, rng: np.random.Generator) -> Iterator[Image]:
    """Relative light on the sensor for every frame of a path, 1 = mean of the wall; shape (h, w) each."""
    pinhole = Pinhole(scene, path)
    extent = pinhole.extent()
    strips = _strips(scene, path, extent)
    place = (int(rng.integers(scene.wall.image.shape[0])), int(rng.integers(scene.wall.image.shape[1])))
    mean, deviation = _statistics(scene, strips, place)
    for strip in strips:
        wall = scene.wall.crop(strip.top + place[0], strip.rows, strip.left + place[1], strip.cols)
        wall -= np.float32(mean)
        wall *= np.float32(scene.contrast / deviation)
        wall += np.float32(1.0)
        wall = cv2.sepFilter2D(wall, cv2.CV_32F, np.ones(1, np.float32), lens_taps(scene.camera.lens_sigma_px))
        spectra = cv2.dft(wall, flags=cv2.DFT_ROWS)
        for frame in strip.frames:
            yield _frame(scene, path, pinhole, extent, strip, spectra, frame)


def _strips(scene: Scene, path: Path, extent: Extent) -> list[Strip]:
    """Cut the path where the picture has moved half a frame, so that no transform gets much longer than a frame."""
    middle = path.middle_px()
    limit = 0.5 * np.array([extent.right - extent.left, extent.bottom - extent.top])
    strips, first = [], 0
    for k in range(1, len(middle) + 1):
        if k == len(middle) or np.any(np.ptp(middle[first : k + 1], axis=0) > limit):
            strips.append(_strip(scene, path, extent, range(first, k)))
            first = k
    return strips


def _strip(scene: Scene, path: Path, extent: Extent, frames: range) -> Strip:
    middle = path.middle_px()[frames.start : frames.stop]
    low, high = middle.min(axis=0), middle.max(axis=0)
    x0, y0 = (round(float(c)) for c in 0.5 * (low + high))
    reach_x, reach_y = _reach(scene, path, frames)
    half_x = math.ceil(0.5 * (high[0] - low[0])) + 1 + reach_x
    half_y = math.ceil(0.5 * (high[1] - low[1])) + 1 + reach_y
    width = extent.right - extent.left + 2 * half_x
    cols = 2 * cv2.getOptimalDFTSize(-(-width // 2))
    rows = extent.bottom - extent.top + 2 * half_y
    return Strip(frames, (x0, y0), extent.left - x0 - half_x, extent.top - y0 - half_y, cols, rows)


def _reach(scene: Scene, path: Path, frames: range) -> tuple[int, int]:
    """How far outside of the picture the wall still matters: blur, lens, interpolation [px], along x and y."""
    half = 0.5 * scene.camera.exposure_ratio
    blur = np.zeros(2)
    for frame in frames:
        x, y = path.position_px(frame, np.array([-half, half]))
        blur = np.maximum(blur, np.abs([x[1] - x[0], y[1] - y[0]]))
    lens = 4.0 * scene.camera.lens_sigma_px
    return math.ceil(0.5 * blur[0] + lens) + RING_MARGIN_PX, math.ceil(0.5 * blur[1] + lens) + LANCZOS_LOBES + 2


def _statistics(scene: Scene, strips: list[Strip], place: tuple[int, int]) -> tuple[float, float]:
    """Mean and standard deviation of the wall in view, over all strips."""
    count, total, square = 0, 0.0, 0.0
    for strip in strips:
        wall = scene.wall.crop(strip.top + place[0], strip.rows, strip.left + place[1], strip.cols)
        mean, deviation = (float(c[0, 0]) for c in cv2.meanStdDev(wall))
        count += wall.size
        total += wall.size * mean
        square += wall.size * (deviation**2 + mean**2)
    mean = total / count
    return mean, math.sqrt(max(square / count - mean**2, 1e-30))


def _frame(
    scene: Scene, path: Path, pinhole: Pinhole, extent: Extent, strip: Strip, spectra: Image, frame: int
) -> Image:
    """One frame of a strip from the strip's row spectra."""
    camera = scene.camera
    frequencies = half_spectrum(OVERSAMPLING * strip.cols, 1.0 / OVERSAMPLING)
    row = round(float(path.middle_px()[frame, 1]))
    transfer = motion_transfer(path, frame, camera.exposure_ratio, frequencies, (strip.origin[0], row))
    if pinhole.square or pinhole.density == 1:
        transfer = transfer * lens_transfer(frequencies, camera.lens_sigma_px) * pixel_transfer(frequencies)
    first = extent.top - row - strip.top - transfer.shape[0] // 2
    filtered = np.empty((extent.bottom - extent.top, spectra.shape[1]), dtype=np.float32)
    real, imag = np.float32(transfer.real), np.float32(transfer.imag)
    filter_rows(spectra[first : first + len(filtered) + len(transfer) - 1], real, imag, filtered)
    left = strip.left + strip.origin[0]
    if pinhole.square:
        return _decimated(filtered)[:, -left : camera.width - left]
    picture = pinhole.look(_inverse(filtered), left, extent.top, frame)
    if pinhole.density == 1:
        return picture
    taps = row_taps(camera.lens_sigma_px, OVERSAMPLING)
    return np.ascontiguousarray(cv2.sepFilter2D(picture, cv2.CV_32F, taps, np.ones(1, np.float32))[:, ::OVERSAMPLING])


def _decimated(full: Image) -> Image:
    folded = np.empty((full.shape[0], full.shape[1] // OVERSAMPLING), dtype=np.float32)
    fold_rows(full, folded)
    return _inverse(folded)


def _inverse(packed: Image) -> Image:
    return np.asarray(cv2.dft(packed, flags=cv2.DFT_ROWS | cv2.DFT_INVERSE | cv2.DFT_SCALE), dtype=np.float32)
