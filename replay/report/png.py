"""Grey pictures as data addresses, so that the page stays one file."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY_8_BIT = bytes((8, 0, 0, 0, 0))


def png(picture: NDArray[np.uint8]) -> bytes:
    """PNG file of a grey picture (h, w).

    Source: W3C, "Portable Network Graphics (PNG) Specification (Third Edition)", sections 5 and 9: every row begins
    with the number of its filter; 2 stores differences to the row above.
    """
    height, width = picture.shape
    rows = np.zeros((height, width + 1), dtype=np.uint8)
    rows[:, 0] = 2
    rows[0, 1:] = picture[0]
    rows[1:, 1:] = picture[1:] - picture[:-1]  # modulo 256, as the standard asks
    head = struct.pack(">II", width, height) + GREY_8_BIT
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return SIGNATURE + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def data_address(picture: NDArray[np.uint8]) -> str:
    """``data:`` address of a grey picture (h, w)."""
    return "data:image/png;base64," + base64.b64encode(png(picture)).decode("ascii")
