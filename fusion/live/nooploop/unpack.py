"""Complete frames to structures; lengths and counts have been compared before."""

from __future__ import annotations

import struct
from typing import TypeVar

from axialnav.fusion.live.nooploop import frames as f
from axialnav.fusion.live.nooploop.fields import (
    Implausible,
    angles,
    int24,
    position_error,
    power,
    quaternion_f,
    row24,
    u16,
    u32,
    vector24,
    vector_f,
)

IOT_NODES = 10
IOT_BYTES = 160
UNAVAILABLE_M = -8000.0
R = TypeVar("R", f.NodeFrame3, f.AoaNodeFrame0, f.NodeFrame5)


def tag_frame0(data: bytes) -> f.TagFrame0:
    """LinkTrack Tag_Frame0."""
    return f.TagFrame0(
        id=data[2],
        role=data[3],
        position_m=vector24(data, 4, 1000.0),
        velocity_m_s=vector24(data, 13, 10000.0),
        distances_m=row24(data, 22, 8),
        gyro_rad_s=vector_f(data, 46),
        accel_m_s2=vector_f(data, 58),
        angle_deg=angles(data, 82),
        quaternion=quaternion_f(data, 88),
        local_time_ms=u32(data, 108),
        system_time_ms=u32(data, 112),
        position_error_m=position_error(data, 117),
        voltage_v=u16(data, 120) / 1000.0,
    )


def iot_frame0(data: bytes) -> f.IotFrame0:
    """IoT Frame0; slots without a node are left out."""
    slots = range(6, 6 + 14 * IOT_NODES, 14)
    nodes = (
        f.IotNode(
            uid=u32(data, at),
            count=data[at + 4],
            distance_m=int24(data, at + 5) / 1000.0,
            angle_horizontal_deg=int24(data, at + 8) / 1000.0,
            angle_vertical_deg=int24(data, at + 11) / 1000.0,
        )
        for at in slots
        if u32(data, at)
    )
    return f.IotFrame0(id=u32(data, 2), nodes=tuple(nodes))


def _data_nodes(data: bytes, count_at: int, id_bytes: int) -> tuple[f.NodeData, ...]:
    nodes, at = [], count_at + 1
    for _ in range(data[count_at]):
        number = int.from_bytes(data[at + 1 : at + 1 + id_bytes], "little")
        start = at + 3 + id_bytes
        end = start + u16(data, at + 1 + id_bytes)
        nodes.append(f.NodeData(role=data[at], id=number, data=data[start:end]))
        at = end
    return tuple(nodes)


def node_frame0(data: bytes) -> f.NodeFrame0:
    """LinkTrack Node_Frame0."""
    return f.NodeFrame0(role=data[4], id=data[5], nodes=_data_nodes(data, 10, 1))


def node_frame6(data: bytes) -> f.NodeFrame6:
    """LinkTrack Node_Frame6."""
    return f.NodeFrame6(role=data[4], id=u32(data, 5), nodes=_data_nodes(data, 13, 4))


def node_frame1(data: bytes) -> f.NodeFrame1:
    """LinkTrack Node_Frame1."""
    places = range(27, 27 + 20 * data[26], 20)
    return f.NodeFrame1(
        role=data[4],
        id=data[5],
        system_time_ms=u32(data, 6),
        local_time_ms=u32(data, 10),
        voltage_v=u16(data, 24) / 1000.0,
        nodes=tuple(
            f.NodePosition(role=data[at], id=data[at + 1], position_m=vector24(data, at + 2, 1000.0)) for at in places
        ),
    )


def _range(data: bytes, at: int, id_bytes: int = 1, extra: int = 0) -> f.NodeRange:
    """One node: role, number, distance, ``extra`` bytes, first-path and total power."""
    distance_at = at + 1 + id_bytes
    return f.NodeRange(
        role=data[at],
        id=int.from_bytes(data[at + 1 : distance_at], "little"),
        distance_m=int24(data, distance_at) / 1000.0,
        first_path_dbm=power(data[distance_at + 3 + extra]),
        total_dbm=power(data[distance_at + 4 + extra]),
        angle_deg=struct.unpack_from("<h", data, distance_at + 3)[0] / 100.0 if extra else None,
    )


def _timed_range(data: bytes, at: int) -> f.NodeRange:
    return f.NodeRange(
        role=data[at],
        id=data[at + 1],
        distance_m=int24(data, at + 2) / 1000.0,
        first_path_dbm=power(data[at + 5]),
        total_dbm=power(data[at + 6]),
        system_time_ms=u32(data, at + 7),
    )


