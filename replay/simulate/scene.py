"""What is rendered: camera, light, wall, motion and everything that disturbs the picture."""

from __future__ import annotations

from dataclasses import dataclass, field

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.motion import Trajectory
from axialnav.replay.simulate.noise import DIM, LightLevel
from axialnav.replay.simulate.walls import Wall


@dataclass(frozen=True)
class CameraModel:
    """A grey camera with a global or rolling shutter.

    Parameters
    ----------
    width, height
        Size of the picture [px].
    focal_px
        Focal length [px]; matters for yaw and distortion.
    frame_period_s, exposure_s, readout_s
        Frame period, exposure and the time from the first to the last row [s].
    lens_sigma_px
        Gaussian blur of the lens, standard deviation [px].
    vignette
        Share of the light lost in the corners [-].
    pixel_pattern, column_pattern
        Fixed gain errors, relative standard deviations [-].
    k1, k2
        Brown's radial distortion [-].
    gamma
        Display gamma of the pictures [-].
    jpeg_quality
        1-100, or None for pictures that are not compressed.
    """

    width: int = 960
    height: int = 540
    focal_px: float = 301.0
    frame_period_s: float = 1.0 / 30.0
    exposure_s: float = 0.010
    readout_s: float = 0.0
    lens_sigma_px: float = 0.6
    vignette: float = 0.0
    pixel_pattern: float = 0.0
    column_pattern: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    gamma: float = 1.0
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        if self.width < MIN_SIDE_PX or self.height < MIN_SIDE_PX or self.width % 2:
            raise ConfigError(
                f"a rendered picture needs an even width and sides of at least {MIN_SIDE_PX} px, "
                f"got {self.width} x {self.height}"
            )
        if not 0.0 < self.exposure_s <= self.frame_period_s:
            raise ConfigError(
                f"exposure_s must be positive and at most the frame period of {self.frame_period_s:.4g} s, "
                f"got {self.exposure_s:.4g}"
            )
        if not (self.focal_px > 0.0 and self.lens_sigma_px >= 0.0 and 0.0 <= self.readout_s <= self.frame_period_s):
            raise ConfigError(
                f"focal_px must be positive, lens_sigma_px not negative and readout_s within one frame period, got "
                f"{self.focal_px}, {self.lens_sigma_px} and {self.readout_s}"
            )

    @property
    def exposure_ratio(self) -> float:
        """Exposure in frame periods, the paper's ``r`` (its equation 2) [-]."""
        return self.exposure_s / self.frame_period_s

    @property
    def readout_ratio(self) -> float:
        """Readout time in frame periods [-]."""
        return self.readout_s / self.frame_period_s


MIN_SIDE_PX = 16


@dataclass(frozen=True)
class Disturbance:
    """What else happens to the light.

    Parameters
    ----------
    flicker_depth, flicker_hz
        Relative amplitude [-] and frequency [Hz] of the lamp.
    gain_jitter
        Random brightness of every frame, relative standard deviation [-].
    lamp_spot
        Brightness of a lamp spot fixed to the camera [-].
    occluders
        Names of ``occluders.NAMES``.
    """

    flicker_depth: float = 0.0
    flicker_hz: float = 100.0
    gain_jitter: float = 0.0
    lamp_spot: float = 0.0
    occluders: tuple[str, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Everything ``render_frames`` needs beside the random numbers.

    Parameters
    ----------
    wall
        The wall.
    contrast
        Standard deviation over mean of the wall in view, before lens and blur [-]; 0 renders noise alone.
    light
        Light level.
    camera, trajectory, disturbance
        The camera, its motion and what disturbs it.
    """

    wall: Wall
    contrast: float = 0.05
    light: LightLevel = DIM
    camera: CameraModel = field(default_factory=CameraModel)
    trajectory: Trajectory = field(default_factory=Trajectory)
    disturbance: Disturbance = field(default_factory=Disturbance)

    def __post_init__(self) -> None:
        if not 0.0 <= self.contrast < 1.0:
            raise ConfigError(f"contrast must be in [0, 1), got {self.contrast}")
