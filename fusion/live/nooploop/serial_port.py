"""The serial line of a sensor: stamps what arrives, and comes back when the plug does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import serial

READ_BYTES = 4096
FIRST_WAIT_NS = 100_000_000
LONGEST_WAIT_NS = 1_000_000_000


class SerialPort:
    """A serial port that survives being unplugged.

    One thread reads; another may call :meth:`reopen`, which brings the port back.

    Parameters
    ----------
    device
        Path of the device; prefer one below ``/dev/serial/by-id``, whose name stays the same.
    baud
        921600 for LinkTrack and TOFSense as delivered.
    clock_ns
        The vehicle's monotonic clock.

    Attributes
    ----------
    lost
        How often the port went away.
    """

    def __init__(self, device: str, baud: int = 921600, *, clock_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._device, self._baud, self._clock_ns = device, baud, clock_ns
        self._port: serial.Serial | None = None
        self._wait_ns, self._next_ns = FIRST_WAIT_NS, 0
        self.lost = 0

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def fileno(self) -> int | None:
        """File to wait for; None while the port is away."""
        port = self._port
        return port.fd if port is not None else None

    def read(self) -> tuple[int, bytes]:
        """Time of arrival [ns] and what has come, without waiting."""
        port = self._port
        if port is None:
            return self._clock_ns(), b""
        try:
            data = port.read(READ_BYTES)
        except (OSError, TypeError):  # pyserial raises TypeError where the descriptor vanishes while it reads
            self.close()
            self.lost += 1
            data = b""
        return self._clock_ns(), data

    def reopen(self) -> None:
        """Open the port if it is closed; after every failure wait longer before the next try."""
        if self._port is not None or self._clock_ns() < self._next_ns:
            return
        try:
            self._port = serial.Serial(self._device, self._baud, timeout=0)
        except (OSError, ValueError):
            self._next_ns = self._clock_ns() + self._wait_ns
            self._wait_ns = min(2 * self._wait_ns, LONGEST_WAIT_NS)
            return
        self._wait_ns = FIRST_WAIT_NS

    def write(self, data: bytes) -> bool:
        """Send, for modules that answer queries; False while the port is away."""
        if self._port is None:
            return False
        try:
            self._port.write(data)
        except OSError:
            self.close()
            self.lost += 1
            return False
        return True

    def close(self) -> None:
        """Close the port; :meth:`reopen` opens it again."""
        if self._port is not None:
            port, self._port = self._port, None
            try:
                port.close()
            except OSError:
                return


def dump_blocks(source: str | Path | BinaryIO, block_bytes: int = READ_BYTES) -> Iterator[bytes]:
    """A raw dump of a serial line, block by block, as :meth:`SerialPort.read` would have given it."""
    if isinstance(source, str | Path):
        with Path(source).open("rb") as file:
            yield from dump_blocks(file, block_bytes)
        return
    while block := source.read(block_bytes):
        yield block
