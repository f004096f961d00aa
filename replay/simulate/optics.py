"""Lens and pixel: transfer functions, light fall-off, fixed pattern and distortion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError

Array = NDArray[np.float64]
NEWTON_STEPS = 20
MAX_MISS = 1e-9  # of the solved radius [focal lengths]


def half_spectrum(samples: int, pitch_px: float) -> Array:
    """Frequencies of a real transform of values ``pitch_px`` apart [cycles/px], shape (samples // 2 + 1,)."""
    return np.arange(samples // 2 + 1) / (samples * pitch_px)


def lens_transfer(frequencies: Array, sigma_px: float) -> Array:
    """Modulation transfer of a Gaussian lens blur, ``exp(-2 (pi sigma f)^2)``; frequencies in cycles/px."""
    return np.asarray(np.exp(-2.0 * (np.pi * sigma_px * frequencies) ** 2))


def pixel_transfer(frequencies: Array) -> Array:
    """Transfer of a square pixel with full fill, ``sinc(f)``; frequencies in cycles/px."""
    return np.asarray(np.sinc(frequencies))


def lens_taps(sigma_px: float) -> NDArray[np.float32]:
    """Gaussian taps for the columns, where the wall is already averaged over the pixel; shape (2 r + 1,)."""
    reach = max(1, int(np.ceil(4.0 * sigma_px)))
    offset = np.arange(-reach, reach + 1)
    taps = np.exp(-0.5 * (offset / max(sigma_px, 1e-3)) ** 2)
    return np.asarray(taps / taps.sum(), dtype=np.float32)


def row_taps(sigma_px: float, oversampling: int) -> NDArray[np.float32]:
    """Lens and pixel as taps for rows sampled ``oversampling`` times per px, shape (2 r + 1,)."""
    reach = int(np.ceil(oversampling * (4.0 * sigma_px + 2.0)))
    length = 8 * reach
    frequencies = half_spectrum(length, 1.0 / oversampling)
    taps = np.fft.irfft(lens_transfer(frequencies, sigma_px) * pixel_transfer(frequencies), length)
    taps = np.roll(taps, reach)[: 2 * reach + 1]
    return np.asarray(taps / taps.sum(), dtype=np.float32)


def light_falloff(height: int, width: int, vignette: float, spot: float) -> NDArray[np.float32]:
    """Light that reaches each pixel, mean 1, shape (height, width).

    Parameters
    ----------
    height, width
        Size of the picture [px].
    vignette
        Share of the light lost in the corners, growing with the square of the radius [-].
    spot
        Brightness of a round lamp spot fixed to the camera, over the rest at its centre [-].
    """
    v = (np.arange(height) - 0.5 * (height - 1))[:, None]
    u = (np.arange(width) - 0.5 * (width - 1))[None, :]
    radius2 = (u**2 + v**2) / (0.25 * (width**2 + height**2))
    gain = (1.0 - vignette * radius2) * (1.0 + spot * np.exp(-4.0 * radius2))
    return np.asarray(gain / gain.mean(), dtype=np.float32)


def fixed_pattern(
    height: int, width: int, pixel: float, column: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Gain of every pixel: errors of pixels and columns with the given relative deviations; shape (height, width)."""
    pattern = np.ones((height, width), dtype=np.float32)
    pattern += np.float32(column) * rng.standard_normal(width, dtype=np.float32)
    pattern += np.float32(pixel) * rng.standard_normal((height, width), dtype=np.float32)
    return pattern


def undistorted(u_px: Array, v_px: Array, focal_px: float, k1: float, k2: float) -> tuple[Array, Array]:
    """Pinhole coordinates of distorted pixels, both relative to the principal point [px].

    Solves ``r_d = r (1 + k1 r^2 + k2 r^4)`` (Brown's radial terms, radius in focal lengths) by Newton steps.

    Raises
    ------
    ConfigError
        If the distortion folds the picture over inside of the field of view.
    """
    if not (k1 or k2):
        return u_px, v_px
    distorted = np.hypot(u_px, v_px) / focal_px
    radius = distorted.copy()
    for _ in range(NEWTON_STEPS):
        square = radius**2
        slope = 1.0 + 3.0 * k1 * square + 5.0 * k2 * square**2
        radius -= (radius * (1.0 + k1 * square + k2 * square**2) - distorted) / np.maximum(slope, 0.05)
    square = radius**2
    miss = float(np.abs(radius * (1.0 + k1 * square + k2 * square**2) - distorted).max())
    if not (miss < MAX_MISS and float((1.0 + 3.0 * k1 * square + 5.0 * k2 * square**2).min()) > 0.0):
        raise ConfigError(
            f"the radial distortion k1 = {k1}, k2 = {k2} folds the picture over within its corners at "
            f"{distorted.max():.2f} focal lengths; use smaller coefficients or a longer focal length"
        )
    scale = radius / np.maximum(distorted, 1e-12)
    return u_px * scale, v_px * scale
