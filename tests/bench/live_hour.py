"""An hour on board as fast as the machine can: every wire, the filter, the messages and the recorder, and the memory.

The node is fed without its threads, on a clock that the bench moves.  The flight is one closed lap, flown again and
again; pictures are left out, the image-flow sensor stands for them.
"""

from __future__ import annotations

import gc
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.transport import Address
from axialnav.fusion.live.warm_up import warm_up
from tests.bench.endless import LAP_S, LEAD_S
from tests.bench.markdown import number
from tests.fusion.live.contract import ContractArduPilot
from tests.fusion.live.streamed import Course, StreamedVehicle, ahead, streamed_flight, vehicle_of
from tests.fusion.made_flights import Scene

HEAD = ("minute", "resident [MiB]", "readings taken", "messages sent", "written [MiB]")
OUTPUT_S = 1.0 / 30.0
MANY_WAITING = 5_000
MEGA = 1 << 20


class Wireless:
    """A link that takes everything and from which nothing comes."""

    unsent = 0

    def __init__(self, contract: ContractArduPilot) -> None:
        self.contract = contract
        self.boot_ns = 0

    def send(self, data: bytes) -> bool:
        self.contract.take(data, self.boot_ns)
        self.contract.messages.clear()
        self.contract.verdicts.clear()
        self.contract.beats.clear()
        return True

    def receive(self) -> tuple[bytes, Address | None]:
        return b"", None

    def fileno(self) -> int | None:
        return None

    def reopen(self) -> None: ...

    def confirm(self, address: Address | None) -> None: ...

    def close(self) -> None: ...


class Hour:
    """A node, its clock, and the lap that it flies."""

    def __init__(self, folder: Path) -> None:
        scene = Scene(seed=17, duration_s=LEAD_S + LAP_S + 0.1, sensors=("range0", "flow0", "uwb0"), uwb_rate_hz=50.0)
        course: Course = streamed_flight(scene)
        self.streamed = StreamedVehicle(course)
        vehicle = vehicle_of(ahead(course.config), self.streamed.port, self.streamed.ttys)
        warm_up(vehicle.filter, vehicle.estimator)
        self.start_ns = self.now_ns = time.monotonic_ns()
        self.wire = Wireless(ContractArduPilot())
        self.recording = FlightRecording(folder, True, lambda: self.now_ns)
        self.node = Node(vehicle, link=self.wire, clock=lambda: self.now_ns, recording=self.recording)
        self._lines = dict(zip(self.streamed.ttys, self.node._lines, strict=True))
        self._next_s = 0.0

    def fly(self, laps: int) -> Iterator[tuple[float, float]]:
        """Fly; after each lap the minute and the resident memory [MiB]."""
        events = [(t, name, data) for t, _, name, data in self.streamed.events if t < LEAD_S + LAP_S]
        for lap in range(laps):
            for t, name, data in events:
                if lap == 0 or t >= LEAD_S:
                    self._take(t + lap * LAP_S, name, data)
            while (self.recording.status().get("queued") or 0) > MANY_WAITING:
                time.sleep(0.05)
            gc.collect()
            yield (LEAD_S + (lap + 1) * LAP_S) / 60.0, resident_mib()

    def _take(self, t: float, name: str, data: Any) -> None:
        node, boot_ns = self.node, self.streamed.boot(t)
        self.now_ns, self.wire.boot_ns = self.start_ns + round(t * 1e9), boot_ns
        if isinstance(data, bytes):
            self._lines[name].feed(data, self.now_ns)
        else:
            packet = data(boot_ns).pack(self.streamed.packer)
            self.streamed.packer.seq = (self.streamed.packer.seq + 1) % 256
            node._receive(packet, None)
        if t >= self._next_s:
            self._next_s = t + OUTPUT_S
            node.autopilot.clock.exchange(self.now_ns - 400_000, self.streamed.boot(t - 200e-6), self.now_ns)
            node.autopilot.tick(self.now_ns)
            node.output.step()

    def close(self) -> None:
        self.recording.close()
        self.streamed.socket.close()


def resident_mib() -> float:
    """Memory that this process holds at present."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGA


def hour_rows(minutes: float = 60.0, shown: int = 8) -> Iterator[list[str]]:
    """Memory over an hour; the last row is the growth from the fifth minute on."""
    laps = round((60.0 * minutes - LEAD_S) / LAP_S)
    with tempfile.TemporaryDirectory() as folder:
        hour = Hour(Path(folder))
        rows: list[tuple[float, float]] = []
        for minute, mib in hour.fly(laps):
            rows.append((minute, mib))
            if len(rows) % max(laps // shown, 1) == 0 or len(rows) == laps:
                status = hour.node.status()
                taken = sum(n for verdicts in status["filter"]["verdicts"].values() for n in verdicts.values())
                written = status["recording"]["bytes_written"] / MEGA
                yield [number(minute, 0), number(mib, 1), str(taken), str(status["output"]["sent"]), number(written, 0)]
        hour.close()
    late = [(minute, mib) for minute, mib in rows if minute >= 5.0] or rows
    yield ["growth since minute 5", f"{late[-1][1] - late[0][1]:+.1f}", "-", "-", "-"]
