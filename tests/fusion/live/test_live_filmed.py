"""A corridor flight with its pictures through the whole node, in real time over a bad link."""

from __future__ import annotations

import gc
import os
import stat
import time
from pathlib import Path

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from axialnav.fusion.camera_feed import CameraFeed
from axialnav.fusion.config import Config
from axialnav.fusion.live.recorder.limits import Limits
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.warm_up import wall_pictures, warm_up
from axialnav.fusion.readings import CameraFrame
from axialnav.models.rig import Camera, Imu, Surface
from axialnav.replay.flight import load_flight
from axialnav.replay.frames import camera_frames
from tests.fusion.live.accounts import (
    account_for_every_message,
    account_for_every_serial_frame,
    recorded_is_what_was_pushed,
    the_recording_replays_to_the_last_bit,
)
from tests.fusion.live.contract import ContractPx4
from tests.fusion.live.filmed import FilmedFlight, clean_errors, fused_errors, heard, render
from tests.fusion.live.streamed import Air, rms

SECONDS, STILL_S = 10.0, 2.0
BAD = Air(jitter_s=0.002, lost=0.05, reordered=0.05, damaged=0.10, seed=5)
SILENCE_S = 0.25
WINDOW_S = 0.07  # motion belongs to the middle of five pictures and is fused after the last of them
SLOW_DISK = 400_000.0  # bytes a second
SCATTER = 1.6  # of one run of eight seconds on a busy machine; the bench pools several

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return render(
        tmp_path_factory.mktemp("filmed") / "straight", seed=3, duration_s=SECONDS, width_px=320, height_px=240
    )


def test_a_filmed_flight_over_a_bad_link_is_as_good_and_nothing_is_lost_uncounted(folder: Path, tmp_path: Path) -> None:
    with FilmedFlight(folder, air=BAD, recording=FlightRecording(tmp_path, True, time.monotonic_ns)) as flight:
        assert flight.until(SECONDS + 0.3)
        status = flight.node.status()
    node, streamed = flight.node, flight.streamed
    assert node.failure == ""
    account_for_every_message(streamed, status)
    account_for_every_serial_frame(streamed, status)
    camera = status["camera"]
    assert camera["pictures"] == camera["measured"] + camera["refused"] + camera["unusable"] + camera["overwritten"]
    assert sum(status["filter"]["verdicts"]["cam0"].values()) == camera["measured"] > 100
    assert np.abs(streamed.axial_errors(STILL_S, SECONDS - 0.2)).max() < 0.2
    (path,) = tmp_path.glob("*.mcap")
    recorded_is_what_was_pushed(path, status)
    the_recording_replays_to_the_last_bit(path, node)
    from_s = (status["filter"]["began_ns"] - streamed.t0_ns) * 1e-9 - 1e-3
    clean = rms(clean_errors(folder, from_s, STILL_S, SECONDS - 0.2))
    fused = rms(fused_errors(path, flight.course, streamed.t0_ns, STILL_S, SECONDS - 0.2))
    assert fused < SCATTER * clean


def test_the_camera_freezes_for_a_while(folder: Path) -> None:
    """From 4 s to 5.5 s the driver gives the same pixels with fresh stamps; nothing else sees the axis."""
    said = []
    with FilmedFlight(folder, contract=ContractPx4(), profile="px4", without=("uwb0",), frozen_s=(4.0, 5.5)) as flight:
        streamed, node = flight.streamed, flight.node
        while streamed.now_s() < 9.0:
            time.sleep(0.02)
            said.append((streamed.now_s(), "cam0" in node.core.silent(time.monotonic_ns())))
    assert node.failure == ""
    sent = [m for _, m in streamed.contract.messages if m.get_type() == "ODOMETRY"]
    t = np.array([(m.time_usec * 1000 - streamed.t0_ns) * 1e-9 for m in sent])
    quality = np.array([m.quality for m in sent])
    frozen = (t > 4.0 + SILENCE_S + WINDOW_S) & (t < 5.5)
    assert frozen.sum() > 15
    assert set(quality[frozen]) == {1}
    assert np.median(quality[(t > 3.0) & (t < 4.0)]) > 20
    assert np.median(quality[t > 6.5]) > 20
    silent = [t for t, quiet in said if quiet and t > 3.0]
    assert silent[0] < 4.0 + SILENCE_S + WINDOW_S + 0.1
    assert np.abs(streamed.axial_errors(3.0, 8.9)).max() < 0.5


