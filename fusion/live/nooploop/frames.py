"""What Nooploop sensors send, one frozen structure a frame; metres, seconds, radians unless a name says otherwise.

``system_time_ms`` is the clock that the modules of one UWB network share, ``local_time_ms`` the module's own; both
count milliseconds since power-on and wrap after 49.7 days.  Powers are dBm in steps of 0.5.
"""

from __future__ import annotations

from enum import IntEnum

import msgspec

Vector3 = tuple[float, float, float]


class Role(IntEnum):
    """What a module of the network is set to be."""

    NODE = 0
    ANCHOR = 1
    TAG = 2
    CONSOLE = 3
    DT_MASTER = 4
    DT_SLAVE = 5
    DM_MASTER = 6
    MONITOR = 7


class NodeRange(msgspec.Struct, frozen=True, kw_only=True):
    """Distance to one node; powers where the frame carries them, ``angle_deg`` from AOA frames alone."""

    role: int
    id: int
    distance_m: float
    first_path_dbm: float | None = None
    total_dbm: float | None = None
    system_time_ms: int | None = None
    angle_deg: float | None = None


class NodeData(msgspec.Struct, frozen=True, kw_only=True):
    """Bytes that a node passed through the network."""

    role: int
    id: int
    data: bytes


class NodePosition(msgspec.Struct, frozen=True, kw_only=True):
    """Position of a tag, and its distances to anchors 0 to 7 (0: none) where the frame carries them."""

    role: int
    id: int
    position_m: Vector3
    distances_m: tuple[float, ...] = ()


class TagRanges(msgspec.Struct, frozen=True, kw_only=True):
    """Distances of one tag to anchors by number."""

    id: int
    voltage_v: float
    ranges: tuple[NodeRange, ...]


class TofPixel(msgspec.Struct, frozen=True, kw_only=True):
    """One pixel of a TOFSense-M: distance, the model's status code, signal strength."""

    distance_m: float
    status: int
    signal: int


class Frame(msgspec.Struct, frozen=True, kw_only=True):
    """Base of all frames; ``id`` is the number of the module that sent it."""

    id: int


class TagFrame0(Frame, frozen=True, kw_only=True):
    """A tag's own solution and its distances to anchors 0 to 7 (0: none).

    Position, velocity and attitude come from the module's own filter; ``position_error_m`` is its own estimate, 2.55
    meaning unknown.
    """

    role: int
    position_m: Vector3
    velocity_m_s: Vector3
    distances_m: tuple[float, ...]
    gyro_rad_s: Vector3
    accel_m_s2: Vector3
    angle_deg: Vector3
    quaternion: tuple[float, float, float, float]
    local_time_ms: int
    system_time_ms: int
    position_error_m: Vector3
    voltage_v: float


class NodeFrame0(Frame, frozen=True, kw_only=True):
    """Pass-through data of several nodes."""

    role: int
    nodes: tuple[NodeData, ...]


class NodeFrame1(Frame, frozen=True, kw_only=True):
    """Positions of several tags."""

    role: int
    system_time_ms: int
    local_time_ms: int
    voltage_v: float
    nodes: tuple[NodePosition, ...]


class NodeFrame2(Frame, frozen=True, kw_only=True):
    """A tag's own solution, and ranges with first-path and total power."""

    role: int
    system_time_ms: int
    position_error_m: Vector3
    position_m: Vector3
    velocity_m_s: Vector3
    gyro_rad_s: Vector3
    accel_m_s2: Vector3
    angle_deg: Vector3
    quaternion: tuple[float, float, float, float]
    local_time_ms: int
    voltage_v: float
    ranges: tuple[NodeRange, ...]


class NodeFrame3(Frame, frozen=True, kw_only=True):
    """Ranges with first-path and total power."""

    role: int
    local_time_ms: int
    system_time_ms: int
    voltage_v: float
    ranges: tuple[NodeRange, ...]


class NodeFrame4(Frame, frozen=True, kw_only=True):
    """Distances of several tags to their anchors, as a console hears them."""

    role: int
    local_time_ms: int
    system_time_ms: int
    voltage_v: float
    tags: tuple[TagRanges, ...]


class NodeFrame5(NodeFrame3, frozen=True, kw_only=True):
    """As :class:`NodeFrame3`, with 32-bit numbers."""


class NodeFrame6(NodeFrame0, frozen=True, kw_only=True):
    """As :class:`NodeFrame0`, with 32-bit numbers."""


class AoaNodeFrame0(NodeFrame3, frozen=True, kw_only=True):
    """As :class:`NodeFrame3`, with the angle of arrival of each node."""


class AnchorFrame0(Frame, frozen=True, kw_only=True):
    """Positions of up to 30 tags with their distances to anchors 0 to 7; the frame carries no checksum."""

    role: int
    local_time_ms: int
    system_time_ms: int
    voltage_v: float
    nodes: tuple[NodePosition, ...]


class IotNode(msgspec.Struct, frozen=True, kw_only=True):
    """One node that an IoT module hears."""

    uid: int
    count: int
    distance_m: float
    angle_horizontal_deg: float
    angle_vertical_deg: float


class IotFrame0(Frame, frozen=True, kw_only=True):
    """Distances and angles of an IoT module; ``id`` is its 32-bit number."""

    nodes: tuple[IotNode, ...]


class TofSenseFrame0(Frame, frozen=True, kw_only=True):
    """One distance of a TOFSense; ``precision_m`` from model F alone."""

    system_time_ms: int
    distance_m: float
    status: int
    signal: int
    precision_m: float | None


class TofSenseMFrame0(Frame, frozen=True, kw_only=True):
    """16 or 64 distances of a TOFSense-M, row by row."""

    system_time_ms: int
    pixels: tuple[TofPixel, ...]
