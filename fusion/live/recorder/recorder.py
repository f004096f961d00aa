"""The flight recorder: takes everything at once and writes it behind the vehicle's back.

``write`` never waits for the disk.  When the disk is slow or full, pictures go first, everything else only when there
is no other way, and every loss is counted by channel and said: in :meth:`Recorder.status` and in the recording itself.
"""

from __future__ import annotations

import os
import struct
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from pathlib import Path

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder.limits import Limits, RecorderStatus
from axialnav.fusion.live.recorder.messages import DEFINITIONS, Encoder, Message, MessageEncoder
from axialnav.fusion.live.recorder.sink import CHUNK_BYTES, McapSink
from axialnav.fusion.readings import CameraFrame, Reading

METADATA = "axialnav"
LOG_CHANNEL = "recorder/log"
FLUSH_S = 1.0
POLL_S = 0.05
MESSAGE_COST = 400
CLOSED, FULL, NEARLY_FULL = "recorder closed", "disk full", "disk nearly full"
CONSEQUENCES = (CLOSED, FULL, NEARLY_FULL)  # of what has been said before, in more words


class Recorder:
    """Records to one MCAP file; use it as a context manager or call :meth:`close`.

    Parameters
    ----------
    path
        File to create.
    config
        What is mounted and where, so that the recording can be replayed by itself.
    about
        ``name``, ``source``, ``licence``, ``note`` of the flight.
    picture
        Compresses a camera frame; :class:`~axialnav.fusion.live.camera_codec.PictureEncoder` if None.
    limits
        Of memory and disk.
    free_bytes
        Tells the free space of the disk; asks the file system if None.

    Raises
    ------
    FlightError
        The file cannot be created.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        config: Config | None = None,
        about: Mapping[str, str] | None = None,
        picture: Encoder | None = None,
        limits: Limits | None = None,
        free_bytes: Callable[[], int] | None = None,
    ) -> None:
        self.path = Path(path)
        self._limits = limits or Limits()
        self._free_bytes = free_bytes or self._ask_file_system
        self._queue: deque[tuple[str, int, Message, int]] = deque()
        self._cost = self._picture_cost = 0
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._written: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._reasons: Counter[str] = Counter()
        self._unflushed: Counter[str] = Counter()
        self._recording = self._pictures = True
        self._problem = ""
        self._last_ns, self._flushed_ns = 0, -(2**62)
        self._encoder = MessageEncoder(picture or _default_pictures())
        try:
            self._sink = McapSink(self.path, "axialnav")
            self._sink.add_metadata(METADATA, {**(about or {}), **_described(config)})
        except OSError as error:
            reason = "exists already" if isinstance(error, FileExistsError) else error.strerror or str(error)
            raise FlightError(f"{self.path}: cannot be recorded to: {reason}; choose another file") from None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def write(self, channel: str, t_ns: int, message: Message) -> bool:
        """Hand over a message; False if it had to be given up at once.

        Parameters
        ----------
        channel
            Name of the channel; for readings the sensor's name, as in ``"imu0"``.
        t_ns
            When it arrived or was made, on the vehicle's clock [ns]; a reading's own stamp is kept beside it.
        message
            A reading, an :class:`~axialnav.fusion.outcome.AxialState`, an :class:`~axialnav.fusion.outcome.Outcome`,
            raw bytes, or text for people.
        """
        is_picture = isinstance(message, CameraFrame)
        cost = _cost(message)
        with self._lock:
            if self._stop.is_set():
                return self._give_up(channel, CLOSED)
            if is_picture and self._picture_cost + cost > self._limits.picture_queue:
                return self._give_up(channel, "disk too slow")
            if not is_picture and self._cost + cost > self._limits.queue:
                return self._give_up(channel, "disk too slow")
            self._queue.append((channel, t_ns, message, cost))
            if is_picture:
                self._picture_cost += cost
            else:
                self._cost += cost
        return True

    def status(self) -> RecorderStatus:
        """Counters so far."""
        with self._lock:
            return RecorderStatus(
                written=dict(self._written),
                dropped=dict(self._dropped),
                reasons=dict(self._reasons),
                bytes_written=self._sink.written_bytes,
                queued=len(self._queue),
                recording=self._recording,
                pictures=self._recording and self._pictures,
                problem=self._problem,
            )

    def close(self) -> RecorderStatus:
        """Write what waits, end the file, and say what became of everything; may be called twice."""
        with self._lock:
            self._stop.set()
        self._thread.join()
        return self.status()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _give_up(self, channel: str, reason: str) -> bool:
        """Count a loss; the lock is held."""
        self._dropped[channel] += 1
        self._reasons[reason] += 1
        if reason not in CONSEQUENCES:
            self._problem = reason
        return False

    def _lose(self, channel: str, reason: str) -> None:
        with self._lock:
            self._give_up(channel, reason)

    def _run(self) -> None:
        """The writing thread: takes what has come, keeps an eye on the disk, flushes once a second."""
        idle_s = 0.0
        while True:
            closing = self._stop.wait(POLL_S)
            with self._lock:
                batch, self._queue = self._queue, deque()
                self._cost = self._picture_cost = 0
            if closing and not batch:
                break
            self._look_at_disk()
            for channel, t_ns, message, _ in batch:
                self._store(channel, t_ns, message)
            idle_s = 0.0 if batch else idle_s + POLL_S
            if self._due() or idle_s > FLUSH_S:
                self._flush()
        self._finish()

    def _due(self) -> bool:
        return self._last_ns - self._flushed_ns > FLUSH_S * 1e9

    def _store(self, channel: str, t_ns: int, message: Message) -> None:
        if not self._recording:
            self._lose(channel, FULL)
        elif isinstance(message, CameraFrame) and not self._pictures:
            self._lose(channel, NEARLY_FULL)
        else:
            self._add(channel, t_ns, message)
            if self._sink.pending_bytes > CHUNK_BYTES:
                self._flush()

    def _add(self, channel: str, t_ns: int, message: Message) -> None:
        try:
            encoded = self._encoder.encode(channel, t_ns, message)
        except (ValueError, TypeError, OverflowError, struct.error) as error:
            self._lose(channel, f"not recordable: {error}")
            return
        stamp_ns = message.t_ns if isinstance(message, Reading) else t_ns
        for one in encoded:
            self._sink.add(one.topic, one.type, DEFINITIONS[one.type], one.data, log_ns=t_ns, publish_ns=stamp_ns)
        self._unflushed[channel] += 1
        self._last_ns = max(self._last_ns, t_ns)

    def _flush(self) -> None:
        pending, self._unflushed = self._unflushed, Counter()
        self._flushed_ns = self._last_ns
        try:
            self._sink.flush()
        except OSError as error:
            with self._lock:
                self._dropped.update(pending)
                self._reasons[f"disk: {error.strerror or error}"] += sum(pending.values())
                self._recording, self._problem = False, f"disk: {error.strerror or error}"
            return
        with self._lock:
            self._written.update(pending)

    def _look_at_disk(self) -> None:
        """Stop pictures, then everything, before the disk is full; go on when a quarter more is free again."""
        free = self._free_bytes()
        for what, reserve in (("_recording", self._limits.reserve), ("_pictures", self._limits.picture_reserve)):
            on = getattr(self, what)
            if on and free < reserve:
                self._switch(what, False, f"{free >> 20} MiB free, {reserve >> 20} MiB are kept")
            elif not on and free > 1.25 * reserve:
                self._switch(what, True, f"{free >> 20} MiB free again")

    def _switch(self, what: str, on: bool, why: str) -> None:
        text = f"{'pictures' if what == '_pictures' else 'recording'} {'resumed' if on else 'stopped'}: {why}"
        with self._lock:
            setattr(self, what, on)
            self._problem = text
        if self._recording or not on:
            self._add(LOG_CHANNEL, self._last_ns, text)

    def _finish(self) -> None:
        dropped = sum(self._dropped.values())
        if dropped and self._recording:
            reasons = ", ".join(f"{reason}: {count}" for reason, count in sorted(self._reasons.items()))
            self._add(LOG_CHANNEL, self._last_ns, f"{dropped} messages were given up: {reasons}")
        self._flush()
        try:
            self._sink.finish()
        except OSError as error:
            with self._lock:
                self._problem = f"disk: {error.strerror or error}"

    def _ask_file_system(self) -> int:
        try:
            stat = os.statvfs(self.path.parent)
        except OSError:
            return 0
        return stat.f_bavail * stat.f_frsize


def _cost(message: Message) -> int:
    """Bytes that a waiting message keeps, roughly."""
    if isinstance(message, CameraFrame):
        return int(message.image.nbytes)
    return MESSAGE_COST + (len(message) if isinstance(message, bytes | str) else 0)


def _described(config: Config | None) -> dict[str, str]:
    return {} if config is None else {"config": config.to_toml()}


def _default_pictures() -> Encoder:
    """Loads OpenCV only when the first frame comes."""
    encoders: list[Encoder] = []

    def encode(frame: CameraFrame) -> tuple[str, bytes]:
        """Format and bytes of a picture."""
        if not encoders:
            from axialnav.fusion.live.camera_codec import PictureEncoder

            encoders.append(PictureEncoder())
        return encoders[0](frame)

    return encode
