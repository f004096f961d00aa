"""``vehicle.toml``: everything ``axialnav live`` has to be told, typed and strict.

``[filter]`` is a configuration of the filter (:class:`~axialnav.fusion.config.Config`), written here or kept in a file
of its own (``filter_file``, for example the ``config.toml`` of a replay).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.nooploop.readings import TofModel
from axialnav.fusion.strict_toml import decode, parse, read_text
from axialnav.models.rig import AttitudeSource, Camera, Flow, Imu, Positive, RangeFinder, Uwb

Byte = Annotated[int, msgspec.Meta(ge=0, le=255)]
Rate = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the tables: frozen and strict."""


class Mavlink(_Table, frozen=True, kw_only=True):
    """The link to the autopilot, who we are on it, and who may speak."""

    link: str = "udpin:127.0.0.1:14551"
    profile: Literal["ardupilot", "px4"] = "ardupilot"
    system: Byte = 1
    component: Byte = 197
    allow: tuple[tuple[Byte, Byte], ...] = ((1, 1),)
    key_file: str | None = None


class Inputs(_Table, frozen=True, kw_only=True):
    """Which sensor of the filter each MAVLink message feeds; what is not named is not used.

    ``range`` maps sensor names to the orientation of DISTANCE_SENSOR messages (25 looks down, 0 ahead, 6 to the left).
    """

    imu: str = "imu0"
    imu_rate_hz: Rate = 200.0
    attitude: str | None = None
    flow: str | None = None
    vision: str | None = None
    range: dict[str, Byte] = {}
    aid_rate_hz: Rate = 50.0


class Output(_Table, frozen=True, kw_only=True):
    """What is sent and when it is not.

    ``content = "auto"`` sends the full state where UWB makes the position known, else what the estimator knows: the
    velocity, or for the axial estimator the axial velocity (``px4`` only).  ``heading_deg`` is the direction of the
    corridor's x axis, clockwise from north; without it the local frame is the corridor's own.
    """

    content: Literal["auto", "full", "velocity", "axial"] = "auto"
    rate_hz: Annotated[float, msgspec.Meta(ge=25.0, le=40.0)] = 30.0
    heading_deg: float | None = None
    stale_s: Annotated[float, msgspec.Meta(gt=0.0, le=0.25)] = 0.2
    aid_stale_s: Annotated[float, msgspec.Meta(gt=0.0, le=5.0)] = 0.2
    max_sigma_velocity_m_s: Positive = 0.5
    jump_position_m: Positive = 0.3
    jump_velocity_m_s: Positive = 1.0
    check_attitude_deg: Positive = 10.0


class CameraInput(_Table, frozen=True, kw_only=True):
    """A camera: a V4L2 device, a video file or a folder of pictures, all used alike.

    ``stamp`` says what the driver's time stamp marks: the ``start`` of the exposure (UVC) or the ``end`` of the frame.
    """

    source: str
    sensor: str = "cam0"
    exposure_s: Positive | None = None
    gain: float | None = None
    fourcc: Annotated[str, msgspec.Meta(min_length=4, max_length=4)] | None = None
    stamp: Literal["start", "end"] = "start"


class Nooploop(_Table, frozen=True, kw_only=True):
    """One serial line with a LinkTrack or TOFSense module, and the sensors that its numbers feed.

    ``delay_s`` is how old a measurement is when it arrives: the module's averaging and the time on the wire.
    """

    device: str
    baud: Annotated[int, msgspec.Meta(ge=1200, le=4_000_000)] = 921_600
    ranges: str | None = None
    fixes: str | None = None
    wall: str | None = None
    tag: int | None = None
    tof_model: TofModel = "tofsense"
    refused_status: tuple[Byte, ...] | None = None
    delay_s: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0


class Recording(_Table, frozen=True, kw_only=True):
    """Where everything that came in and went out is kept."""

    folder: str
    frames: bool = True


