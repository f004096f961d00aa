"""A corridor flight with its pictures through the whole node, over a bad link."""

from __future__ import annotations

import gc
import os
import stat
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from axialnav.fusion.camera_feed import CameraFeed
from axialnav.fusion.config import Config
from axialnav.fusion.live.node import TICK_S, Node
from axialnav.fusion.live.recorder.limits import Limits
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
    wait_for,
)
from tests.fusion.live.contract import ContractPx4
from tests.fusion.live.filmed import (
    Shutter,
    clean_errors,
    filmed_course,
    fused_errors,
    heard,
    render,
    with_camera,
)
from tests.fusion.live.flown import Flown, fly_filmed
from tests.fusion.live.streamed import Air, StreamedVehicle, rms, vehicle_of

SECONDS, STILL_S = 10.0, 2.0
BAD = Air(jitter_s=0.002, lost=0.05, reordered=0.05, damaged=0.10, seed=5)
SILENCE_S = 0.25
WINDOW_S = 0.07  # motion belongs to the middle of five pictures and is fused after the last of them
SCATTER = 1.25
SLOW_DISK = 400_000.0  # bytes a second

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return render(
        tmp_path_factory.mktemp("filmed") / "straight", seed=3, duration_s=SECONDS, width_px=320, height_px=240
    )


def test_filmed_flights_over_a_bad_link_are_as_good_and_nothing_is_lost_uncounted(folder: Path, tmp_path: Path) -> None:
    """The same flight over two bad links; the bench pools more flights and holds them to ten per cent."""
    clean, fused = [], []
    for seed in range(1, 3):
        records = tmp_path / f"{seed}"
        flown = fly_filmed(folder, SECONDS + 0.3, air=replace(BAD, seed=seed), records=records)
        streamed, status = flown.streamed, flown.status
        assert flown.node.failure == ""
        account_for_every_message(streamed, status)
        account_for_every_serial_frame(streamed, status)
        camera = status["camera"]
        assert camera["pictures"] == camera["measured"] + camera["refused"] + camera["unusable"]
        assert camera["overwritten"] == camera["waiting"] == 0
        assert sum(status["filter"]["verdicts"]["cam0"].values()) == camera["measured"] > 200
        assert np.abs(streamed.axial_errors(STILL_S, SECONDS - 0.2)).max() < 0.2
        (path,) = records.glob("*.mcap")
        recorded_is_what_was_pushed(path, status)
        the_recording_replays_to_the_last_bit(path, flown.node)
        from_s = (status["filter"]["began_ns"] - streamed.t0_ns) * 1e-9 - 1e-3
        clean.append(rms(clean_errors(folder, from_s, STILL_S, SECONDS - 0.2)))
        fused.append(rms(fused_errors(path, flown.course, streamed.t0_ns, STILL_S, SECONDS - 0.2)))
    assert rms(np.array(fused)) < SCATTER * rms(np.array(clean))


def test_the_camera_with_all_its_threads_in_real_time(folder: Path) -> None:
    """However late they run: every picture is accounted for, and one of them was the reason for a message."""
    course = filmed_course(folder)
    streamed, source = StreamedVehicle(course), Shutter(folder, course.config)
    vehicle = with_camera(vehicle_of(course.config, streamed.port, streamed.ttys))
    warm_up(vehicle.filter, vehicle.estimator)
    node = Node(vehicle, source=source)
    node.start()
    streamed.start()
    source.release(streamed.t0_ns)
    try:
        assert wait_for(lambda: node.status()["camera"]["ended"])
    finally:
        node.close()
        streamed.close()
    camera, filter_ = node.status()["camera"], node.status()["filter"]
    assert node.failure == ""
    seen = sum(camera[what] for what in ("measured", "refused", "unusable", "overwritten", "waiting"))
    assert camera["pictures"] == seen == len(load_flight(folder).tables["cam0"].t_ns)
    pushed = sum(filter_["verdicts"].get("cam0", {}).values())
    assert pushed + filter_["waiting"] + filter_["dropped"] == camera["measured"]
    assert {"camera", "motion"} < set(node.status()["processor_s"])


def test_the_camera_freezes_for_a_while(folder: Path) -> None:
    """From 4 s to 5.5 s the driver gives the same pixels with fresh stamps; nothing else sees the axis."""
    said = []

    def listen(flown: Flown) -> None:
        said.append((flown.now_s, "cam0" in flown.node.core.silent(flown.clock())))

    flown = fly_filmed(
        folder, 9.0, contract=ContractPx4(), profile="px4", without=("uwb0",), frozen_s=(4.0, 5.5), meddle=listen
    )
    assert flown.node.failure == ""
    t, quality = flown.sent_s, np.array([m.quality for m in flown.sent])
    frozen = (t > 4.0 + SILENCE_S + WINDOW_S) & (t < 5.5)
    assert frozen.sum() > 30
    assert set(quality[frozen]) == {1}
    assert np.median(quality[(t > 3.0) & (t < 4.0)]) > 20
    assert np.median(quality[t > 6.0]) > 20
    silent = [at for at, quiet in said if quiet and at > 3.0]
    assert silent[0] < 4.0 + SILENCE_S + WINDOW_S + TICK_S
    assert np.abs(flown.streamed.axial_errors(3.0, 8.9)).max() < 0.5


def test_a_disk_that_cannot_keep_up_costs_pictures_and_nothing_else(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pictures need three times what the disk takes; the flight does not notice, and every number is recorded."""
    write = os.write
    landed = threading.Event()
    clock = [0]  # of the flight, which the disk is slow in
    free_ns = 0

    def slowly(file: int, data: bytes) -> int:
        nonlocal free_ns
        if clock[0] and stat.S_ISREG(os.fstat(file).st_mode):
            free_ns = max(free_ns, clock[0]) + round(len(data) / SLOW_DISK * 1e9)
            while clock[0] < free_ns and not landed.wait(1e-3):
                pass
        return write(file, data)

    def meddle(flown: Flown) -> None:
        clock[0] = flown.clock()
        if flown.now_s > 7.97:
            landed.set()

    monkeypatch.setattr(os, "write", slowly)
    flown = fly_filmed(folder, 8.0, records=tmp_path, limits=Limits(picture_queue=1 << 20), meddle=meddle)
    recorded, camera = flown.recorded, flown.status["camera"]
    assert flown.node.failure == ""
    assert set(recorded["dropped"]) == {"cam0/picture"}
    assert set(recorded["reasons"]) == {"disk too slow"}
    assert recorded["dropped"]["cam0/picture"] > 60
    seen = sum(camera[what] for what in ("measured", "refused", "unusable"))
    assert recorded["written"]["cam0/picture"] + recorded["dropped"]["cam0/picture"] == seen > 200
    assert np.abs(flown.streamed.axial_errors(STILL_S, 7.8)).max() < 0.2
    (path,) = tmp_path.glob("*.mcap")
    the_recording_replays_to_the_last_bit(path, flown.node)


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
