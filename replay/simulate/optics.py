"""Lens and pixel: transfer functions, light fall-off, fixed pattern and distortion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError

Array = NDArray[np.float64]
TABLE_SIZE = 100_001  # of radii: exact to some 1e-8 focal lengths
MAX_RADIUS = 20.0  # [focal lengths]: 87 degrees off the axis
MAX_SHARE_OF_FOLD = 0.98


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

    Solves ``r_d = r (1 + k1 r^2 + k2 r^4)`` (Brown's radial terms, radius in focal lengths) by a table of radii.

    Raises
    ------
    ConfigError
        If the distortion folds the picture over inside of the field of view.
    """
    if not (k1 or k2):
        return u_px, v_px
    distorted = np.hypot(u_px, v_px) / focal_px
    edge = _fold(k1, k2)
    if not float(distorted.max()) < MAX_SHARE_OF_FOLD * edge * (1.0 + k1 * edge**2 + k2 * edge**4):
        raise ConfigError(
            f"the radial distortion k1 = {k1}, k2 = {k2} folds the picture over within its corners at "
            f"{distorted.max():.2f} focal lengths; use smaller coefficients or a longer focal length"
        )
    radius = np.linspace(0.0, min(edge, MAX_RADIUS), TABLE_SIZE)
    solved = np.interp(distorted, radius * (1.0 + k1 * radius**2 + k2 * radius**4), radius)
    scale = solved / np.maximum(distorted, 1e-12)
    return u_px * scale, v_px * scale


def _fold(k1: float, k2: float) -> float:
    """Radius at which the distorted radius stops to grow [focal lengths]."""
    roots = np.roots([5.0 * k2, 3.0 * k1, 1.0]) if k2 else np.array([-1.0 / (3.0 * k1)])
    real = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and root.real > 0.0]
    return float(np.sqrt(min(real))) if real else MAX_RADIUS
