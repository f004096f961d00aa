"""The streamed vehicle in a process of its own, so that its work is not taken for the node's."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from tests.fusion.live.streamed import Air, Course, StreamedVehicle

PATIENCE_S = 300.0


@dataclass(frozen=True)
class Told:
    """What the vehicle says in the end: packets by kind, what its autopilot used and refused, odometry as received."""

    sent: Counter[str]
    dropped: Counter[str]
    used: int
    refused: Counter[str]
    odometry: np.ndarray


class SenderProcess:
    """Streams the course that ``make`` gives; it begins as soon as the node is heard.

    Attributes
    ----------
    port, ttys
        Where it listens, and serial devices by sensor.
    """

    def __init__(self, make: Callable[[], Course], air: Air | None = None, udp_port: int = 0) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would inherit threads and compiled code half done
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_stream, args=(theirs, make, air or Air(), udp_port), daemon=True)
        self._process.start()
        theirs.close()
        self.port, self.ttys = self._ask()

    def wait_for_start(self) -> int:
        """Instant at which the flight began, on the monotonic clock [ns]; the node has to be running."""
        (t0_ns,) = self._ask()
        return t0_ns

    def finish(self) -> Told:
        """Stop streaming and hear the account."""
        self._pipe.send("stop")
        (told,) = self._ask()
        self._process.join(PATIENCE_S)
        return told

    def kill(self) -> None:
        """End the process as a crash would."""
        self._process.kill()
        self._process.join(PATIENCE_S)

    def _ask(self) -> tuple:  # type: ignore[type-arg]
        if not self._pipe.poll(PATIENCE_S):
            raise TimeoutError("the sender does not answer")
        return self._pipe.recv()


def _stream(pipe: Connection, make: Callable[[], Course], air: Air, udp_port: int) -> None:
    streamed = StreamedVehicle(make(), air, udp_port=udp_port)
    pipe.send((streamed.port, streamed.ttys))
    streamed.start()
    pipe.send((streamed.t0_ns,))
    pipe.recv()
    streamed.close()
    contract = streamed.contract
    told = Told(streamed.sent, streamed.dropped, contract.used("ODOMETRY"), contract.refused(), streamed.odometry())
    pipe.send((told,))
