"""Pictures with honest stamps from a V4L2 camera, a video file or a folder: one interface, one clock.

V4L2 stamps its buffers with the monotonic clock when the exposure starts (UVC) or when the frame ends (most MIPI
drivers); the stamp is taken from there and not from the moment of reading, which is 30 to 130 ms later and jitters.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.vehicle import CameraInput
from axialnav.models.rig import Camera

Image = NDArray[np.generic]
PICTURES = {".png", ".jpg", ".jpeg", ".pgm", ".bmp", ".tif", ".tiff"}
EXPOSURE_UNIT_S = 1e-4
MANUAL = 1.0
EXPOSURE_TOLERANCE = 0.1  # sensors round to whole lines
SETTLING_FRAMES = 5  # settings take effect some frames later
PLAUSIBLE_S = 1.0
GONE_NS = 1_000_000_000  # without a picture for longer, the device is opened anew


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture: middle of its exposure and time of arrival [ns], exposure [s] if it is known."""

    t_ns: int
    arrival_ns: int
    image: Image
    exposure_s: float | None


@dataclass(frozen=True, slots=True)
class Setting:
    """One thing that was set, and what the driver says it is now."""

    name: str
    wanted: str
    got: str
    good: bool


class Source(Protocol):
    """Where pictures come from; ``reconnected`` counts how often the device had gone and came back."""

    settings: list[Setting]
    stamps_by_arrival: int
    reconnected: int

    def pictures(self) -> Iterator[Picture | None]:
        """Pictures as they come; None where one could not be read."""

    def close(self) -> None:
        """Release the camera."""


def settle_opencv() -> None:
    """Have OpenCV work in the thread that calls it and keep its warnings to itself, in this whole process.

    It would hand half of every small step to another thread and wait for it: a sixth more processor time on board, and
    late pictures where that thread has to wait for its turn.  What goes wrong is said in one line of ours.
    """
    cv2.setNumThreads(1)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)


def require_source(camera: CameraInput) -> None:
    """Refuse a source that is not there, before anything that takes long.

    Raises
    ------
    ConfigError
        Nothing has that name, or it is not for us.
    """
    try:
        os.close(os.open(camera.source, os.O_RDONLY | os.O_NONBLOCK))
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"camera.source {camera.source}: {getattr(error, 'strerror', error)}; is the camera plugged in? "
            f"`ls /dev/v4l/by-id` shows what is; devices are for the group video"
        ) from None


def open_source(
    camera: CameraInput, spec: Camera, clock: Callable[[], int], sleep: Callable[[float], None] = time.sleep
) -> Source:
    """Open what ``camera.source`` names: ``/dev/videoN``, a folder or a video file.

    Raises
    ------
    ConfigError
        Nothing is there, it cannot be opened, or the camera will not take the settings.
    """
    path = Path(camera.source)
    if camera.source.startswith("/dev/"):
        return V4l2Source(lambda: cv2.VideoCapture(camera.source, cv2.CAP_V4L2), camera, spec, clock)
    if path.is_dir():
        return FolderSource(path, camera, spec, clock, sleep)
    if path.is_file():
        return VideoSource(path, camera, spec, clock, sleep)
    raise ConfigError(f"camera.source {camera.source}: neither a device nor a file nor a folder; check the path")


