"""The camera on board: a thread that grabs, a slot for one picture, a thread that measures motion."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable

from axialnav.estimators.errors import FrameError
from axialnav.fusion.camera_feed import CameraFeed
from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, ReadingError
from axialnav.fusion.live.camera_source import Picture, Source
from axialnav.fusion.live.latency import Latency
from axialnav.fusion.live.mailbox import Mailbox
from axialnav.fusion.readings import CameraFrame, PixelMotion

GAP = 1.5  # periods
READ_PAUSE_S = 0.05


class Grabber:
    """Takes pictures off the source and keeps the newest.

    Attributes
    ----------
    counts
        ``pictures``, ``unread`` (the driver gave none), ``repeated`` (same stamp again), ``backwards``, ``gaps`` and
        ``missing`` (periods without a picture).
    """

    COUNTED = ("pictures", "unread", "repeated", "backwards", "gaps", "missing")

    def __init__(self, source: Source, rate_hz: float | None) -> None:
        self.counts: Counter[str] = Counter()
        self.mailbox: Mailbox[Picture] = Mailbox()
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.ended = False
        self.shortest_ns, self.longest_ns = 2**62, 0
        self._source = source
        self._period_ns = 1e9 / rate_hz if rate_hz else math.inf

    def run(self, stop: threading.Event) -> None:
        """Grab until told to stop or the recording ends; the body of the camera thread."""
        try:
            for picture in self._source.pictures():
                if stop.is_set():
                    return
                self.take(picture)
                if picture is None:
                    stop.wait(READ_PAUSE_S)
        finally:
            self.ended = True
            self._source.close()

    def take(self, picture: Picture | None) -> None:
        """Keep a picture, or count that there was none."""
        if picture is None:
            self.counts["unread"] += 1
        elif self._is_next(picture.t_ns):
            self.counts["pictures"] += 1
            self.mailbox.put(picture)

    @property
    def reconnected(self) -> int:
        """How often the camera had gone away and came back."""
        return self._source.reconnected

    @property
    def rate_hz(self) -> float | None:
        """Mean rate of the pictures so far [Hz]."""
        if self.first_ns is None or self.last_ns is None or self.last_ns == self.first_ns:
            return None
        return (self.counts["pictures"] - 1) / ((self.last_ns - self.first_ns) * 1e-9)

    def _is_next(self, t_ns: int) -> bool:
        """Whether a stamp moves on; a camera that hangs repeats its last one."""
        if self.last_ns is None:
            self.first_ns = self.last_ns = t_ns
            return True
        step = t_ns - self.last_ns
        if step <= 0:
            self.counts["repeated" if step == 0 else "backwards"] += 1
            return False
        self.last_ns = t_ns
        self.shortest_ns, self.longest_ns = min(self.shortest_ns, step), max(self.longest_ns, step)
        if math.isinf(self._period_ns):
            self._period_ns = float(step)
        if step > GAP * self._period_ns:
            self.counts["gaps"] += 1
            self.counts["missing"] += round(step / self._period_ns) - 1
        return True


class MotionStage:
    """Turns pictures into pixel motion, in a thread of its own so that the filter never waits for one.

    Attributes
    ----------
    counts
        ``measured``, ``refused`` (no motion to be believed) and ``unusable`` pictures.

    Notes
    -----
    ``deliver`` takes the motion and its last picture, ``miss`` is called when there is none; ``see`` gets every frame.
    """

    COUNTED = ("measured", "refused", "unusable")

    def __init__(
        self,
        config: Config,
        sensor: str,
        mailbox: Mailbox[Picture],
        deliver: Callable[[PixelMotion, Picture], None],
        clock: Callable[[], int],
        see: Callable[[CameraFrame, int], None] | None = None,
        miss: Callable[[], None] = lambda: None,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.latency = Latency()
        self._miss = miss
        self._config, self._sensor, self._mailbox = config, sensor, mailbox
        self._deliver, self._clock, self._see = deliver, clock, see
        self._feed = CameraFeed(config)

    def run(self, stop: threading.Event) -> None:
        """Measure until told to stop; the body of the motion thread."""
        while not stop.is_set():
            picture = self._mailbox.take(0.1)
            if picture is not None:
                self.measure(picture)

    def measure(self, picture: Picture) -> None:
        """Measure with one more picture and deliver what comes of it."""
        motion = None
        try:
            frame = CameraFrame(
                t_ns=picture.t_ns, sensor=self._sensor, image=picture.image, exposure_s=picture.exposure_s
            )
            if self._see is not None:
                self._see(frame, picture.arrival_ns)
            motion = self._feed.push(frame)
        except (FrameError, ReadingError):
            self.counts["unusable"] += 1
            self._feed = CameraFeed(self._config)  # another size, or a clock that was set: begin again
            return
        finally:
            self.latency.add((self._clock() - picture.arrival_ns) * 1e-9)
        self.counts["refused" if motion is None else "measured"] += 1
        if motion is not None:
            self._deliver(motion, picture)
        else:
            self._miss()


def require_surface(config: Config, sensor: str) -> None:
    """Refuse a camera that looks at nothing described.

    Raises
    ------
    ConfigError
        The camera names no surface.
    """
    if getattr(config.sensor[sensor], "surface", None) is None:
        raise ConfigError(
            f"filter.sensor.{sensor} names no surface, so that its pictures cannot be fused; describe the wall as "
            f"[filter.surface.NAME] and set surface"
        )
