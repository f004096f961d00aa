"""The sensor: shot noise, read noise, quantisation to 8 bits, gamma and JPEG."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from axialnav.fusion.errors import ConfigError

TABLE_SIZE = 1 << 16
WHITE_DN = 255.0


@dataclass(frozen=True)
class LightLevel:
    """How much light reaches the sensor.

    Parameters
    ----------
    mean_dn
        Mean grey value of the wall [DN].
    electrons_per_dn
        Photo-electrons per grey value [e/DN]: the fewer, the stronger the shot noise.
    read_noise_e
        Read noise of a pixel, standard deviation [e].
    """

    mean_dn: float
    electrons_per_dn: float
    read_noise_e: float = 3.0

    def __post_init__(self) -> None:
        if not (self.mean_dn > 0.0 and self.electrons_per_dn > 0.0 and self.read_noise_e >= 0.0):
            raise ConfigError(
                f"light level needs mean_dn > 0, electrons_per_dn > 0 and read_noise_e >= 0, got {self}; "
                "start from BRIGHT, DIM or DARK"
            )

    def sigma_dn(self, grey_dn: float | None = None) -> float:
        """Noise standard deviation at a grey value (default: the mean), before quantisation [DN]."""
        electrons = (self.mean_dn if grey_dn is None else grey_dn) * self.electrons_per_dn
        return float(np.sqrt(electrons + self.read_noise_e**2)) / self.electrons_per_dn


BRIGHT = LightLevel(110.0, 20.0)
DIM = LightLevel(70.0, 4.0)
DARK = LightLevel(35.0, 1.0)


def expose(
    light: NDArray[np.float32], level: LightLevel, rng: np.random.Generator, gamma: float = 1.0
) -> NDArray[np.uint8]:
    """Turn relative light (1 = mean of the wall) into a noisy 8-bit picture of the same shape.

    Shot noise is Gaussian with the variance of the Poisson law, which at the 35 or more electrons of a lit wall
    differs from it by less than a grey value; samples are limited to 4.3 standard deviations.

    Parameters
    ----------
    light
        Relative light, shape (h, w).
    level
        Electrons and grey values at light 1.
    rng
        Seeds the noise.
    gamma
        Display gamma; 1 is a linear camera, 2.2 the usual video camera.
    """
    out = np.empty(light.shape, dtype=np.uint8)
    electrons = level.mean_dn * level.electrons_per_dn
    seed = np.uint64(rng.integers(1 << 63))
    _expose(light, electrons, 1.0 / level.electrons_per_dn, level.read_noise_e**2, 1.0 / gamma, seed, _normal(), out)
    return out


def jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Encode and decode a grey picture (h, w) as JPEG of the given quality (1-100)."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


@cache
def _normal() -> NDArray[np.float32]:
    """Quantiles of the normal law at equal probabilities, scaled to unit variance."""
    table = ndtri((np.arange(TABLE_SIZE) + 0.5) / TABLE_SIZE)
    return np.asarray(table / table.std(), dtype=np.float32)


@numba.njit(cache=True)
def _expose(  # type: ignore[no-untyped-def]
    light, electrons, dn_per_electron, read_variance, power, seed, table, out
):  # pragma: no cover - compiled
    """Four normal samples from each word of SplitMix64 (Steele, Lea, Flood 2014); one pass over the picture."""
    source, target = light.ravel(), out.ravel()
    state = np.uint64(seed)
    word = np.uint64(0)
    for i in range(source.size):
        if i % 4 == 0:
            state += np.uint64(0x9E3779B97F4A7C15)
            word = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            word ^= word >> np.uint64(31)
        normal = table[word & np.uint64(0xFFFF)]
        word >>= np.uint64(16)
        mean = max(source[i], np.float32(0.0)) * electrons
        value = (mean + np.sqrt(mean + read_variance) * normal) * dn_per_electron
        if power != 1.0:
            value = WHITE_DN * (max(value, 0.0) / WHITE_DN) ** power
        target[i] = np.uint8(min(max(value + 0.5, 0.0), WHITE_DN))
