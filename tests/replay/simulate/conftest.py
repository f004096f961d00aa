from __future__ import annotations

import numpy as np
import pytest

from axialnav.replay.simulate.render import LightLevel, Wall, photographic_wall

NOISELESS = LightLevel(mean_dn=110.0, electrons_per_dn=1e9, read_noise_e=0.0)


@pytest.fixture(scope="session")
def noiseless() -> LightLevel:
    """Light without shot or read noise: what is left is the rounding to 8 bits."""
    return NOISELESS


@pytest.fixture(scope="session")
def wall() -> Wall:
    return photographic_wall(np.random.default_rng(5), rows_px=384, cols_px=1152)


@pytest.fixture(scope="session")
def smooth_wall() -> Wall:
    """Texture far coarser than a pixel, for which finite differences are exact enough."""
    rng = np.random.default_rng(6)
    rows, cols = 512, 2048
    spectrum = np.fft.rfft2(rng.standard_normal((rows, cols)))
    fx, fy = np.fft.rfftfreq(cols, 0.5)[None, :], np.fft.fftfreq(rows)[:, None]
    image = np.fft.irfft2(spectrum * np.exp(-(fx**2 + fy**2) / (2 * 0.025**2)), s=(rows, cols))
    return Wall("smooth", np.asarray(image / image.std(), dtype=np.float32))


def sine(cycles_per_px: float, cols_px: int = 1200, rows_px: int = 64) -> Wall:
    """Vertical stripes of one frequency along the rows."""
    x = np.arange(2 * cols_px) / 2.0
    row = np.sin(2 * np.pi * cycles_per_px * x).astype(np.float32)
    return Wall(f"sine {cycles_per_px}", np.ascontiguousarray(np.broadcast_to(row, (rows_px, row.size))))


@pytest.fixture(scope="session")
def sine_wall():
    return sine
