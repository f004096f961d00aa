"""All wires in one thread: it sleeps until something arrives, on whichever wire, and takes it to the filter at once.

A thread per wire and one more for the filter would wake each other up for every one of some 400 readings a second,
which costs more than all that is done with them.
"""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable
from typing import Protocol

IDLE_S = 0.1
REOPEN_S = 0.05


class Wire(Protocol):
    """What the loop needs of a wire."""

    def fileno(self) -> int | None:
        """File to wait for; None while the wire is away."""

    def ready(self) -> None:
        """Something has arrived: take it, without waiting for more."""

    def reopen(self) -> None:
        """Bring the wire back if it is away and the time has come to try; may take long."""


class Wires:
    """Waits for several wires, and for :meth:`wake`.

    Parameters
    ----------
    wires
        What to wait for.
    woken
        Called after every wake-up, whatever its reason.

    Attributes
    ----------
    all
        The wires.
    """

    def __init__(self, wires: list[Wire], woken: Callable[[], None]) -> None:
        self.all, self._woken = wires, woken
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def wake(self) -> None:
        """Have the loop look at what other threads have put into its ways; from any thread."""
        os.eventfd_write(self._bell, 1)

    def run(self, stop: threading.Event) -> None:
        """Take what arrives until told to stop; the body of the thread that owns the filter."""
        while not stop.is_set():
            self.step(IDLE_S)

    def step(self, timeout_s: float) -> None:
        """Wait once, at most ``timeout_s``, and take everything that has arrived."""
        files = {file: wire for wire in self.all if (file := wire.fileno()) is not None}
        try:
            ready, _, _ = select.select([self._bell, *files], [], [], timeout_s)
        except (OSError, ValueError):
            return  # a wire was closed by a thread that could not send on it
        for file in ready:
            if file == self._bell:
                os.eventfd_read(self._bell)
            else:
                files[file].ready()
        self._woken()

    def keep_open(self, stop: threading.Event) -> None:
        """Bring back what has gone away until told to stop; the body of a thread, because opening may hang."""
        while not stop.is_set():
            self.reopen()
            stop.wait(REOPEN_S)

    def reopen(self) -> None:
        """Bring back what has gone away, once."""
        for wire in self.all:
            wire.reopen()

    def close(self) -> None:
        """Release the bell; no thread may be in :meth:`run` any more."""
        os.close(self._bell)
