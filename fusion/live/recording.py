"""The flight recorder on board: one file for every life of the filter, so that each replays to the same digest."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.live.dialect import Message
from axialnav.fusion.live.recorder.limits import Limits
from axialnav.fusion.live.recorder.recorder import Recorder
from axialnav.fusion.outcome import AxialState, Outcome, Verdict
from axialnav.fusion.readings import CameraFrame, ImuSample, Reading

MAX_FILES = 10_000


class FlightRecording:
    """Records what goes into the filter, what it says, and every byte on the wires.

    Parameters
    ----------
    folder
        Where files are made: ``flight_0001.mcap`` and so on, the next free number.
    frames
        Whether pictures are recorded.
    clock
        The one monotonic clock [ns].
    limits
        Of memory and disk; those of :class:`~axialnav.fusion.live.recorder.recorder.Recorder` if None.

    Attributes
    ----------
    problem
        Why nothing is recorded, in words; empty if all is well.

    Raises
    ------
    ConfigError
        The folder cannot be made.
    """

    def __init__(self, folder: Path, frames: bool, clock: Callable[[], int], limits: Limits | None = None) -> None:
        self.problem = ""
        self._folder, self._frames, self._clock, self._limits = folder, frames, clock, limits
        self._recorder: Recorder | None = None
        self._ended: Recorder | None = None
        self._closing: list[threading.Thread] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"record.folder {folder}: cannot be made: {error.strerror}") from None

    def restarted(self, config: Config) -> None:
        """End the file, behind the filter's back, and begin the next with the configuration of the new filter."""
        self._end()
        try:
            about = {"source": "axialnav live"}
            self._recorder = Recorder(self._next_path(), config=config, about=about, limits=self._limits)
            self.problem = ""
        except FlightError as error:
            self.problem = str(error)  # flying goes on without a recording

    def pushed(self, reading: Reading, outcome: Outcome, arrival_ns: int) -> None:
        """Record a reading and what became of it; of inertial samples only that they came too late."""
        self._write(reading.sensor, arrival_ns, reading)
        if outcome.verdict is Verdict.LATE or not isinstance(reading, ImuSample):
            self._write(f"{reading.sensor}/outcome", arrival_ns, outcome)

    def frame(self, frame: CameraFrame, arrival_ns: int) -> None:
        """Record a picture."""
        if self._frames:
            self._write(f"{frame.sensor}/picture", arrival_ns, frame)

    def heard(self, name: str, data: bytes, arrival_ns: int) -> None:
        """Record bytes that came in on a wire."""
        self._write(f"wire/{name.strip('/')}", arrival_ns, data)

    def sent(self, message: Message) -> None:
        """Record a message that went out."""
        self._write("wire/mavlink_out", self._clock(), bytes(message.get_msgbuf()))

    def state(self, state: AxialState) -> None:
        """Record a state that was sent."""
        self._write("state", state.t_ns, state)

    def status(self) -> dict[str, Any]:
        """Counters of the file that is being written, or of the last one."""
        counters: dict[str, Any] = {}
        recorder = self._recorder or self._ended
        if recorder is not None:
            counters = {"file": str(recorder.path), **msgspec.to_builtins(recorder.status())}
        if self.problem:
            counters["problem"] = self.problem
        return counters

    def close(self) -> None:
        """Write what waits and end the file."""
        self._end()
        for thread in self._closing:
            thread.join()

    def _write(self, channel: str, t_ns: int, message: Reading | AxialState | Outcome | bytes) -> None:
        recorder = self._recorder
        if recorder is not None:
            recorder.write(channel, t_ns, message)

    def _end(self) -> None:
        if self._recorder is None:
            return
        thread = threading.Thread(target=self._recorder.close, name="recorder-close")
        self._recorder, self._ended = None, self._recorder
        self._closing = [t for t in self._closing if t.is_alive()] + [thread]
        thread.start()

    def _next_path(self) -> Path:
        for number in range(1, MAX_FILES):
            path = self._folder / f"flight_{number:04d}.mcap"
            if not path.exists():
                return path
        raise FlightError(f"{self._folder}: holds {MAX_FILES - 1} recordings; move them away")
