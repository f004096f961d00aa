"""Rendered conditions of the image-motion benches: walls, light, motion and everything that goes wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from axialnav.replay.simulate.render import (
    BRIGHT,
    DIM,
    CameraModel,
    Rendering,
    Scene,
    Trajectory,
    Wall,
    brick_wall,
    dropped_frame,
    duplicated_frame,
    photographic_wall,
    render_frames,
)

WALLS = 6
PERIOD_S = 1.0 / 30.0
EXPOSURE_S = 0.010
SMALLEST_PX, LARGEST_PX = 0.5, 45.0
Change = Callable[[Scene, np.random.Generator], Scene]


@dataclass(frozen=True)
class Condition:
    """One row of a table.

    ``contrast`` and ``bright`` set texture and light; ``change`` disturbs the scene; ``moving`` says whether an
    accepted estimate can be right at all.
    """

    name: str
    contrast: float
    bright: bool = False
    change: Change | None = None
    moving: bool = True


@cache
def wall(number: int) -> Wall:
    """One of a few photographic walls."""
    return photographic_wall(np.random.default_rng(1000 + number))


@cache
def bricks(periodic: bool) -> Wall:
    """A brick wall, truly periodic or natural."""
    rng = np.random.default_rng(77)
    return brick_wall(rng, tone=0.0, roughness=0.0) if periodic else brick_wall(rng)


def signed_log_uniform(rng: np.random.Generator, low: float = SMALLEST_PX, high: float = LARGEST_PX) -> float:
    """Displacement, log-uniform in size, either sign [px per frame]."""
    size = math.exp(rng.uniform(math.log(low), math.log(high)))
    return size if rng.random() < 0.5 else -size


def draw(condition: Condition, trial: int, frames: int = 5, width: int = 960, height: int = 540) -> Rendering:
    """Render one trial of a condition; equal numbers give equal frames."""
    rng = np.random.default_rng([trial, *condition.name.encode()])
    camera = CameraModel(width=width, height=height, exposure_s=EXPOSURE_S, frame_period_s=PERIOD_S)
    scene = Scene(
        wall(trial % WALLS),
        condition.contrast,
        BRIGHT if condition.bright else DIM,
        camera,
        Trajectory(displacement_px=signed_log_uniform(rng)),
    )
    if condition.change is not None:
        scene = condition.change(scene, rng)
    return render_frames(scene, frames, rng)


def motion(**changes: float | tuple[float, ...]) -> Change:
    """Disturb the trajectory."""
    return lambda scene, rng: replace(scene, trajectory=replace(scene.trajectory, **changes))


def camera(**changes: float | int) -> Change:
    """Disturb the camera."""
    return lambda scene, rng: replace(scene, camera=replace(scene.camera, **changes))


def light(**changes: float | tuple[str, ...]) -> Change:
    """Disturb the light."""
    return lambda scene, rng: replace(scene, disturbance=replace(scene.disturbance, **changes))


def _random_sign(name: str, value: float) -> Change:
    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        sign = 1.0 if rng.random() < 0.5 else -1.0
        return replace(scene, trajectory=replace(scene.trajectory, **{name: sign * value}))

    return change


def _frame_fault(fault: Callable[[int, int], tuple[float, ...]], frames: int) -> Change:
    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        times = fault(frames, int(rng.integers(0, frames - 1)))
        return replace(scene, trajectory=replace(scene.trajectory, frame_times=times))

    return change


def _bricks(periodic: bool) -> Change:
    return lambda scene, rng: replace(scene, wall=bricks(periodic))


def _without_texture(**pattern: float) -> Change:
    return lambda scene, rng: replace(scene, contrast=0.0, camera=replace(scene.camera, **pattern))


def _overexposed(scene: Scene, rng: np.random.Generator) -> Scene:
    return replace(scene, light=replace(scene.light, mean_dn=float(rng.uniform(230.0, 300.0))))


CLEAN = (
    Condition("10 % bright", 0.10, True),
    Condition("5 % dim", 0.05),
    Condition("2 % dim", 0.02),
)
FAINT = Condition("texture / noise = 0.1", 0.006)
BASE = CLEAN[1]
DISTURBED = (
    Condition("acceleration 1 px/frame^2", 0.05, change=_random_sign("acceleration_px", 1.0)),
    Condition("roll jitter 0.3 deg", 0.05, change=motion(roll_jitter_rad=math.radians(0.3))),
    Condition("steady roll 0.1 deg/frame", 0.05, change=_random_sign("roll_rate_rad", math.radians(0.1))),
    Condition("flicker 20 %", 0.05, change=light(flicker_depth=0.2, flicker_hz=97.0)),
    Condition("drift 2 px/frame", 0.05, change=_random_sign("drift_px", 2.0)),
    Condition("fixed pattern 1 %", 0.05, change=camera(pixel_pattern=0.01, column_pattern=0.01)),
    Condition("JPEG q80", 0.05, change=camera(jpeg_quality=80)),
    Condition("rolling shutter 0.5 T", 0.05, change=camera(readout_s=0.5 * PERIOD_S)),
    Condition("vignette 0.4", 0.05, change=camera(vignette=0.4)),
)
OCCLUDED = tuple(
    Condition(f"static {name}", 0.05, change=light(occluders=(name,))) for name in ("gear", "corner", "cable", "bar")
)
FAULTS = (
    Condition("dropped frame", 0.05, change=_frame_fault(dropped_frame, 5)),
    Condition("dropped frame, bright", 0.10, True, change=_frame_fault(dropped_frame, 5)),
    Condition("duplicated frame", 0.05, change=_frame_fault(duplicated_frame, 5)),
    Condition("noise only", 0.0, change=_without_texture(), moving=False),
    Condition("noise and fixed pattern", 0.0, change=_without_texture(pixel_pattern=0.01), moving=False),
    Condition("bricks", 0.05, change=_bricks(False)),
    Condition("periodic bricks", 0.05, change=_bricks(True)),
    Condition("saturation", 0.05, change=_overexposed),
    Condition("defocus", 0.05, change=camera(lens_sigma_px=4.0)),
    Condition("jitter 0.3 px", 0.05, change=motion(jitter_px=0.3)),
    Condition(
        "lamp spot, 0.5 % pattern", 0.02, change=lambda s, r: camera(pixel_pattern=0.005)(light(lamp_spot=0.5)(s, r), r)
    ),
)
EVERYTHING = (*CLEAN, FAINT, *DISTURBED, *OCCLUDED, *FAULTS)
