"""Small rendered walls with known motion, shared by the tests of the image methods."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.render import (
    BRIGHT,
    DIM,
    CameraModel,
    Disturbance,
    Rendering,
    Scene,
    Trajectory,
    Wall,
    photographic_wall,
    render_frames,
)

PERIOD_S, EXPOSURE_S = 1.0 / 30.0, 0.010
WIDTH, HEIGHT = 640, 360


@cache
def wall() -> Wall:
    return photographic_wall(np.random.default_rng(5))


def rendered(
    displacement_px: float,
    seed: int,
    *,
    contrast: float = 0.05,
    bright: bool = False,
    frames: int = 5,
    occluders: tuple[str, ...] = (),
    camera: dict[str, float] | None = None,
    **trajectory: float | tuple[float, ...],
) -> Rendering:
    lens = CameraModel(width=WIDTH, height=HEIGHT, exposure_s=EXPOSURE_S, frame_period_s=PERIOD_S)
    scene = Scene(
        wall(),
        contrast,
        BRIGHT if bright else DIM,
        replace(lens, **(camera or {})),
        Trajectory(displacement_px=displacement_px, **trajectory),
        Disturbance(occluders=occluders),
    )
    return render_frames(scene, frames, np.random.default_rng(seed))


def texture(height: int, width: int, seed: int) -> NDArray[np.uint8]:
    """A picture with something to see in it, quickly made."""
    rng = np.random.default_rng(seed)
    rough = rng.normal(size=(height, width))
    smooth = np.cumsum(rough, axis=1) - np.linspace(0.0, 1.0, width)[None] * rough.sum(axis=1, keepdims=True)
    return np.clip(120.0 + 6.0 * smooth / smooth.std() + 3.0 * rough, 0, 255).astype(np.uint8)