class Status(_Table, frozen=True, kw_only=True):
    """Status on the loopback interface (port 0: none) and as a line on the terminal (0 s: none)."""

    port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 14600
    line_s: Annotated[float, msgspec.Meta(ge=0.0)] = 1.0


class Vehicle(_Table, frozen=True, kw_only=True):
    """The whole file."""

    estimator: Literal["corridor", "axial"] = "corridor"
    filter_file: str | None = None
    filter: Config = Config()
    mavlink: Mavlink = Mavlink()
    input: Inputs = Inputs()
    output: Output = Output()
    camera: CameraInput | None = None
    nooploop: tuple[Nooploop, ...] = ()
    record: Recording | None = None
    status: Status = Status()

    def __post_init__(self) -> None:
        if self.filter_file is None:
            self.check()

    @classmethod
    def from_toml(cls, path: str | Path) -> Vehicle:
        """Read a vehicle.toml; paths in it are relative to the file.

        Raises
        ------
        ConfigError
            Unreadable, unknown key, wrong value, or a sensor that ``[filter]`` does not describe.
        """
        path = Path(path)
        vehicle = decode(parse(read_text(path, "vehicle file"), where=str(path)), cls, where=str(path))
        if vehicle.filter_file is None:
            return vehicle
        if vehicle.filter != Config():
            raise ConfigError(f"{path}: filter_file and [filter] are both there; keep one")
        loaded = Config.from_toml(path.parent / vehicle.filter_file)
        try:
            return msgspec.structs.replace(vehicle, filter=loaded, filter_file=None)
        except ValueError as error:
            raise ConfigError(f"{path}: {error}") from None

    def check(self) -> None:
        """Refuse names that no sensor of the filter has, and contents that the profile cannot carry.

        Raises
        ------
        ValueError
            One line that names the key.
        """
        wanted: list[tuple[str, str | None, type[Any]]] = [
            ("input.imu", self.input.imu, Imu),
            ("input.attitude", self.input.attitude, AttitudeSource),
            ("input.flow", self.input.flow, Flow),
            ("input.vision", self.input.vision, Uwb),
            ("camera.sensor", self.camera.sensor if self.camera else None, Camera),
            *[("input.range", name, RangeFinder) for name in self.input.range],
            *[
                (f"nooploop.{key}", name, kind)
                for line in self.nooploop
                for key, name, kind in (
                    ("ranges", line.ranges, Uwb),
                    ("fixes", line.fixes, Uwb),
                    ("wall", line.wall, RangeFinder),
                )
            ],
        ]
        for key, name, kind in wanted:
            if name is not None and not isinstance(self.filter.sensor.get(name), kind):
                known = ", ".join(n for n, s in self.filter.sensor.items() if isinstance(s, kind)) or "none"
                raise ValueError(
                    f"{key} = {name!r} is not a {kind.__name__} described in [filter.sensor]; there are {known}"
                )
        if self.output.content == "axial" and self.mavlink.profile != "px4":
            raise ValueError(
                'output.content = "axial" is for profile "px4": ArduPilot takes all three axes of a velocity or none; '
                'use "velocity" with the corridor estimator'
            )
        if self.content == "full" and self.estimator == "axial":
            raise ValueError('output.content = "full" needs estimator = "corridor": the axial one knows one axis')

    @property
    def content(self) -> Literal["full", "velocity", "axial"]:
        """What is sent, with "auto" decided."""
        if self.output.content != "auto":
            return self.output.content
        if self.estimator == "axial":
            return "axial" if self.mavlink.profile == "px4" else "velocity"
        located = any(isinstance(s, Uwb) and n not in self.filter.disabled for n, s in self.filter.sensor.items())
        return "full" if located else "velocity"

    @property
    def heading_rad(self) -> float:
        """Direction of the corridor's x axis in the local frame of the messages [rad]."""
        return math.radians(self.output.heading_deg or 0.0)
