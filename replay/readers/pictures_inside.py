"""Pictures that stand inside a recording, one at a time."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder.cdr import Codec
from axialnav.replay.readers.mcap_records import Payload

_NUMBERED = re.compile(r"^\s*uint32\s+seq\b", re.MULTILINE)
RAW_KINDS = {
    "mono8": (np.uint8, 1),
    "8UC1": (np.uint8, 1),
    "bgr8": (np.uint8, 3),
    "rgb8": (np.uint8, 3),
    "8UC3": (np.uint8, 3),
    "mono16": (np.uint16, 1),
    "16UC1": (np.uint16, 1),
}


def stamps_of(pictures: Sequence[Callable[[], Payload]], definition: str) -> NDArray[np.int64]:
    """Header stamps of pictures [ns], shape (n,); the header comes first, in ROS 1 with a sequence number before it."""
    stamps = []
    place = 8 if _NUMBERED.search(definition) else 4
    for fetch in pictures:
        payload = fetch()
        order = "<" if payload[1] else ">"
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", payload, place)
        stamps.append(seconds * 1_000_000_000 + nanoseconds)
    return np.array(stamps, dtype=np.int64)


def pictures_in_order(
    pictures: Sequence[Callable[[], Payload]], kind: str, definition: str, where: str
) -> tuple[NDArray[np.int64], Callable[[], Iterator[NDArray[np.generic]]]]:
    """Stamps of pictures in their order [ns], and a function that goes through the pictures, fetching one at a time."""
    stamps = stamps_of(pictures, definition)
    order = np.argsort(stamps, kind="stable")
    message = PictureMessage(kind, definition, where)

    def each() -> Iterator[NDArray[np.generic]]:
        """Pictures one by one, each fetched when it is asked for."""
        for k in order.tolist():
            yield message.decode(pictures[k]())

    return stamps[order], each


class PictureMessage:
    """Decodes ``CompressedImage`` and ``Image`` messages; ``where`` names the source in errors."""

    def __init__(self, kind: str, definition: str, where: str) -> None:
        self._codec, self._raw, self._where = Codec(kind, definition), kind.endswith("/Image"), where

    def decode(self, payload: Payload) -> NDArray[np.generic]:
        """The picture: (H, W) or (H, W, C), uint8 or uint16.

        Raises
        ------
        FlightError
            No picture, or pixels of a kind that is not known.
        """
        columns = self._codec.decode([bytes(payload)]).columns
        if "data" not in columns:
            raise FlightError(f"{self._where}: a picture does not fit its definition; leave the camera out")
        data: bytes = columns["data"][0]
        if not self._raw:
            from axialnav.estimators.pictures import decode_picture

            return decode_picture(data, self._where)
        height, width, step = (int(columns[name][0]) for name in ("height", "width", "step"))
        encoding = str(columns["encoding"][0])
        if encoding not in RAW_KINDS:
            raise FlightError(f"{self._where}: pixels are {encoding!r}; there are {', '.join(RAW_KINDS)}")
        dtype, channels = RAW_KINDS[encoding]
        order = np.dtype(dtype).newbyteorder(">" if columns["is_bigendian"][0] else "<")
        if len(data) < step * height or step < width * channels * order.itemsize:
            raise FlightError(f"{self._where}: a picture of {width} x {height} holds {len(data)} bytes; it was cut")
        rows = np.frombuffer(data, dtype=np.uint8)[: step * height].reshape(height, step)
        line = np.ascontiguousarray(rows[:, : width * channels * order.itemsize]).view(order).astype(dtype)
        return line if channels == 1 else line.reshape(height, width, channels)
