"""The Cramer-Rao bound of the displacement for a rendered condition."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.render import CameraModel, LightLevel, Scene, render_frames
from tests.bench.motion_scenes import wall

Array = NDArray[np.float64]
PROBE = LightLevel(110.0, 1e6, 0.0)
PROBE_CONTRAST = 0.3
QUANTISATION = 1.0 / 12.0


@cache
def wall_spectrum(number: int, width: int, height: int) -> Array:
    """Power spectral density of a wall as the camera sees it at rest, for contrast 1 and mean 1, shape (h, w).

    From an almost noise-free picture, windowed, with neighbouring bins averaged.
    """
    scene = Scene(wall(number), PROBE_CONTRAST, PROBE, CameraModel(width=width, height=height))
    picture = render_frames(scene, 1, np.random.default_rng(number)).frames[0].astype(np.float64)
    window = np.outer(np.hanning(height), np.hanning(width))
    power = np.abs(np.fft.fft2((picture - picture.mean()) * window)) ** 2 / np.sum(window**2)
    smooth = cv2.blur(np.fft.fftshift(power), (7, 7))
    density = np.maximum(np.fft.ifftshift(smooth) - QUANTISATION, 0.0)
    return np.asarray(density / (PROBE_CONTRAST * PROBE.mean_dn) ** 2)


def displacement_bound(scene: Scene, number: int, frames: int) -> float:
    """Smallest standard deviation of the displacement per frame [px].

    ``J = sum over 2-D bins with fx > 0 of 2 w^2 N^2 (N^2 - 1) / 12 snr^2 / (1 + N snr)`` for Gaussian texture of known
    spectrum and no loss at the borders.
    """
    width, height = scene.camera.width, scene.camera.height
    frequency = np.fft.fftfreq(width)
    blur = np.sinc(frequency * scene.trajectory.displacement_px * scene.camera.exposure_ratio) ** 2
    texture = wall_spectrum(number, width, height) * (scene.contrast * scene.light.mean_dn) ** 2 * blur[None]
    snr = texture / (scene.light.sigma_dn() ** 2 + QUANTISATION)
    positive = (frequency > 0.0)[None]
    omega2 = (2.0 * np.pi * frequency[None]) ** 2
    terms = 2.0 * omega2 * frames**2 * (frames**2 - 1) / 12.0 * snr**2 / (1.0 + frames * snr)
    return float(1.0 / np.sqrt(np.sum(terms * positive)))
