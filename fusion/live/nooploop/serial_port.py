"""The serial line of a sensor: stamps what arrives, and comes back when the plug does."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

import serial

READ_BYTES = 4096
FIRST_WAIT_S = 0.1
LONGEST_WAIT_S = 2.0


class SerialPort:
    """A serial port that survives being unplugged.

    Parameters
    ----------
    device
        Path of the device; prefer one below ``/dev/serial/by-id``, whose name stays the same.
    baud
        921600 for LinkTrack and TOFSense as delivered.
    timeout_s
        Longest time that one :meth:`read` waits.
    clock_ns, sleep
        The vehicle's monotonic clock and how to wait.

    Attributes
    ----------
    lost
        How often the port went away.
    """

    def __init__(
        self,
        device: str,
        baud: int = 921600,
        *,
        timeout_s: float = 0.05,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._device, self._baud, self._timeout_s = device, baud, timeout_s
        self._clock_ns, self._sleep = clock_ns, sleep
        self._port: serial.Serial | None = None
        self._wait_s = FIRST_WAIT_S
        self.lost = 0

    @property
    def connected(self) -> bool:
        """Whether the port is open."""
        return self._port is not None

    def read(self) -> tuple[int, bytes]:
        """Time of arrival [ns] and what came, which is nothing after ``timeout_s`` or while the port is away."""
        if self._port is None and not self._open():
            self._sleep(self._wait_s)
            self._wait_s = min(2.0 * self._wait_s, LONGEST_WAIT_S)
            return self._clock_ns(), b""
        assert self._port is not None
        try:
            data = self._port.read(1)
            t_ns = self._clock_ns()
            if data:
                data += self._port.read(min(self._port.in_waiting, READ_BYTES))
        except (OSError, TypeError):  # pyserial raises TypeError where the descriptor vanishes while it reads
            self.close()
            self.lost += 1
            return self._clock_ns(), b""
        return t_ns, data

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
        """Close the port; :meth:`read` opens it again."""
        if self._port is not None:
            port, self._port = self._port, None
            try:
                port.close()
            except OSError:
                return

    def _open(self) -> bool:
        try:
            self._port = serial.Serial(self._device, self._baud, timeout=self._timeout_s)
        except (OSError, ValueError):
            return False
        self._wait_s = FIRST_WAIT_S
        return True


def dump_blocks(source: str | Path | BinaryIO, block_bytes: int = READ_BYTES) -> Iterator[bytes]:
    """A raw dump of a serial line, block by block, as :meth:`SerialPort.read` would have given it."""
    if isinstance(source, str | Path):
        with Path(source).open("rb") as file:
            yield from dump_blocks(file, block_bytes)
        return
    while block := source.read(block_bytes):
        yield block