def node_frame2(data: bytes) -> f.NodeFrame2:
    """LinkTrack Node_Frame2."""
    return f.NodeFrame2(
        role=data[4],
        id=data[5],
        system_time_ms=u32(data, 6),
        position_error_m=position_error(data, 10),
        position_m=vector24(data, 13, 1000.0),
        velocity_m_s=vector24(data, 22, 10000.0),
        gyro_rad_s=vector_f(data, 40),
        accel_m_s2=vector_f(data, 52),
        angle_deg=angles(data, 76),
        quaternion=quaternion_f(data, 82),
        local_time_ms=u32(data, 102),
        voltage_v=u16(data, 116) / 1000.0,
        ranges=tuple(_timed_range(data, at) for at in range(119, 119 + 13 * data[118], 13)),
    )


def _ranges_frame(kind: type[R], data: bytes, step: int, id_bytes: int = 1, extra: int = 0) -> R:
    """Frames of one shape: role, number, both clocks, voltage, then nodes of ``step`` bytes behind their count."""
    after = 5 + id_bytes
    first = after + 15
    return kind(
        role=data[4],
        id=int.from_bytes(data[5:after], "little"),
        local_time_ms=u32(data, after),
        system_time_ms=u32(data, after + 4),
        voltage_v=u16(data, after + 12) / 1000.0,
        ranges=tuple(_range(data, at, id_bytes, extra) for at in range(first, first + step * data[first - 1], step)),
    )


def node_frame3(data: bytes) -> f.NodeFrame3:
    """LinkTrack Node_Frame3."""
    return _ranges_frame(f.NodeFrame3, data, 7)


def aoa_node_frame0(data: bytes) -> f.AoaNodeFrame0:
    """LinkTrack AOA Node_Frame0."""
    return _ranges_frame(f.AoaNodeFrame0, data, 11, extra=2)


def node_frame5(data: bytes) -> f.NodeFrame5:
    """LinkTrack Node_Frame5."""
    return _ranges_frame(f.NodeFrame5, data, 10, id_bytes=4)


def node_frame4(data: bytes) -> f.NodeFrame4:
    """LinkTrack Node_Frame4."""
    tags, at = [], 21
    for _ in range(data[20]):
        count, first = data[at + 4], at + 5
        ranges = tuple(
            f.NodeRange(role=int(f.Role.ANCHOR), id=data[p], distance_m=int24(data, p + 1) / 1000.0)
            for p in range(first, first + 4 * count, 4)
        )
        tags.append(f.TagRanges(id=data[at], voltage_v=data[at + 3] / 20.0, ranges=ranges))
        at = first + 4 * count
    return f.NodeFrame4(
        role=data[4],
        id=data[5],
        local_time_ms=u32(data, 6),
        system_time_ms=u32(data, 10),
        voltage_v=u16(data, 18) / 1000.0,
        tags=tuple(tags),
    )


def anchor_frame0(data: bytes) -> f.AnchorFrame0:
    """LinkTrack Anchor_Frame0; empty slots are left out."""
    nodes = tuple(
        f.NodePosition(
            role=data[at + 1],
            id=data[at],
            position_m=vector24(data, at + 2, 1000.0),
            distances_m=tuple(d / 100.0 for d in struct.unpack_from("<8H", data, at + 11)),
        )
        for at in range(2, 812, 27)
        if data[at] != 0xFF
    )
    if any(abs(c) > abs(UNAVAILABLE_M) for node in nodes for c in node.position_m):
        raise Implausible("a tag beyond 8 km")
    return f.AnchorFrame0(
        id=data[893],
        role=data[894],
        local_time_ms=u32(data, 879),
        system_time_ms=u32(data, 889),
        voltage_v=u16(data, 887) / 1000.0,
        nodes=nodes,
    )


def tofsense_frame0(data: bytes) -> f.TofSenseFrame0:
    """TOFSense_Frame0."""
    return f.TofSenseFrame0(
        id=data[3],
        system_time_ms=u32(data, 4),
        distance_m=int24(data, 8) / 1000.0,
        status=data[11],
        signal=u16(data, 12),
        precision_m=None if data[14] == 0xFF else data[14] / 100.0,
    )


def tofsense_m_frame0(data: bytes) -> f.TofSenseMFrame0:
    """TOFSense-M Frame0, whose distances are in micrometres."""
    pixels = (
        f.TofPixel(distance_m=int24(data, at) / 1e6, status=data[at + 3], signal=u16(data, at + 4))
        for at in range(9, 9 + 6 * data[8], 6)
    )
    return f.TofSenseMFrame0(id=data[3], system_time_ms=u32(data, 4), pixels=tuple(pixels))
