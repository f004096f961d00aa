"""Nooploop modules on serial lines: from bytes to readings of the filter's sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.nooploop.readings import NLinkReadings
from axialnav.fusion.live.nooploop.serial_port import SerialPort
from axialnav.fusion.live.vehicle import Nooploop
from axialnav.fusion.readings import Reading

BITS_PER_BYTE = 10  # start and stop bit


class NooploopStage:
    """Reads one line; what is damaged or refused is counted by the decoder and the readings' maker."""

    def __init__(
        self,
        line: Nooploop,
        deliver: Callable[[Reading, int], object],
        clock: Callable[[], int],
        see: Callable[[str, bytes, int], None] | None = None,
    ) -> None:
        self._line, self._deliver, self._see = line, deliver, see
        self._port = SerialPort(line.device, line.baud, clock_ns=clock)
        self._decoder = NLinkDecoder()
        self._readings = NLinkReadings(
            ranges=line.ranges,
            fixes=line.fixes,
            wall=line.wall,
            tag=line.tag,
            tof_model=line.tof_model,
            refused_status=line.refused_status,
        )
        self._count = 0

    def fileno(self) -> int | None:
        """File to wait for; None while the port is away."""
        return self._port.fileno()

    def ready(self) -> None:
        """Take what has arrived."""
        arrival_ns, data = self._port.read()
        if data:
            self.feed(data, arrival_ns)

    def reopen(self) -> None:
        """Open the port if it is closed."""
        self._port.reopen()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def feed(self, data: bytes, arrival_ns: int) -> None:
        """Take bytes in and deliver the readings that they complete."""
        if self._see is not None:
            self._see(self._line.device, data, arrival_ns)
        on_the_wire_s = len(data) * BITS_PER_BYTE / self._line.baud
        t_ns = arrival_ns - round(1e9 * (self._line.delay_s + on_the_wire_s))
        for frame in self._decoder.feed(data):
            for reading in self._readings.of(frame, t_ns):
                self._count += 1
                self._deliver(reading, arrival_ns)

    def status(self) -> dict[str, Any]:
        """Counters of the line."""
        return {
            "connected": self._port.connected,
            "lost": self._port.lost,
            "readings": self._count,
            "refused": {reason: n for reason, n in self._readings.refused.items() if n},
            **msgspec.to_builtins(self._decoder.status),
        }
