"""Bytes to and from the autopilot: UDP (listening or calling) and serial ports, behind one small interface.

A link is named by one line of the configuration::

    udpin:0.0.0.0:14551         wait for the autopilot (or a router) to send first
    udpout:192.168.1.10:14550   send first
    serial:/dev/ttyAMA0:921600  telemetry port

A port that is unplugged comes back by itself; what could not be sent is counted in ``unsent``.
"""

from __future__ import annotations

import socket
from typing import Protocol

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.nooploop.serial_port import SerialPort

Address = tuple[str, int]
MAX_DATAGRAM = 65_536
KINDS = "udpin:HOST:PORT, udpout:HOST:PORT or serial:DEVICE:BAUD"


class Link(Protocol):
    """What the node needs of a link."""

    unsent: int

    def fileno(self) -> int | None:
        """File to wait for; None while the port is away."""

    def receive(self) -> tuple[bytes, Address | None]:
        """Next bytes and where they came from, without waiting; empty if there are none."""

    def reopen(self) -> None:
        """Bring the port back if it is away."""

    def send(self, data: bytes) -> bool:
        """Send; False where nobody is known yet or the port is gone."""

    def confirm(self, address: Address | None) -> None:
        """A listed sender was heard from there: this is where to send."""

    def close(self) -> None:
        """Release the port."""


def open_link(name: str) -> Link:
    """Open the link called ``name``.

    Raises
    ------
    ConfigError
        The name is not one of the three forms, or the port cannot be opened.
    """
    kind, _, rest = name.partition(":")
    place, _, number = rest.rpartition(":")
    if kind not in ("udpin", "udpout", "serial") or not place or not number.isdigit():
        raise ConfigError(f"mavlink.link must be {KINDS}, got {name!r}")
    try:
        if kind == "serial":
            return SerialLink(place, int(number))
        return UdpLink(place, int(number), listen=kind == "udpin")
    except (OSError, OverflowError) as error:
        raise ConfigError(f"mavlink.link {name}: cannot be opened: {error}; is the port free and allowed?") from None


class UdpLink:
    """Datagrams; a listening link sends to where a listed sender was last heard."""

    def __init__(self, host: str, port: int, *, listen: bool) -> None:
        self.unsent = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._listen = listen
        self._peer: Address | None = None if listen else (host, port)
        try:
            self._socket.bind((host, port) if listen else ("", 0))
        except (OSError, OverflowError):
            self._socket.close()
            raise
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """Local port."""
        return int(self._socket.getsockname()[1])

    def fileno(self) -> int | None:
        """The socket's file."""
        return self._socket.fileno()

    def receive(self) -> tuple[bytes, Address | None]:
        """Next datagram and its sender."""
        try:
            return self._socket.recvfrom(MAX_DATAGRAM)
        except OSError:  # none has come, or an earlier one of ours met a closed port
            return b"", None

    def reopen(self) -> None:
        """A socket stays open."""

    def send(self, data: bytes) -> bool:
        """Send one datagram to the peer."""
        if self._peer is None:
            return False
        try:
            self._socket.sendto(data, self._peer)
        except OSError:
            self.unsent += 1
            return False
        return True

    def confirm(self, address: Address | None) -> None:
        """Send to ``address`` from here on, if this link listens."""
        if self._listen and address is not None:
            self._peer = address

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class SerialLink:
    """A serial port that comes back when it has been unplugged."""

    def __init__(self, device: str, baud: int) -> None:
        self.unsent = 0
        self._port = SerialPort(device, baud)

    def fileno(self) -> int | None:
        """The port's file; None while it is unplugged."""
        return self._port.fileno()

    def receive(self) -> tuple[bytes, Address | None]:
        """Whatever has arrived."""
        return self._port.read()[1], None

    def reopen(self) -> None:
        """Open the port if it is closed."""
        self._port.reopen()

    def send(self, data: bytes) -> bool:
        """Write ``data`` or count it as unsent."""
        if self._port.write(data):
            return True
        self.unsent += 1
        return False

    def confirm(self, address: Address | None) -> None:
        """A wire has one other end."""

    def close(self) -> None:
        """Close the port."""
        self._port.close()
