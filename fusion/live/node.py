"""The node: one thread for all wires and the filter, one to speak, two for the camera; bounded ways between them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

from axialnav.fusion.live.autopilot import Autopilot
from axialnav.fusion.live.camera import Grabber, MotionStage
from axialnav.fusion.live.camera_source import Picture, Source
from axialnav.fusion.live.core import FilterCore
from axialnav.fusion.live.latency import Latency
from axialnav.fusion.live.mailbox import BoundedQueue
from axialnav.fusion.live.nooploop_stage import NooploopStage
from axialnav.fusion.live.output import SENDING, Output
from axialnav.fusion.live.receiver import Receiver
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.security import read_key
from axialnav.fusion.live.sender import Sender
from axialnav.fusion.live.status import StatusServer, status_line
from axialnav.fusion.live.transport import Address, Link, open_link
from axialnav.fusion.live.vehicle import Vehicle
from axialnav.fusion.live.wires import Wires
from axialnav.fusion.outcome import Outcome, Verdict
from axialnav.fusion.readings import PixelMotion, Reading

CAPACITY = 64  # motions: two seconds
TICK_S = 0.02
WORD_NS = 500_000_000
THREAD_CLOCK = 6  # Linux: processor time of a thread by its number; by its handle would crash where it has just ended
JOIN_S = 2.0


class Seen(NamedTuple):
    """Image motion on its way to the filter, and when it was measured and its last picture had come [ns]."""

    motion: PixelMotion
    measured_ns: int
    picture_ns: int


class MavlinkWire:
    """The link to the autopilot as one of the wires."""

    def __init__(self, link: Link, take: Callable[[bytes, Address | None], None]) -> None:
        self._link, self._take = link, take
        self.fileno, self.reopen = link.fileno, link.reopen

    def ready(self) -> None:
        """Take the next datagram: most come alone, and the loop is back at once for another."""
        data, address = self._link.receive()
        if data:
            self._take(data, address)


class Node:
    """Everything between the wires of one vehicle.

    Parameters
    ----------
    vehicle
        What to do.
    link, source
        The link to the autopilot and the camera; opened from ``vehicle`` if not given.
    clock
        The one monotonic clock [ns].
    say
        Takes lines for a person.
    recording
        Records the flight; None: nothing is recorded.

    Attributes
    ----------
    wires, output, grabber, motion
        What the threads run, for who turns the node by hand on a clock of his own (with :meth:`tick`).

    Raises
    ------
    ConfigError
        A port, key or camera cannot be used.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        link: Link | None = None,
        source: Source | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
        say: Callable[[str], None] = lambda _: None,
        recording: FlightRecording | None = None,
    ) -> None:
        key = read_key(vehicle.mavlink.key_file) if vehicle.mavlink.key_file else None
        self.stop = threading.Event()
        self.failure: str = ""
        self.latency = {"queue": Latency(), "filter": Latency()}
        self._vehicle, self._clock, self._say, self._recording = vehicle, clock, say, recording
        self._queue: BoundedQueue[Seen] = BoundedQueue(CAPACITY)
        self._threads: list[threading.Thread] = []
        self._spent_s: dict[str, float] = {}  # processor time of threads that have ended
        self._next_line_ns: int | None = None
        self._next_word_ns = 0
        self._sentence = ""
        self._receiver = Receiver(vehicle.mavlink.allow, key=key)
        self._link = link or open_link(vehicle.mavlink.link)
        self._sender = Sender(
            self._link,
            system=vehicle.mavlink.system,
            component=vehicle.mavlink.component,
            signatures=self._receiver.signatures,
            tap=recording.sent if recording else None,
        )
        self.autopilot = Autopilot(vehicle, self._sender.send, clock, self._restart)
        self.core = FilterCore(self.autopilot.input.filter_config, vehicle.estimator, recording)
        tell = recording.state if recording else None
        self.output = Output(vehicle, self.core.snapshot, self._sender.send, clock, self.autopilot.check, tell)
        hear = recording.heard if recording else None
        self._lines = [NooploopStage(line, self._deliver, clock, hear) for line in vehicle.nooploop]
        self.grabber: Grabber | None = None
        self.motion: MotionStage | None = None
        if vehicle.camera is not None and source is not None:
            self._add_camera(vehicle.camera.sensor, source)
        self.wires = Wires([MavlinkWire(self._link, self._receive), *self._lines], self._take_motions)
        self._server = StatusServer(vehicle.status.port, self.status) if vehicle.status.port else None

    def _add_camera(self, sensor: str, source: Source) -> None:
        config = self._vehicle.filter
        self.grabber = Grabber(source, config.sensor[sensor].rate_hz)
        see, miss = self._recording.frame if self._recording else None, self.output.frame_done
        self.motion = MotionStage(config, sensor, self.grabber.mailbox, self._deliver_motion, self._clock, see, miss)

    def start(self) -> None:
        """Start every thread."""
        bodies: dict[str, Callable[[threading.Event], None]] = {
            "wires": self.wires.run,
            "plugs": self.wires.keep_open,
            "output": self.output.run,
            "tick": self._keep_ticking,
        }
        if self.grabber is not None and self.motion is not None:
            bodies |= {"camera": self.grabber.run, "motion": self.motion.run}
        if self._server is not None:
            bodies["status"] = self._server.run
        for name, body in bodies.items():
            thread = threading.Thread(target=self._guarded, args=(name, body), name=name, daemon=True)
            self._threads.append(thread)
            thread.start()

    def run(self) -> str:
        """Run until :attr:`stop` is set or a thread fails; empty, or what failed."""
        self.start()
        while not self.stop.wait(0.2):
            pass
        self.close()
        return self.failure

    def close(self) -> None:
        """Stop every thread and release every port; what hangs in a driver is left behind."""
        self.stop.set()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(JOIN_S)
        self._link.close()
        for line in self._lines:
            line.close()
        if self._recording is not None:
            self._recording.close()

    def status(self) -> dict[str, Any]:
        """Everything that is counted, and the state; plain data."""
        now = self._clock()
        state = None
        snapshot = self.core.snapshot(now)
        if snapshot is not None:
            s = snapshot.state
            state = {
                "axial_position_m": s.axial_position_m,
                "axial_velocity_m_s": s.axial_velocity_m_s,
                "sigma_axial_position_m": s.sigma_axial_position_m,
                "sigma_axial_velocity_m_s": s.sigma_axial_velocity_m_s,
                "position_m": s.position_m.tolist(),
                "velocity_m_s": s.velocity_m_s.tolist(),
                "flags": [flag.name for flag in type(s.flags) if flag and flag in s.flags],
                "imu_age_ms": (now - snapshot.imu_ns) * 1e-6,
            }
        return {
            "state": state,
            "sentence": self._sentence,
            "advice": dict([self.autopilot.advice]),
            "output": self._output_status(now),
            "autopilot": self.autopilot.status(now),
            "link": {
                "counts": self._receiver.all_counts(),
                "lost": {f"{s}/{c}": n for (s, c), n in self._receiver.lost().items()},
                "sent": dict(self._sender.counts),
                "unsent": self._link.unsent,
            },
            "filter": self._filter_status(now),
            "camera": self._camera_status(),
            "recording": self._recording.status() if self._recording else None,
            "nooploop": {
                line.device: stage.status() for line, stage in zip(self._vehicle.nooploop, self._lines, strict=True)
            },
            "processor_s": self._processor_s(),
            "latency": {name: histogram.summary() for name, histogram in self._histograms().items()},
        }

    def _output_status(self, now_ns: int) -> dict[str, Any]:
        out = self.output
        return {
            "reason": out.reason,
            "sent": out.sent,
            "age_ms": None if out.sent_ns is None else (now_ns - out.sent_ns) * 1e-6,
            "withheld": dict(out.withheld),
            "reset_counter": out.reset_counter,
        }

    def _filter_status(self, now_ns: int) -> dict[str, Any]:
        verdicts: dict[str, dict[str, int]] = {}
        for (sensor, verdict), count in list(self.core.verdicts.items()):
            verdicts.setdefault(sensor, {})[verdict] = count
        return {
            "verdicts": verdicts,
            "refused": dict(self.core.refused),
            "restarts": dict(self.core.restarts),
            "began_ns": self.core.began_ns,
            "silent": self.core.silent(now_ns),
            "waiting": len(self._queue),
            "dropped": self._queue.dropped,
        }

    def _camera_status(self) -> dict[str, Any] | None:
        grabber, motion = self.grabber, self.motion
        if grabber is None or motion is None:
            return None
        counts = dict.fromkeys((*Grabber.COUNTED, *MotionStage.COUNTED), 0) | grabber.counts
        counts |= {**motion.counts, "overwritten": grabber.mailbox.dropped, "waiting": len(grabber.mailbox)}
        return {**counts, "rate_hz": grabber.rate_hz, "reconnected": grabber.reconnected, "ended": grabber.ended}

    def _processor_s(self) -> dict[str, float]:
        """Processor time of each thread so far [s]."""
        spent = dict(self._spent_s)
        for thread in self._threads:
            if thread.name not in spent and thread.native_id is not None:
                with suppress(OSError):  # it ended just now, and its clock with it
                    spent[thread.name] = time.clock_gettime(~thread.native_id << 3 | THREAD_CLOCK)
        return {name: round(seconds, 3) for name, seconds in spent.items()}

    def _histograms(self) -> dict[str, Latency]:
        camera = {"camera": self.motion.latency} if self.motion is not None else {}
        return {**self.latency, **camera, **self.output.latency}

    def _guarded(self, name: str, body: Callable[[threading.Event], None]) -> None:
        """A thread that fails takes the node down: half a node must not look alive."""
        try:
            body(self.stop)
        except Exception as error:  # whatever it is, the autopilot must not be fed by what is left
            self.failure = self.failure or f"thread {name}: {type(error).__name__}: {error}"
            self.stop.set()
        finally:
            self._spent_s[name] = time.thread_time()

    def _receive(self, data: bytes, address: Address | None) -> None:
        arrival_ns = self._clock()
        if self._recording is not None:
            self._recording.heard("mavlink_in", data, arrival_ns)
        messages = self._receiver.feed(data, arrival_ns)
        if messages:
            self._link.confirm(address)
        for message in messages:
            reading = self.autopilot.take(message, arrival_ns)
            if reading is not None:
                self._deliver(reading, arrival_ns)

    def _deliver(self, reading: Reading, arrival_ns: int) -> Outcome | None:
        """Take a reading to the filter; from the thread of the wires only."""
        began_ns = self._clock()
        self.latency["queue"].add((began_ns - arrival_ns) * 1e-9)
        outcome = self.core.push(reading, arrival_ns)
        self.latency["filter"].add((self._clock() - began_ns) * 1e-9)
        return outcome

    def _deliver_motion(self, motion: PixelMotion, picture: Picture) -> None:
        self._queue.put(Seen(motion, self._clock(), picture.arrival_ns))
        self.wires.wake()

    def _take_motions(self) -> None:
        while len(self._queue):
            seen = self._queue.take(0.0)
            if seen is None:
                return
            outcome = self._deliver(seen.motion, seen.measured_ns)
            fused = outcome is not None and outcome.verdict is Verdict.FUSED
            self.output.frame_done(seen.picture_ns if fused else None)

    def _restart(self, reason: str) -> None:
        self.core.restart(reason, self._clock())

    def _keep_ticking(self, stop: threading.Event) -> None:
        while not stop.wait(TICK_S):
            self.tick()

    def tick(self) -> None:
        """Everything that has its own rhythm: heartbeat, questions, what a person is told."""
        now = self._clock()
        self.autopilot.tick(now)
        if now >= self._next_word_ns:
            self._next_word_ns = now + WORD_NS
            self._judge(now)
        line_ns = round(self._vehicle.status.line_s * 1e9)
        due_ns, self._next_line_ns = self._next_line_ns, self._next_line_ns or now + line_ns
        if line_ns and due_ns is not None and now >= due_ns:
            self._next_line_ns = now + line_ns
            self._say(status_line(self.status()))

    def _judge(self, now_ns: int) -> None:
        out = self.output
        bad = self._receiver.counts["bad_signature"]
        before = self._sentence
        sending = out.reason == SENDING
        self._sentence = self.autopilot.sentence(now_ns, sending=sending, why_not=out.reason, bad_signatures=bad)
        if self._sentence != before:
            name, value = self.autopilot.advice
            self._say(f"{self._sentence} (set {name} to {value})" if sending else self._sentence)
