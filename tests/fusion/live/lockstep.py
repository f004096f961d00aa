"""A whole node in flight on a clock that moves from event to event: no thread, no sleep, the same on any machine.

Bytes travel through real sockets and pseudo-terminals; each packet is waited for at the other end before time goes on.
What is said of seconds here is said of the node's own clock.
"""

from __future__ import annotations

import array
import fcntl
import select
import termios
from collections.abc import Callable, Iterator
from dataclasses import replace

from axialnav.fusion.live.camera_source import Picture
from axialnav.fusion.live.node import TICK_S, Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.transport import UdpLink
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.wires import REOPEN_S
from tests.fusion.live.accounts import PATIENCE_S, wait_for
from tests.fusion.live.filmed import Shutter
from tests.fusion.live.streamed import StreamedVehicle

MEASURE_NS = 9_000_000  # from a picture to its motion
NEVER_NS = 2**62
UNREAD = 2048


class Clock:
    """A clock that only its owner moves [ns]."""

    def __init__(self) -> None:
        self.now_ns = 1_000_000_000_000

    def __call__(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


class Counted(UdpLink):
    """A link that knows how many packets it took."""

    packets = 0

    def send(self, data: bytes) -> bool:
        sent = super().send(data)
        self.packets += sent
        return sent


class Lockstep:
    """A node and the vehicle around it.

    Parameters
    ----------
    streamed
        The vehicle; it has to use ``clock``.
    vehicle
        What the node is told of it, with a link ``udpout`` to its port.
    each
        Called after every tick of the node (20 ms).
    """

    def __init__(
        self,
        streamed: StreamedVehicle,
        vehicle: Vehicle,
        clock: Clock,
        *,
        source: Shutter | None = None,
        recording: FlightRecording | None = None,
        each: Callable[[], None] = lambda: None,
    ) -> None:
        self.clock, self.streamed, self.each = clock, streamed, each
        host, _, port = vehicle.mavlink.link.partition(":")[2].rpartition(":")
        self._link = Counted(host, int(port), listen=False)
        self.node = Node(vehicle, link=self._link, source=source, clock=clock, recording=recording)
        self._source = source
        self._pictures: Iterator[Picture | None] = iter(())
        self._picture: Picture | None = None
        self._measured_ns = self._picture_ns = NEVER_NS
        self._tick_ns = self._plugs_ns = clock()
        self._heard = 0
        streamed.carry = self._carry

    def begin(self) -> None:
        """The node speaks first, and with that the flight begins."""
        self.node.wires.reopen()
        self.node.tick()
        self.streamed.begin()
        self._heard += 1
        self._hear()
        if self._source is not None:
            self._source.release(self.streamed.t0_ns)
            self._pictures = self._source.pictures()
            self._next_picture()

    def until(self, seconds: float) -> None:
        """Fly until that instant of the flight."""
        end_ns = self.streamed.t0_ns + round(seconds * 1e9)
        while (at_ns := self._next_ns()) <= end_ns:
            self.clock.now_ns = max(at_ns, self.clock.now_ns)
            self._turn()
        self.clock.now_ns = end_ns

    def close(self) -> None:
        """End the flight; counters are final after it."""
        self.node.close()
        self.streamed.close()

    def _next_ns(self) -> int:
        speak_ns = self.clock.now_ns + self.node.output.wait_ns()
        at_s = self.streamed.next_s()
        # rounded up: what is due at this instant has to be due when the vehicle is asked
        send_ns = NEVER_NS if at_s > 1e6 else self.streamed.t0_ns + round(at_s * 1e9) + 1
        return min(speak_ns, send_ns, self._tick_ns, self._plugs_ns, self._picture_ns, self._measured_ns)

    def _turn(self) -> None:
        now = self.clock.now_ns
        self.streamed.advance()
        if now >= self._picture_ns:
            self._take_picture()
        if now >= self._measured_ns:
            self._measure()
        if now >= self._plugs_ns:
            self._plugs_ns = now + round(REOPEN_S * 1e9)
            self.node.wires.reopen()
        ticked = now >= self._tick_ns
        if ticked:
            self._tick_ns = now + round(TICK_S * 1e9)
            self.node.tick()
        if self.node.output.wait_ns() == 0:
            self.node.output.step()
        self._hear()
        if ticked:
            self.each()

    # pictures -------------------------------------------------------------------------------------------------------

    def _next_picture(self) -> None:
        self._picture = next((p for p in self._pictures if p is not None), None)
        self._picture_ns = NEVER_NS if self._picture is None else self._picture.t_ns

    def _take_picture(self) -> None:
        assert self.node.grabber is not None
        assert self._picture is not None
        self.node.grabber.take(replace(self._picture, arrival_ns=self.clock()))
        if self._measured_ns == NEVER_NS:
            self._measured_ns = self.clock() + MEASURE_NS
        self._next_picture()

    def _measure(self) -> None:
        assert self.node.motion is not None
        assert self.node.grabber is not None
        self._measured_ns = NEVER_NS
        picture = self.node.grabber.mailbox.take(0.0)
        if picture is not None:
            self.node.motion.measure(picture)
            self.node.wires.step(0.0)

    # bytes ----------------------------------------------------------------------------------------------------------

    def _carry(self, name: str, data: bytes) -> None:
        """Send, wait until it is there, and have the node take it."""
        slave = self.streamed.slaves.get(name)
        before = 0 if slave is None else waiting(slave)
        self.streamed.send(name, data)
        if slave is None:
            assert select.select([self._link.fileno()], [], [], PATIENCE_S)[0]
        else:
            assert wait_for(lambda: waiting(slave) == before + len(data), PATIENCE_S, 1e-5)
        self.node.wires.step(0.0)
        if before > UNREAD and slave is not None:
            termios.tcflush(slave, termios.TCIFLUSH)  # nobody reads here, and a terminal holds no more than 4096 bytes

    def _hear(self) -> None:
        """Everything that the node has sent reaches the vehicle, answers included."""
        while self._heard < self._link.packets:
            self._heard += 1
            self.streamed.hear()


def waiting(terminal: int) -> int:
    """Bytes that can be read from a terminal."""
    count = array.array("i", [0])
    fcntl.ioctl(terminal, termios.FIONREAD, count)
    return count[0]