class V4l2Source:
    """A camera through OpenCV's V4L2 backend, its exposure locked and read back; opened anew after it has gone away.

    ``connect`` gives a new ``cv2.VideoCapture``, opened if there is a camera.

    Raises
    ------
    ConfigError
        No camera is there, or it does not do what it was told: picture size, or exposure where one is asked for.
    """

    def __init__(self, connect: Callable[[], Any], camera: CameraInput, spec: Camera, clock: Callable[[], int]) -> None:
        self.settings: list[Setting] = []
        self.stamps_by_arrival = 0
        self.reconnected = 0
        self._connect, self._camera, self._spec, self._clock = connect, camera, spec, clock
        self._readout_s = spec.readout_s or 0.0
        self._exposure_s: float | None = None
        self._open()

    def _open(self) -> None:
        self._capture = self._connect()
        if not self._capture.isOpened():
            raise ConfigError(f"camera.source {self._camera.source}: no camera there, or another program has it")
        self.settings = []
        try:
            self._configure(self._spec)
        except ConfigError:
            self._capture.release()
            raise

    def _configure(self, spec: Camera) -> None:
        camera = self._camera
        if camera.fourcc is not None:
            code = cv2.VideoWriter.fourcc(*camera.fourcc)
            self._set("pixel format", cv2.CAP_PROP_FOURCC, code, must=False)
        width, height = spec.resolution
        taken = [self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)]  # takes effect with the height, not before
        taken.append(self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height))
        self._compare("width", cv2.CAP_PROP_FRAME_WIDTH, width, taken=all(taken), must=True)
        self._compare("height", cv2.CAP_PROP_FRAME_HEIGHT, height, taken=all(taken), must=True)
        if spec.rate_hz:
            self._set("rate [Hz]", cv2.CAP_PROP_FPS, spec.rate_hz, must=False)
        self._set("buffers", cv2.CAP_PROP_BUFFERSIZE, 2, must=False)
        if camera.gain is not None:
            self._set("gain", cv2.CAP_PROP_GAIN, camera.gain, must=False)
        if camera.exposure_s is None:
            self.settings.append(Setting("exposure [s]", "automatic", "not known", good=False))
            return
        self._set("manual exposure", cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL, must=True)
        wanted = camera.exposure_s / EXPOSURE_UNIT_S
        got = self._set("exposure [0.1 ms]", cv2.CAP_PROP_EXPOSURE, wanted, must=True, tolerance=EXPOSURE_TOLERANCE)
        self._exposure_s = got * EXPOSURE_UNIT_S

    def _set(self, name: str, key: int, wanted: float, *, must: bool, tolerance: float = 0.0) -> float:
        return self._compare(name, key, wanted, taken=self._capture.set(key, wanted), must=must, tolerance=tolerance)

    def _compare(self, name: str, key: int, wanted: float, *, taken: bool, must: bool, tolerance: float = 0.0) -> float:
        """What the driver says it is set to."""
        got = float(self._capture.get(key))
        good = taken and abs(got - wanted) <= tolerance * abs(wanted) + 1e-6
        self.settings.append(Setting(name, f"{wanted:g}", f"{got:g}", good))
        if must and not good:
            raise ConfigError(
                f"camera {self._camera.source}: {name} was set to {wanted:g}, the driver says {got:g}; "
                f"`v4l2-ctl --list-ctrls-menus --list-formats-ext` shows what it can do"
            )
        return got

    def pictures(self) -> Iterator[Picture | None]:
        """Pictures for ever, after the first few, which are taken before the settings have settled."""
        number, seen_ns = 0, self._clock()
        while True:
            picture = self._read()
            if picture is not None:
                number, seen_ns = number + 1, picture.arrival_ns
                if number > SETTLING_FRAMES:
                    yield picture
                continue
            if self._clock() - seen_ns > GONE_NS:
                number = 0 if self._reopen() else number
                seen_ns = self._clock()
            yield None

    def _read(self) -> Picture | None:
        try:
            if not self._capture.grab():
                return None
            arrival = self._clock()
            stamp_ns = self._stamp(arrival)
            good, image = self._capture.retrieve()
        except cv2.error:  # OpenCV checks what the driver says, and some drivers say strange things
            return None
        return Picture(self._middle(stamp_ns), arrival, np.asarray(image), self._exposure_s) if good else None

    def _reopen(self) -> bool:
        self._capture.release()
        try:
            self._open()
        except ConfigError:
            return False  # not there yet, or not ready to take its settings
        self.reconnected += 1
        return True

    def _stamp(self, arrival_ns: int) -> int:
        stamp_ns = round(float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) * 1e6)
        if 0 <= arrival_ns - stamp_ns < PLAUSIBLE_S * 1e9:
            return stamp_ns
        self.stamps_by_arrival += 1
        return arrival_ns

    def _middle(self, stamp_ns: int) -> int:
        half = round(0.5e9 * ((self._exposure_s or 0.0) + self._readout_s))
        return stamp_ns + half if self._camera.stamp == "start" else stamp_ns - half

    def close(self) -> None:
        """Release the device."""
        self._capture.release()


class _Recorded:
    """Pictures that were taken earlier, played at the pace of their stamps from now on."""

    def __init__(
        self, camera: CameraInput, spec: Camera, clock: Callable[[], int], sleep: Callable[[float], None]
    ) -> None:
        exposure = camera.exposure_s or spec.exposure_s
        told = f"{exposure:g}" if exposure else "not known"
        self.settings = [Setting("exposure [s]", "as recorded", told, good=exposure is not None)]
        self.stamps_by_arrival = self.reconnected = 0
        self._exposure_s, self._clock, self._sleep = exposure, clock, sleep

    def _recorded(self) -> Iterator[tuple[int, Image | None]]:
        """Stamps [ns] of the recording and pictures."""
        yield from ()

    def pictures(self) -> Iterator[Picture | None]:
        """Pictures until the recording ends."""
        first: int | None = None
        began = self._clock()
        for stamp, image in self._recorded():
            first = stamp if first is None else first
            due = began + stamp - first
            wait_s = (due - self._clock()) * 1e-9
            if wait_s > 0.0:
                self._sleep(wait_s)
            yield Picture(due, self._clock(), image, self._exposure_s) if image is not None else None

    def close(self) -> None:
        """Nothing is held open between pictures."""


class FolderSource(_Recorded):
    """A folder of pictures: stamps from names in nanoseconds, or from the camera's rate."""

    def __init__(
        self,
        folder: Path,
        camera: CameraInput,
        spec: Camera,
        clock: Callable[[], int],
        sleep: Callable[[float], None],
    ) -> None:
        super().__init__(camera, spec, clock, sleep)
        self._files = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURES)
        self._named = bool(self._files) and all(p.stem.isdigit() and len(p.stem) >= 9 for p in self._files)
        if not self._files:
            raise ConfigError(f"camera.source {folder}: no pictures in it; PNG, JPEG, PGM, BMP and TIFF are read")
        if not self._named and not spec.rate_hz:
            raise ConfigError(f"camera.source {folder}: names are not stamps in ns; set rate_hz of the camera")
        self._period_ns = round(1e9 / spec.rate_hz) if spec.rate_hz else 0

    def _recorded(self) -> Iterator[tuple[int, Image | None]]:
        for number, path in enumerate(self._files):
            stamp = int(path.stem) if self._named else number * self._period_ns
            yield stamp, cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


class VideoSource(_Recorded):
    """A video file, with the stamps of its container."""

    def __init__(
        self,
        path: Path,
        camera: CameraInput,
        spec: Camera,
        clock: Callable[[], int],
        sleep: Callable[[float], None],
    ) -> None:
        super().__init__(camera, spec, clock, sleep)
        self._video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        if not self._video.isOpened():
            raise ConfigError(f"camera.source {path}: not a video that can be read")

    def _recorded(self) -> Iterator[tuple[int, Image | None]]:
        while self._video.grab():
            stamp = round(float(self._video.get(cv2.CAP_PROP_POS_MSEC)) * 1e6)
            good, image = self._video.retrieve()
            yield stamp, image if good else None

    def close(self) -> None:
        """Close the file."""
        self._video.release()
