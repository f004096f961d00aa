"""What is mounted on the vehicle and where: one frozen description per sensor, and the surfaces they look at.

Sensor frame S is x right, y down, z along the optical axis or the beam; ``T_BS`` takes sensor coordinates to body
coordinates.  The same structures are read from a flight's ``sensor.yaml`` and from the ``[sensor.NAME]`` tables of a
configuration.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

Vector3 = tuple[float, float, float]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Transform = Annotated[tuple[float, ...], msgspec.Meta(min_length=16, max_length=16)]
IDENTITY: Transform = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
ROTATION_TOLERANCE = 1e-3
MAX_FACES = 64


class Sensor(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"):
    """Base of every sensor description; ``T_BS`` is row-major 4x4, lengths in metres."""

    T_BS: Transform = IDENTITY
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        if self.rate_hz is not None and not 0.0 < self.rate_hz < math.inf:
            raise ValueError(f"rate_hz must be positive and finite, got {self.rate_hz:g}; correct it or leave it out")
        matrix = np.array(self.T_BS, dtype=np.float64).reshape(4, 4)
        strange = np.flatnonzero(~np.isfinite(matrix.ravel()))
        if strange.size:
            raise ValueError(f"T_BS.{strange[0]} must be a finite number; correct it or leave it out")
        rotation = matrix[:3, :3]
        error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if not (error < ROTATION_TOLERANCE and np.linalg.det(rotation) > 0.0):
            raise ValueError(
                f"T_BS must hold a right-handed rotation, but R R^T differs from the identity by {error:.3g} "
                f"(limit {ROTATION_TOLERANCE}) and det R is {np.linalg.det(rotation):.3g}; check rows and signs"
            )

    @property
    def rotation_BS(self) -> NDArray[np.float64]:
        """Rotation from sensor to body axes, shape (3, 3)."""
        return np.array(self.T_BS, dtype=np.float64).reshape(4, 4)[:3, :3].copy()

    @property
    def lever_arm_m(self) -> NDArray[np.float64]:
        """Origin of the sensor in body axes [m], shape (3,)."""
        return np.array(self.T_BS, dtype=np.float64).reshape(4, 4)[:3, 3].copy()


class Imu(Sensor, frozen=True, kw_only=True, tag="imu"):
    """Inertial unit; root spectral densities in the EuRoC convention."""

    gyro_noise_density: Positive = 1.7e-3  # rad s^-1 Hz^-1/2
    gyro_bias_walk: Positive = 2.0e-5  # rad s^-2 Hz^-1/2
    accel_noise_density: Positive = 2.0e-2  # m s^-2 Hz^-1/2
    accel_bias_walk: Positive = 3.0e-3  # m s^-3 Hz^-1/2


class Camera(Sensor, frozen=True, kw_only=True, tag="camera"):
    """Frame camera that looks at a wall."""

    resolution: tuple[int, int]
    intrinsics: tuple[float, float, float, float]  # fu, fv, cu, cv [px]
    distortion_model: str = "none"
    distortion_coefficients: tuple[float, ...] = ()
    exposure_s: float | None = None
    readout_s: float | None = None
    surface: str | None = None

    @property
    def focal_px(self) -> tuple[float, float]:
        """Focal lengths along the image axes [px]."""
        return self.intrinsics[0], self.intrinsics[1]


class BlurMeter(Sensor, frozen=True, kw_only=True, tag="blur"):
    """Blur lengths or displacements measured elsewhere from frames."""

    focal_px: tuple[Positive, Positive]
    surface: str
    law: Literal["exposure", "composite"]
    frame_period_s: float | None = None
    exposure_s: float | None = None
    frames: int | None = None
    signed: bool = False


class Flow(Sensor, frozen=True, kw_only=True, tag="flow"):
    """Optical-flow chip: signed two-axis displacement of the image content."""

    focal_px: tuple[Positive, Positive]
    surface: str
    sigma_px: Positive | None = None


class RangeFinder(Sensor, frozen=True, kw_only=True, tag="range"):
    """Single-beam range finder (TOF)."""

    surface: str
    range_min_m: NonNegative = 0.0
    range_max_m: Positive = 100.0
    sigma_m: Positive | None = None


class Uwb(Sensor, frozen=True, kw_only=True, tag="uwb"):
    """Ultra-wideband tag: ranges, range differences or position fixes; ``T_BS`` places the antenna."""

    measurement: Literal["range", "tdoa", "position"]
    anchors: dict[str, Vector3] = {}
    sigma_m: Positive | None = None


class Barometer(Sensor, frozen=True, kw_only=True, tag="height"):
    """Height above an unknown datum."""

    sigma_m: Positive | None = None


class AttitudeSource(Sensor, frozen=True, kw_only=True, tag="attitude"):
    """The autopilot's own attitude (FRD to NED, aerospace order)."""

    sigma_rad: Positive | None = None


class Gps(Sensor, frozen=True, kw_only=True, tag="gps"):
    """A reference to score against where there is no ground truth; never fused."""


AnySensor = Imu | Camera | BlurMeter | Flow | RangeFinder | Uwb | Barometer | AttitudeSource | Gps


class Face(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One plane of a surface that has several: ``normal . p = offset_m`` between ``start`` and ``end``.

    It reaches along the line between the two points and without limit across it.  ``roughness_m`` is how far the real
    surface (steps, ribs) lies off the plane, as a standard deviation.
    """

    normal: Vector3
    offset_m: float
    start: Vector3
    end: Vector3
    roughness_m: NonNegative = 0.0

    def __post_init__(self) -> None:
        _require_unit(self.normal)
        if not math.dist(self.start, self.end) > 1e-6:
            raise ValueError(f"a face must reach from start to another point end, got {self.start} for both")


class Surface(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Plane ``normal . p = offset_m``; the unit normal points from the surface into free space.

    ``offset_m = "unknown"`` makes the filter estimate it (one such surface at a time).  A surface with ``face`` entries
    is made of those planes instead, and a sensor sees the one that its ray meets first.
    """

    normal: Vector3
    offset_m: float | Literal["unknown"] = 0.0
    face: tuple[Face, ...] = ()

    def __post_init__(self) -> None:
        _require_unit(self.normal)
        if self.face and self.offset_m == "unknown":
            raise ValueError("a surface of several faces cannot have an unknown offset; give each face its own")
        if len(self.face) > MAX_FACES:
            raise ValueError(f"a surface may have {MAX_FACES} faces, got {len(self.face)}; name the nearest ones")


def _require_unit(normal: Vector3) -> None:
    length = math.sqrt(sum(c * c for c in normal))
    if not abs(length - 1.0) < 1e-3:
        raise ValueError(f"surface normal must have length 1 (tolerance 0.001), got {length:.4g} from {normal}")
