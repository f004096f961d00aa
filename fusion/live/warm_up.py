"""Compile and load everything before the first real reading, so that it does not wait for a compiler."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.fusion.camera_feed import CameraFeed
from axialnav.fusion.config import Config
from axialnav.fusion.errors import AxialnavError
from axialnav.fusion.live.core import ESTIMATORS
from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    CameraFrame,
    Height,
    ImuSample,
    PixelMotion,
    Reading,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from axialnav.models.rig import (
    AnySensor,
    AttitudeSource,
    Barometer,
    BlurMeter,
    Camera,
    Flow,
    Imu,
    RangeFinder,
    Uwb,
)

STEP_NS = 10_000_000
USUAL_CAMERA_HZ = 30.0
WALLS = (  # step from frame to frame, roll of every other one [px], pattern of the pixels [grey values]
    *((0, 1, 0.0), (2, 0, 3.0), (2, 3, 3.0)),
    *((9, 0, 0.0), (9, 2, 0.0)),
)
CONTRAST = 30.0
ROUGHNESS = 0.03  # cycles a pixel, up to which the wall has all its texture


def warm_up(config: Config, kind: str) -> None:
    """Run a throw-away filter for a little longer than its first window, with one late reading of every sensor.

    Raises
    ------
    ConfigError
        The configuration describes no filter.
    """
    estimator = ESTIMATORS[kind](config)
    steps = round(config.start.window_s * 1e9 / STEP_NS) + 20
    for k in range(steps):
        for reading in _readings(config, k * STEP_NS, aids=k in (0, 1, steps - 10, steps - 1)):
            with suppress(AxialnavError):  # made-up numbers need not fit together; what has to be compiled has been
                estimator.push(reading)
    with suppress(AxialnavError):
        estimator.state(steps * STEP_NS)
    for name, spec in config.sensor.items():
        if isinstance(spec, Camera) and spec.surface is not None:
            warm_camera(config, name, spec)


def _readings(config: Config, t_ns: int, aids: bool) -> Iterator[Reading]:
    for name, spec in config.sensor.items():
        if isinstance(spec, Imu):
            x, y, z = (float(c) for c in spec.rotation_BS.T @ [0.0, 0.0, config.gravity_m_s2])
            yield ImuSample(t_ns=t_ns, sensor=name, gyro_rad_s=(0.0, 0.0, 0.0), accel_m_s2=(x, y, z))
        elif aids or isinstance(spec, AttitudeSource):
            yield from _aid(name, spec, t_ns)


def _aid(name: str, spec: AnySensor, t_ns: int) -> Iterator[Reading]:
    t_ns = max(t_ns - STEP_NS - STEP_NS // 2, 0)
    match spec:
        case AttitudeSource():
            yield Attitude(t_ns=t_ns, sensor=name, roll_rad=0.0, pitch_rad=0.0, yaw_rad=0.0)
        case RangeFinder():
            yield WallRange(t_ns=t_ns, sensor=name, range_m=1.0)
        case Flow() | Camera(surface=str()) | BlurMeter(signed=True):
            yield PixelMotion(t_ns=t_ns, sensor=name, window_s=0.02, dx_px=0.0, dy_px=0.0, sigma_px=1.0, quality=255.0)
        case BlurMeter():
            yield BlurLength(t_ns=t_ns, sensor=name, window_s=0.02, length_px=0.0, sigma_px=1.0)
        case Barometer():
            yield Height(t_ns=t_ns, sensor=name, height_m=0.0)
        case Uwb(measurement="position"):
            yield UwbFix(t_ns=t_ns, sensor=name, position_m=(0.0, 0.0, 0.0))
        case Uwb(measurement="range", anchors=anchors):
            yield from (UwbRange(t_ns=t_ns, sensor=name, anchor=anchor, range_m=1.0) for anchor in anchors)
        case Uwb(anchors=anchors) if len(anchors) > 1:
            first, second, *_ = anchors
            yield UwbTdoa(t_ns=t_ns, sensor=name, anchor_a=first, anchor_b=second, difference_m=0.0)


def warm_camera(config: Config, name: str, spec: Camera) -> None:
    """Measure the motion of a made-up wall: of pictures that are refused early, little would be compiled."""
    period_ns = round(1e9 / (spec.rate_hz or USUAL_CAMERA_HZ))
    for exposure_s, step_px, shake_px, pattern in [(None, 0, 0, 0.0), *((0.3e-9 * period_ns, *wall) for wall in WALLS)]:
        feed = CameraFeed(config)
        count = 3 * config.camera.frames  # some things are looked at once in a while only
        for k, image in enumerate(wall_pictures(spec.resolution, count, step_px, shake_px, pattern)):
            with suppress(FrameError):
                feed.push(CameraFrame(t_ns=k * period_ns, sensor=name, image=image, exposure_s=exposure_s))


def wall_pictures(
    resolution: tuple[int, int], count: int, step_px: int, shake_px: int = 0, pattern: float = 0.0
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a rough wall that passes by, shape (height, width), each with its own noise.

    Every other picture is rolled, so that its upper and lower edges move by ``shake_px`` either way.  The pixels differ
    among themselves by ``pattern`` grey values, always in the same way.
    """
    width, height = resolution
    whole = width + step_px * count + 2 * shake_px
    rng = np.random.Generator(np.random.PCG64(0))
    texture = np.fft.rfft2(rng.normal(size=(height, whole)))
    down, along = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(whole)[None, :]
    wall = np.fft.irfft2(texture / (1.0 + (down**2 + along**2) / ROUGHNESS**2), s=(height, whole))
    wall *= CONTRAST / wall.std()
    rolled = np.round(shake_px * np.linspace(-1.0, 1.0, height)).astype(np.int64)
    columns = np.arange(width)
    fixed = pattern * rng.normal(size=(height, width))
    for k in range(count):
        first = shake_px + step_px * k + (rolled if k % 2 else np.zeros_like(rolled))
        seen = np.take_along_axis(wall, first[:, None] + columns, axis=1)
        yield np.clip(128.0 + fixed + seen + rng.normal(0.0, 1.0, seen.shape), 0.0, 255.0).astype(np.uint8)
