"""What is to be flown: corridor, vehicle, camera and sensors, as a TOML file or one of the built-in scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from axialnav.fusion.strict_toml import decode, parse, read_text
from axialnav.models.rig import NonNegative, Positive, Vector3

Side = Literal["left", "right"]
Share = Annotated[float, msgspec.Meta(ge=0.0, lt=1.0)]
UpTo10 = Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]
UwbCondition = Literal["clean", "corner", "ramp", "step", "spikes", "frozen", "wild", "none"]
Fault = Literal["tof_misses", "tof_spikes", "accel_runaway", "frame_drops", "uwb_late", "attitude_drift", "baro_doors"]
ORDINARY_FAULTS: tuple[Fault, ...] = ("tof_misses", "tof_spikes", "attitude_drift", "baro_doors")


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all tables of a mission: frozen and strict."""


class WallLook(_Table, frozen=True, kw_only=True):
    """How a wall looks: photograph, contrast (standard deviation over mean) and how much light it returns."""

    texture: Literal["concrete", "plaster", "rock", "near_blank", "brick", "mixed"] = "mixed"
    contrast: Share = 0.10
    albedo: Annotated[float, msgspec.Meta(gt=0.0, le=2.0)] = 1.0


class Opening(_Table, frozen=True, kw_only=True):
    """A doorway in a side wall: ``start_m`` after the beginning of its section, as high as the corridor."""

    side: Side
    start_m: NonNegative
    length_m: Positive
    depth_m: Positive = 1.5


class SectionPlan(_Table, frozen=True, kw_only=True):
    """One stretch of corridor.

    ``length_m`` is the run along the floor plan; for a corner it is how far the turn reaches into each of its two legs.
    ``turn_deg`` is positive to the left (corners only); ``rise_m`` positive upwards (stairs only).
    """

    kind: Literal["straight", "stairs", "corner"]
    length_m: float
    width_m: float = 3.0
    height_m: float = 3.0
    turn_deg: float = 0.0
    rise_m: float = 0.0
    left: WallLook = WallLook()
    right: WallLook = WallLook()
    floor: WallLook = WallLook(texture="rock", contrast=0.15, albedo=0.6)
    ceiling: WallLook = WallLook(texture="plaster", contrast=0.05, albedo=0.9)
    opening: tuple[Opening, ...] = ()


class VehiclePlan(_Table, frozen=True, kw_only=True):
    """How it is flown.

    ``drag_per_s`` is the linear rotor drag [1/s]; it tilts the vehicle at constant speed.  ``clearance_sigma_m`` and
    ``yaw_sigma_rad`` are how well wall distance and heading are held.
    """

    profile: Literal["constant", "stop_and_go", "paper"] = "constant"
    speed_m_s: Positive = 1.0
    acceleration_m_s2: Annotated[float, msgspec.Meta(gt=0.0, le=50.0)] = 0.8
    still_s: NonNegative = 3.0
    height_m: Positive = 1.5
    offset_m: float = 0.0
    clearance_sigma_m: NonNegative = 0.04
    yaw_sigma_rad: Annotated[float, msgspec.Meta(ge=0.0, le=0.3)] = 0.01
    drag_per_s: UpTo10 = 0.15
    vibration_m_s2: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.6


class CameraPlan(_Table, frozen=True, kw_only=True):
    """The wall camera, level with the vehicle and square to its side.

    ``focal_error`` is the standard deviation of its calibrated focal length, relative.
    """

    side: Side = "left"
    width_px: Annotated[int, msgspec.Meta(ge=64, le=4096)] = 640
    height_px: Annotated[int, msgspec.Meta(ge=48, le=4096)] = 480
    focal_px: Positive = 320.0
    focal_error: Annotated[float, msgspec.Meta(ge=0.0, le=0.2)] = 0.001
    rate_hz: Annotated[float, msgspec.Meta(ge=1.0, le=500.0)] = 30.0
    exposure_s: Positive = 0.010
    readout_s: NonNegative = 0.0
    light: Literal["bright", "dim", "dark"] = "bright"
    flicker_hz: Positive = 100.0
    flicker_depth: Share = 0.2
    pixel_pattern: Share = 0.003
    column_pattern: Share = 0.001
    vignette: Share = 0.1


class UwbPlan(_Table, frozen=True, kw_only=True):
    """UWB anchors in world coordinates, near take-off if none are named, and the condition of the radio."""

    measurement: Literal["range", "tdoa", "position"] = "range"
    anchors: dict[str, Vector3] = {}
    rate_hz: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)] = 50.0
    sigma_m: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 0.10
    latency_s: UpTo10 = 0.02
    condition: UwbCondition = "corner"


class Mission(_Table, frozen=True, kw_only=True):
    """A whole flight.  ``faults`` names what goes wrong beside the noise of the data sheets."""

    name: str
    section: Annotated[tuple[SectionPlan, ...], msgspec.Meta(min_length=1)]
    vehicle: VehiclePlan = VehiclePlan()
    camera: CameraPlan = CameraPlan()
    uwb: UwbPlan = UwbPlan()
    faults: tuple[Fault, ...] = ORDINARY_FAULTS
    duration_s: Positive | None = None

    @property
    def camera_distance_m(self) -> float:
        """From the camera to its wall in the narrowest section, clearance as commanded [m]."""
        toward = self.vehicle.offset_m if self.camera.side == "left" else -self.vehicle.offset_m
        return min(0.5 * plan.width_m for plan in self.section) - toward


def read_mission(path: Path) -> Mission:
    """Read a mission from a TOML file.

    Raises
    ------
    ConfigError
        Not readable, not TOML, an unknown key (with the nearest known one) or a value out of its limits.
    """
    table = parse(read_text(path, "mission"), where=str(path))
    return decode({"name": path.stem, **table}, Mission, where=str(path))
