"""Where everything stands in a frame: how long it is, whether its beginning can be true, and how to take it apart.

Little endian throughout; distances are 24-bit two's complement.  All counts come from the wire, so every one is
compared with the length of the frame before it is used.

Source: the manufacturer's protocol ("NLink protocol", LinkTrack and TOFSense user manuals).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

from axialnav.fusion.live.nooploop import frames as f
from axialnav.fusion.live.nooploop.fields import Implausible

MORE = -1
REFUSED = 0
MAX_FRAME_BYTES = 4096
MAX_ROLE = 16


@dataclass(frozen=True, slots=True)
class Layout:
    """One kind of frame.

    Attributes
    ----------
    name
        Class of the frame, for counters.
    head
        Its first two bytes.
    size
        Of the bytes so far: length of the frame, :data:`MORE` to wait for more bytes, :data:`REFUSED` if no frame of
        this kind can begin like that.
    unpack
        Complete frame to structure; raises :class:`Implausible`.
    tail
        Last byte where that is a constant instead of the sum.
    """

    name: str
    head: bytes
    size: Callable[[memoryview], int]
    unpack: Callable[[bytes], f.Frame]
    tail: int | None = None

    def intact(self, frame: memoryview) -> bool:
        """Whether the last byte is right."""
        return frame[-1] == (sum(frame[:-1]) & 0xFF if self.tail is None else self.tail)


def fixed(length: int) -> Callable[[memoryview], int]:
    """Size of frames that are always equally long."""
    return lambda _: length


def counted(count_at: int, node: int) -> Callable[[memoryview], int]:
    """Size of frames whose length field has to agree with a count of nodes of equal size."""

    def size(view: memoryview) -> int:
        """Length of the frame, MORE or REFUSED."""
        if len(view) < 4:
            return MORE
        length: int = struct.unpack_from("<H", view, 2)[0]
        whole = (length - count_at - 2) % node == 0 and count_at + 2 <= length <= MAX_FRAME_BYTES
        if not whole or (len(view) > 4 and view[4] > MAX_ROLE):
            return REFUSED
        if len(view) <= count_at:
            return MORE
        return length if length == count_at + 2 + node * view[count_at] else REFUSED

    return size


def walked(count_at: int, head: int, step: Callable[[memoryview, int], int]) -> Callable[[memoryview], int]:
    """Size of frames whose nodes differ in length: the nodes seen so far have to fit into the length field.

    ``head`` is the length of a node without its content and ``step`` gives the length of the one at a place.
    """

    def size(view: memoryview) -> int:
        """Length of the frame, MORE or REFUSED."""
        if len(view) < 4:
            return MORE
        length: int = struct.unpack_from("<H", view, 2)[0]
        if not count_at + 2 <= length <= MAX_FRAME_BYTES or (len(view) > 4 and view[4] > MAX_ROLE):
            return REFUSED
        if len(view) <= count_at:
            return MORE
        place = count_at + 1
        for _ in range(view[count_at]):
            if place + head > length - 1:
                return REFUSED
            if place + head > len(view):
                return MORE
            place += step(view, place)
        return length if place == length - 1 else REFUSED

    return size


def anchor_frame_size(view: memoryview) -> int:
    """Size of an Anchor_Frame0, whose slots are checked as they come because nothing else protects it."""
    for place in range(2, min(len(view) - 1, 812), 27):
        if view[place] != 0xFF and view[place + 1] > MAX_ROLE:
            return REFUSED
    return REFUSED if len(view) > 894 and view[894] > MAX_ROLE else 896


def tof_m_size(view: memoryview) -> int:
    """Size of a TOFSense-M frame: 16 or 64 pixels."""
    if len(view) < 9:
        return MORE
    return 16 + 6 * view[8] if view[8] in {16, 64} else REFUSED


def all_layouts() -> tuple[Layout, ...]:
    """Every kind of frame, those with the same head in the order in which they are tried."""
    from axialnav.fusion.live.nooploop import unpack as u

    data8 = walked(10, 4, lambda view, at: 4 + view[at + 2] + 256 * view[at + 3])
    data32 = walked(13, 7, lambda view, at: 7 + view[at + 5] + 256 * view[at + 6])
    tags = walked(20, 5, lambda view, at: 5 + 4 * view[at + 4])
    return (
        Layout("AnchorFrame0", b"\x55\x00", anchor_frame_size, u.anchor_frame0, tail=0xEE),
        Layout("TagFrame0", b"\x55\x01", fixed(128), u.tag_frame0),
        Layout("IotFrame0", b"\x55\x01", fixed(u.IOT_BYTES), u.iot_frame0),
        Layout("NodeFrame0", b"\x55\x02", data8, u.node_frame0),
        Layout("NodeFrame1", b"\x55\x03", counted(26, 20), u.node_frame1),
        Layout("NodeFrame2", b"\x55\x04", counted(118, 13), u.node_frame2),
        Layout("NodeFrame3", b"\x55\x05", counted(20, 7), u.node_frame3),
        Layout("NodeFrame4", b"\x55\x06", tags, u.node_frame4),
        Layout("AoaNodeFrame0", b"\x55\x07", counted(20, 11), u.aoa_node_frame0),
        Layout("NodeFrame5", b"\x55\x08", counted(23, 10), u.node_frame5),
        Layout("NodeFrame6", b"\x55\x09", data32, u.node_frame6),
        Layout("TofSenseFrame0", b"\x57\x00", fixed(16), u.tofsense_frame0),
        Layout("TofSenseMFrame0", b"\x57\x01", tof_m_size, u.tofsense_m_frame0),
    )


__all__ = ["MORE", "REFUSED", "Implausible", "Layout", "all_layouts"]