def test_a_disk_that_cannot_keep_up_costs_pictures_and_nothing_else(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures need three times what the disk takes; the flight does not notice, and every number is recorded."""
    write = os.write

    def slowly(file: int, data: bytes) -> int:
        if stat.S_ISREG(os.fstat(file).st_mode):
            time.sleep(len(data) / SLOW_DISK)
        return write(file, data)

    monkeypatch.setattr(os, "write", slowly)
    recording = FlightRecording(tmp_path, True, time.monotonic_ns, Limits(picture_queue=1 << 20))
    with FilmedFlight(folder, recording=recording) as flight:
        assert flight.until(8.0)
    node, status = flight.node, flight.node.status()
    recorded = status["recording"]
    assert node.failure == ""
    assert set(recorded["dropped"]) == {"cam0/picture"}
    assert set(recorded["reasons"]) == {"disk too slow"}
    assert recorded["dropped"]["cam0/picture"] > 60
    seen = sum(status["camera"][what] for what in ("measured", "refused", "unusable"))
    assert recorded["written"]["cam0/picture"] + recorded["dropped"]["cam0/picture"] == seen > 120
    assert np.abs(flight.streamed.axial_errors(STILL_S, 7.8)).max() < 0.2
    (path,) = tmp_path.glob("*.mcap")
    the_recording_replays_to_the_last_bit(path, node)


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_after_the_warm_up_no_picture_waits_for_a_compiler(size: tuple[int, int], folder: Path, tmp_path: Path) -> None:
    """A flight's pictures run nothing that the made-up wall of the warm-up has not run before."""
    if size != (320, 240):
        folder = render(tmp_path / "larger", seed=4, duration_s=6.0, width_px=size[0], height_px=size[1])
    config = heard(load_flight(folder).config)
    warm_up(config, "corridor")
    before = compiled()
    feed = CameraFeed(config)
    measured = sum(feed.push(frame) is not None for frame in camera_frames(load_flight(folder), "cam0"))
    assert measured > 80
    assert {name: count for name, count in compiled().items() if count != before.get(name, 0)} == {}


def compiled() -> dict[str, int]:
    """How many versions of each kernel of the estimators are loaded."""
    # by type: asking a proxy whose object is gone for its class raises
    kernels = [kernel for kernel in gc.get_objects() if issubclass(type(kernel), CPUDispatcher)]
    names = {f"{k.py_func.__module__}.{k.py_func.__name__}": len(k.signatures) for k in kernels}
    return {name: count for name, count in names.items() if name.startswith("axialnav.estimators")}


def test_the_warm_up_measures_its_wall() -> None:
    for resolution in ((160, 120), (640, 480)):
        camera = Camera(resolution=resolution, intrinsics=(300.0, 300.0, 80.0, 60.0), rate_hz=30.0, surface="wall")
        config = Config(surface={"wall": Surface(normal=(0.0, -1.0, 0.0))}, sensor={"imu0": Imu(), "cam0": camera})
        feed = CameraFeed(config)
        motions = [
            feed.push(CameraFrame(t_ns=k * 33_333_333, sensor="cam0", image=image))
            for k, image in enumerate(wall_pictures(resolution, 6, 9))
        ]
        assert motions[-1] is not None
        assert motions[-1].dx_px == pytest.approx(-9.0, abs=0.05)
