"""The camera on board: folders and video files for real, the settings of a V4L2 driver against a stand-in for it."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live import cli
from axialnav.fusion.live.camera import Grabber, MotionStage, require_surface
from axialnav.fusion.live.camera_source import (
    SETTLING_FRAMES,
    FolderSource,
    Picture,
    V4l2Source,
    VideoSource,
    open_source,
)
from axialnav.fusion.live.mailbox import BoundedQueue
from axialnav.fusion.live.vehicle import CameraInput
from axialnav.fusion.readings import PixelMotion
from axialnav.models.rig import Camera, Imu, Surface

S, MS = 1_000_000_000, 1_000_000
PERIOD_NS = 33_333_333
SPEC = Camera(resolution=(160, 120), intrinsics=(150.0, 150.0, 80.0, 60.0), rate_hz=30.0, surface="wall")
CONFIG = Config(surface={"wall": Surface(normal=(0.0, -1.0, 0.0))}, sensor={"imu0": Imu(), "cam0": SPEC})
STEP_PX = 3


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.now_ns = 50 * S

    def __call__(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


def wall(number: int) -> Any:
    """A picture of a textured wall that moves to the left by 3 px a frame."""
    rng = np.random.default_rng(1)
    texture = cv2.GaussianBlur(rng.random((120, 600)), (0, 0), 2.0)
    grey = ((texture - texture.min()) / np.ptp(texture) * 255.0).astype(np.uint8)
    return np.ascontiguousarray(grey[:, STEP_PX * number : STEP_PX * number + 160])


def folder_of(path: Path, stamps: list[int]) -> Path:
    path.mkdir()
    for number, stamp in enumerate(stamps):
        cv2.imwrite(str(path / f"{stamp:019d}.png"), wall(number))
    return path


def run(source: Any, rate_hz: float | None = 30.0) -> tuple[Grabber, list[Picture]]:
    """Grab everything; the pictures in the order in which they could be taken."""
    grabber, pictures = Grabber(source, rate_hz), []
    put = grabber.mailbox.put
    grabber.mailbox.put = lambda picture: (pictures.append(picture), put(picture))  # type: ignore[method-assign, func-returns-value, assignment]
    grabber.run(threading.Event())
    return grabber, pictures


def test_a_folder_plays_at_the_pace_of_its_stamps(tmp_path: Path) -> None:
    clock = Clock()
    stamps = [7 * S + k * PERIOD_NS for k in range(12)]
    source = FolderSource(folder_of(tmp_path / "data", stamps), CameraInput(source="x"), SPEC, clock, clock.sleep)
    grabber, pictures = run(source)
    assert [p.t_ns for p in pictures] == [50 * S + t - stamps[0] for t in stamps]
    assert all(p.t_ns == p.arrival_ns for p in pictures)
    assert np.array_equal(pictures[3].image, wall(3))
    assert grabber.ended
    assert grabber.rate_hz == pytest.approx(30.0, rel=1e-4)
    assert grabber.counts == {"pictures": 12}


def test_missing_repeated_and_backward_pictures_are_counted(tmp_path: Path) -> None:
    class Given:
        settings: list[Any] = []  # noqa: RUF012
        stamps_by_arrival = 0

        def pictures(self) -> Any:
            for number in (0, 1, 2, 2, 2, 5, 4, 6, None, 7, 10):
                yield None if number is None else Picture(number * PERIOD_NS, 0, wall(0), None)

        def close(self) -> None: ...

    grabber, pictures = run(Given())
    assert [round(p.t_ns / PERIOD_NS) for p in pictures] == [0, 1, 2, 5, 6, 7, 10]
    assert grabber.counts == {"pictures": 7, "repeated": 2, "backwards": 1, "gaps": 2, "missing": 4, "unread": 1}
    assert grabber.mailbox.dropped == 6  # nobody took them


def test_a_video_file_is_a_camera_too(tmp_path: Path) -> None:
    path = tmp_path / "wall.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (160, 120), isColor=False)
    for number in range(15):
        writer.write(wall(number))
    writer.release()
    clock = Clock()
    grabber, pictures = run(VideoSource(path, CameraInput(source="x", exposure_s=0.01), SPEC, clock, clock.sleep))
    assert grabber.counts["pictures"] == 15
    assert grabber.rate_hz == pytest.approx(30.0, rel=0.01)
    assert pictures[0].image.shape[:2] == (120, 160)
    assert pictures[0].exposure_s == 0.01


def test_motion_is_measured_and_a_gap_empties_the_window() -> None:
    found: list[PixelMotion] = []
    queue: Any = BoundedQueue(1)
    stage = MotionStage(CONFIG, "cam0", queue, lambda motion, _: found.append(motion), lambda: 0)
    stamps = [k * PERIOD_NS for k in range(10)] + [(k + 5) * PERIOD_NS for k in range(10, 20)]
    for number, stamp in enumerate(stamps):
        stage.measure(Picture(stamp, 0, wall(number), 0.001))
    assert len(found) == stage.counts["measured"] == 12
    assert np.array([m.dx_px for m in found]) == pytest.approx(-STEP_PX, abs=0.1)
    assert not any(10 * PERIOD_NS <= m.t_ns < 15 * PERIOD_NS for m in found)


def test_a_frozen_camera_gives_no_motion_even_with_fresh_stamps() -> None:
    found: list[PixelMotion] = []
    queue: Any = BoundedQueue(1)
    stage = MotionStage(CONFIG, "cam0", queue, lambda motion, _: found.append(motion), lambda: 0)
    for number in range(30):
        stage.measure(Picture(number * PERIOD_NS, 0, wall(min(number, 10)), 0.001))
    assert {m.t_ns // PERIOD_NS for m in found} <= set(range(2, 9))
    assert stage.counts["refused"] >= 18


def test_another_size_begins_again_instead_of_failing() -> None:
    found: list[PixelMotion] = []
    queue: Any = BoundedQueue(1)
    stage = MotionStage(CONFIG, "cam0", queue, lambda motion, _: found.append(motion), lambda: 0)
    for number in range(6):
        stage.measure(Picture(number * PERIOD_NS, 0, wall(number), None))
    stage.measure(Picture(6 * PERIOD_NS, 0, wall(6)[:60], None))
    for number in range(7, 13):
        stage.measure(Picture(number * PERIOD_NS, 0, wall(number), None))
    assert stage.counts["unusable"] == 1
    assert len(found) == 4


def test_a_picture_that_tells_nothing_is_told_of_at_once() -> None:
    """The message of its period goes out then, and not when the next picture should be there."""
    found: list[PixelMotion] = []
    missed: list[bool] = []
    queue: Any = BoundedQueue(1)
    stage = MotionStage(
        CONFIG, "cam0", queue, lambda motion, _: found.append(motion), lambda: 0, miss=lambda: missed.append(True)
    )
    for number in (*range(6), 5, 5, 5):  # the driver hands out one picture again and again
        stage.measure(Picture((len(found) + len(missed)) * PERIOD_NS, 0, wall(number), None))
    assert (len(found), len(missed)) == (stage.counts["measured"], stage.counts["refused"]) == (2, 7)


# a driver -----------------------------------------------------------------------------------------------------------


class Driver:
    """Stands in for ``cv2.VideoCapture`` on V4L2: takes settings, rounds exposures to lines, stamps with its clock."""

    def __init__(self, clock: Clock, refuses: int | None = None, stamps: bool = True, line_s: float = 30e-6) -> None:
        self.clock, self.refuses, self.stamps, self.line_s = clock, refuses, stamps, line_s
        self.values: dict[int, float] = {}
        self.started_ns = 0
        self.released = False

    def isOpened(self) -> bool:
        return True

    def set(self, key: int, value: float) -> bool:
        if key == self.refuses:
            return False
        if key == cv2.CAP_PROP_EXPOSURE:
            value = round(value * 1e-4 / self.line_s) * self.line_s / 1e-4
        self.values[key] = value
        return True

    def get(self, key: int) -> float:
        if key == cv2.CAP_PROP_POS_MSEC:
            return self.started_ns * 1e-6 if self.stamps else 0.0
        return self.values.get(key, -1.0)

    def grab(self) -> bool:
        self.started_ns = self.clock.now_ns
        self.clock.sleep(PERIOD_NS * 1e-9)
        return True

    def retrieve(self) -> tuple[bool, Any]:
        return True, wall(0)

    def release(self) -> None:
        self.released = True


def test_exposure_is_locked_read_back_and_the_stamp_is_the_middle_of_it() -> None:
    clock = Clock()
    driver = Driver(clock)
    camera = CameraInput(source="/dev/video0", exposure_s=0.01, fourcc="YUYV", gain=3.0)
    source = V4l2Source(lambda: driver, camera, SPEC, clock)
    assert driver.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1.0
    assert all(setting.good for setting in source.settings)
    pictures = source.pictures()
    first, second = next(pictures), next(pictures)
    assert first is not None
    assert second is not None
    assert first.exposure_s == pytest.approx(0.00999)  # what the driver made of it, not what was asked for
    assert first.t_ns == pytest.approx(50 * S + SETTLING_FRAMES * PERIOD_NS + 5 * MS, abs=0.02 * MS)
    assert second.t_ns - first.t_ns == PERIOD_NS
    assert first.arrival_ns - first.t_ns == pytest.approx(PERIOD_NS - 5 * MS, abs=0.02 * MS)
    second_driver = Driver(clock)
    ending = CameraInput(source="/dev/video0", exposure_s=0.01, stamp="end")
    late = V4l2Source(lambda: second_driver, ending, SPEC, clock)
    began = clock.now_ns + SETTLING_FRAMES * PERIOD_NS
    picture = next(late.pictures())
    assert picture is not None
    assert picture.t_ns - began == pytest.approx(-5 * MS, abs=0.02 * MS)


@pytest.mark.parametrize(
    ("key", "words"),
    [
        (cv2.CAP_PROP_AUTO_EXPOSURE, "manual exposure"),
        (cv2.CAP_PROP_EXPOSURE, "exposure"),
        (cv2.CAP_PROP_FRAME_WIDTH, "width"),
    ],
)
def test_a_driver_that_does_not_do_as_told_is_refused(key: int, words: str) -> None:
    clock = Clock()
    driver = Driver(clock, refuses=key)
    with pytest.raises(ConfigError, match=words):
        V4l2Source(lambda: driver, CameraInput(source="/dev/video0", exposure_s=0.01), SPEC, clock)
    assert driver.released


def test_a_driver_without_stamps_is_counted() -> None:
    clock = Clock()
    driver = Driver(clock, stamps=False)
    source = V4l2Source(lambda: driver, CameraInput(source="/dev/video0"), SPEC, clock)
    pictures = source.pictures()
    for _ in range(3):
        assert next(pictures) is not None
    assert source.stamps_by_arrival == SETTLING_FRAMES + 3
    assert [s.name for s in source.settings if not s.good] == ["exposure [s]"]


@pytest.mark.parametrize("where", ["/dev/video99", "nowhere", "empty", "text.txt"])
def test_what_is_no_camera_is_one_line(where: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("no pictures here")
    path = where if where.startswith("/") else str(tmp_path / where)
    with pytest.raises(ConfigError, match=r"camera\.source") as refusal:
        open_source(CameraInput(source=path), SPEC, Clock())
    assert "\n" not in str(refusal.value)


def test_a_camera_that_looks_at_nothing_is_refused() -> None:
    blind = Camera(resolution=(160, 120), intrinsics=(150.0, 150.0, 80.0, 60.0))
    with pytest.raises(ConfigError, match="names no surface"):
        require_surface(Config(sensor={"cam0": blind}), "cam0")


@pytest.mark.parametrize(("missing", "code"), [((), 0), ((7, 8, 15), 1)])
def test_the_verb_prints_what_was_set_and_measured(
    missing: tuple[int, ...], code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder_of(tmp_path / "data", [k * PERIOD_NS for k in range(30) if k not in missing])
    (tmp_path / "vehicle.toml").write_text(
        f'[camera]\nsource = "{tmp_path / "data"}"\nexposure_s = 0.001\n'
        '[filter.sensor.imu0]\nkind = "imu"\n[filter.surface.wall]\nnormal = [0.0, -1.0, 0.0]\n'
        '[filter.sensor.cam0]\nkind = "camera"\nresolution = [160, 120]\nrate_hz = 30.0\nsurface = "wall"\n'
        "intrinsics = [150.0, 150.0, 80.0, 60.0]\n"
    )
    assert cli.main(["camera", "--config", str(tmp_path / "vehicle.toml"), "--seconds", "3"]) == code
    printed = capsys.readouterr().out
    assert "ok  set exposure [s]" in printed
    assert f"gaps {2 if missing else 0} ({len(missing)} pictures missing)" in printed
    assert "stamps from the driver" in printed
    assert "px a frame" in printed
