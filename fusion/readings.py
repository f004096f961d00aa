"""Typed readings: the one door into the estimators.

Every reading is frozen, carries ``t_ns`` (integer nanoseconds of the vehicle's one monotonic clock) and the sensor's
name, and refuses nonsense at construction with :class:`~axialnav.fusion.errors.ReadingError`.  Readings that average
over a window are stamped at the middle of that window, not at arrival.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ReadingError

Vector3 = tuple[float, float, float]
MAX_RATE_RAD_S = 200.0
MAX_ACCEL_M_S2 = 2000.0
MAX_LENGTH_M = 1e5


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """Base of all readings: when [ns] and from which sensor."""

    t_ns: int
    sensor: str

    def _require(self, good: bool, field: str, value: object, limit: str) -> None:
        if not good:
            kind = type(self).__name__
            raise ReadingError(
                f"{kind}.{field} must be {limit}, got {value!r} from {self.sensor} at t_ns={self.t_ns}; "
                f"drop the reading instead of sending it"
            )

    def _stamp(self) -> None:
        good = isinstance(self.t_ns, int) and not isinstance(self.t_ns, bool) and abs(self.t_ns) < 2**62
        self._require(good, "t_ns", self.t_ns, "an integer number of nanoseconds below 2**62")

    def _finite(self, field: str, value: float, low: float, high: float) -> None:
        self._require(low <= value <= high, field, value, f"finite and within {low:g}..{high:g}")


def _vector(reading: Reading, field: str, value: Vector3, limit: float) -> None:
    good = len(value) == 3 and all(abs(c) <= limit for c in value)
    reading._require(good, field, value, f"three finite numbers within +-{limit:g}")


def _sigma(reading: Reading, field: str, value: float | None) -> None:
    reading._require(value is None or 0.0 < value < math.inf, field, value, "positive and finite, or None")


class ImuSample(Reading, frozen=True, kw_only=True):
    """Angular rate and specific force in IMU axes; over a step the filter takes the mean of its two ends."""

    gyro_rad_s: Vector3
    accel_m_s2: Vector3

    def __post_init__(self) -> None:
        self._stamp()
        _vector(self, "gyro_rad_s", self.gyro_rad_s, MAX_RATE_RAD_S)
        _vector(self, "accel_m_s2", self.accel_m_s2, MAX_ACCEL_M_S2)


class PixelMotion(Reading, frozen=True, kw_only=True):
    """Signed displacement of the image content over a window, stamped at the window's middle.

    ``dy_px`` is None for one-axis estimates; ``sigma_px`` None means the sensor's configured value; ``quality`` is the
    chip's own figure, 0 meaning unusable; ``sigma_dy_px`` None means that ``sigma_px`` is that of both axes.
    ``coherence_px`` is how far apart parts of a camera's picture may have moved and still have been taken for one.
    """

    window_s: float
    dx_px: float
    dy_px: float | None = None
    sigma_px: float | None = None
    quality: float | None = None
    sigma_dy_px: float | None = None
    coherence_px: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        self._finite("window_s", self.window_s, 1e-6, 10.0)
        self._finite("dx_px", self.dx_px, -1e5, 1e5)
        if self.dy_px is not None:
            self._finite("dy_px", self.dy_px, -1e5, 1e5)
        _sigma(self, "sigma_px", self.sigma_px)
        _sigma(self, "sigma_dy_px", self.sigma_dy_px)
        _sigma(self, "coherence_px", self.coherence_px)


class CameraFrame(Reading, frozen=True, kw_only=True, eq=False):
    """One picture of a wall, stamped at the middle of its exposure; uint8 or uint16, grey (H, W) or colour (H, W, 3).

    The estimator turns neighbouring frames into pixel motion itself; ``exposure_s`` None means the camera's own value.
    """

    image: NDArray[np.generic]
    exposure_s: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        shape = getattr(self.image, "shape", None)
        self._require(
            shape is not None and len(shape) in (2, 3), "image", shape, "an array of shape (H, W) or (H, W, C)"
        )
        if self.exposure_s is not None:
            self._finite("exposure_s", self.exposure_s, 0.0, 10.0)


class BlurLength(Reading, frozen=True, kw_only=True):
    """Unsigned length of the blur over ``window_s``, stamped at the window's middle."""

    window_s: float
    length_px: float
    sigma_px: float

    def __post_init__(self) -> None:
        self._stamp()
        self._finite("window_s", self.window_s, 1e-6, 10.0)
        self._finite("length_px", self.length_px, 0.0, 1e5)
        _sigma(self, "sigma_px", self.sigma_px)


class WallRange(Reading, frozen=True, kw_only=True):
    """Distance along the beam to the surface that the sensor is configured to see."""

    range_m: float
    sigma_m: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        self._finite("range_m", self.range_m, 0.0, MAX_LENGTH_M)
        _sigma(self, "sigma_m", self.sigma_m)


class UwbRange(Reading, frozen=True, kw_only=True):
    """Two-way range to one anchor; powers in dBm where the receiver reports them."""

    anchor: str
    range_m: float
    sigma_m: float | None = None
    rssi_dbm: float | None = None
    first_path_dbm: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        self._finite("range_m", self.range_m, 0.0, MAX_LENGTH_M)
        _sigma(self, "sigma_m", self.sigma_m)


class UwbTdoa(Reading, frozen=True, kw_only=True):
    """Range difference ``d(anchor_b) - d(anchor_a)``."""

    anchor_a: str
    anchor_b: str
    difference_m: float
    sigma_m: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        self._require(self.anchor_a != self.anchor_b, "anchor_b", self.anchor_b, "another anchor than anchor_a")
        self._finite("difference_m", self.difference_m, -MAX_LENGTH_M, MAX_LENGTH_M)
        _sigma(self, "sigma_m", self.sigma_m)


class UwbFix(Reading, frozen=True, kw_only=True):
    """Position computed by the UWB receiver, corridor frame."""

    position_m: Vector3
    sigma_m: Vector3 | None = None

    def __post_init__(self) -> None:
        self._stamp()
        _vector(self, "position_m", self.position_m, MAX_LENGTH_M)
        if self.sigma_m is not None:
            good = len(self.sigma_m) == 3 and all(0.0 < s < math.inf for s in self.sigma_m)
            self._require(good, "sigma_m", self.sigma_m, "three positive finite numbers, or None")


class Height(Reading, frozen=True, kw_only=True):
    """Barometric height above an unknown datum."""

    height_m: float
    sigma_m: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        self._finite("height_m", self.height_m, -MAX_LENGTH_M, MAX_LENGTH_M)
        _sigma(self, "sigma_m", self.sigma_m)


class Attitude(Reading, frozen=True, kw_only=True):
    """The autopilot's attitude: roll, pitch, yaw in aerospace order, FRD to NED [rad]."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    sigma_rad: float | None = None

    def __post_init__(self) -> None:
        self._stamp()
        for field in ("roll_rad", "pitch_rad", "yaw_rad"):
            self._finite(field, getattr(self, field), -7.0, 7.0)
        _sigma(self, "sigma_rad", self.sigma_rad)
