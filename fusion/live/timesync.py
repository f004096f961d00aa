"""TIMESYNC both ways: our questions, whose answers set the clock, and answers to the autopilot's questions."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

from axialnav.fusion.live.clock import BootClock
from axialnav.fusion.live.dialect import Message, mavlink

FAST_NS, SLOW_NS = 100_000_000, 500_000_000
FAST_QUESTIONS = 50
OPEN_QUESTIONS = 32


class Timesync:
    """Keeps a :class:`~axialnav.fusion.live.clock.BootClock` set.

    Attributes
    ----------
    asked, answered, unasked
        Questions sent, answers to them, and answers to questions that were never sent.
    served
        Questions of the autopilot that were answered (PX4 asks ten times a second).
    """

    def __init__(self, clock: BootClock, send: Callable[[Message], bool], now: Callable[[], int]) -> None:
        self.asked = self.answered = self.unasked = self.served = 0
        self._clock, self._send, self._now = clock, send, now
        self._open: OrderedDict[int, None] = OrderedDict()
        self._next_ns = 0
        self._epoch = 0

    def ask(self) -> None:
        """Send a question if it is time for one: ten a second at first and after a reboot, then two."""
        now = self._now()
        if now < self._next_ns:
            return
        if self._clock.epoch != self._epoch:
            self._epoch, self.asked = self._clock.epoch, 0
        fast = self.asked < FAST_QUESTIONS or self._clock.in_doubt
        self._next_ns = now + (FAST_NS if fast else SLOW_NS)
        stamp = self._now()
        self._open[stamp] = None
        while len(self._open) > OPEN_QUESTIONS:
            self._open.popitem(last=False)
        if self._send(mavlink.MAVLink_timesync_message(0, stamp)):
            self.asked += 1

    def take(self, message: Message, arrival_ns: int) -> None:
        """Take a TIMESYNC message: answer it if it asks, learn from it if it answers."""
        if message.tc1 == 0:
            self._send(mavlink.MAVLink_timesync_message(arrival_ns, message.ts1))
            self.served += 1
        elif message.ts1 in self._open:
            del self._open[message.ts1]
            self.answered += 1
            self._clock.exchange(message.ts1, message.tc1, arrival_ns)
        else:
            self.unasked += 1
