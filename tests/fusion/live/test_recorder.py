"""The recorder: other people's decoders read what it writes, and a bad disk costs pictures first and is said."""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import threading
from collections import Counter
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.fusion.live.recorder import messages as m
from axialnav.fusion.live.recorder.definition import Field, parse_definition
from axialnav.fusion.live.recorder.limits import Limits
from axialnav.fusion.live.recorder.recorder import Recorder
from axialnav.fusion.live.recorder.sink import McapSink
from axialnav.fusion.outcome import AxialState, Health, Outcome, Reason, Verdict
from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    CameraFrame,
    Height,
    ImuSample,
    PixelMotion,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from tests.fusion.live.accounts import wait_for

PICTURE = np.random.default_rng(3).integers(0, 255, size=(48, 64), dtype=np.uint8)


def imu(t_ns: int) -> ImuSample:
    return ImuSample(t_ns=t_ns, sensor="imu0", gyro_rad_s=(0.1, -0.2, 0.3), accel_m_s2=(1 / 3, 0.0, 9.81))


def frame(t_ns: int, picture: Any = PICTURE) -> CameraFrame:
    return CameraFrame(t_ns=t_ns, sensor="cam0", image=picture, exposure_s=0.002)


def state(t_ns: int) -> AxialState:
    covariance = np.diag(np.arange(1.0, 26.0))
    half = math.sqrt(0.5)
    return AxialState(
        t_ns=t_ns,
        axial_position_m=4.0,
        axial_velocity_m_s=1.5,
        sigma_axial_position_m=0.1,
        sigma_axial_velocity_m_s=0.05,
        position_m=np.array([4.0, 0.5, 1.0]),
        velocity_m_s=np.array([1.5, 0.0, 0.0]),
        quaternion_WB=np.array([half, 0.0, 0.0, half]),
        gyro_bias_rad_s=np.zeros(3),
        accel_bias_m_s2=np.zeros(3),
        blur_scale=0.01,
        uwb_bias_m=np.full(8, 0.02),
        wall_offset_m=0.0,
        covariance=covariance,
        flags=Health.UWB_SUSPECT,
        resets=2,
        last_reset_delta_m=np.zeros(3),
    )


READINGS = [
    imu(5),
    frame(6),
    PixelMotion(t_ns=7, sensor="flow0", window_s=0.01, dx_px=1.5, dy_px=-2.0, quality=200.0),
    BlurLength(t_ns=8, sensor="blur0", window_s=0.1, length_px=30.1, sigma_px=0.5),
    WallRange(t_ns=9, sensor="tof0", range_m=0.1 + 0.2),
    UwbRange(t_ns=10, sensor="uwb0", anchor="7", range_m=3.3, rssi_dbm=-80.0, first_path_dbm=-88.5),
    UwbTdoa(t_ns=11, sensor="uwb1", anchor_a="7", anchor_b="12", difference_m=-0.7),
    UwbFix(t_ns=12, sensor="uwb2", position_m=(1.0, 2.0, 3.0), sigma_m=(0.1, 0.2, 0.3)),
    Height(t_ns=13, sensor="baro0", height_m=101.5),
    Attitude(t_ns=14, sensor="att0", roll_rad=0.1, pitch_rad=0.2, yaw_rad=0.3),
]


def decoded(path: Path) -> dict[str, list[Any]]:
    """Messages by topic as the mcap project's own ROS 2 decoder sees them, checksums verified."""
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        for _, channel, _, message in make_reader(
            file, decoder_factories=[DecoderFactory()], validate_crcs=True
        ).iter_decoded_messages():
            found.setdefault(channel.topic, []).append(message)
    return found


def test_an_independent_decoder_reads_every_kind_of_message(tmp_path: Path) -> None:
    with Recorder(tmp_path / "flight.mcap", config=Config(), about={"name": "test"}) as recorder:
        for reading in READINGS:
            assert recorder.write(reading.sensor, reading.t_ns + 1000, reading)
        outcome = Outcome(20, "uwb0", Verdict.GATED, Reason.INNOVATION, (0.4,), (0.01,), 16.0, 10.8, 0.0)
        recorder.write("state", 20, state(20))
        recorder.write("outcome", 20, outcome)
        recorder.write("uwb0/raw", 21, b"\x55\x01")
        recorder.write("log", 22, "armed")
    found = decoded(tmp_path / "flight.mcap")
    assert found["/imu0"][0].linear_acceleration.x == 1 / 3
    assert found["/imu0"][0].header.stamp.nanosec == 5
    assert found["/imu0"][0].orientation_covariance[0] == -1.0
    assert found["/tof0"][0].range_m == 0.1 + 0.2
    assert math.isnan(found["/tof0"][0].sigma_m)
    assert (found["/uwb1"][0].anchor_a, found["/uwb1"][0].anchor_b) == ("7", "12")
    assert math.sqrt(found["/uwb2"][0].pose.covariance[7]) == 0.2
    assert found["/cam0/exposure"][0].exposure_s == 0.002
    assert found["/cam0"][0].format == "png"
    assert found["/flow0"][0].dy_px == -2.0
    assert found["/state/status"][0].flags == Health.UWB_SUSPECT
    assert found["/outcome"][0].innovation[0] == 0.4
    assert (found["/uwb0/raw"][0].data, found["/log"][0].msg) == (b"\x55\x01", "armed")
    odometry = found["/state"][0]
    assert odometry.twist.twist.linear.y == pytest.approx(-1.5)  # turned left by 90 degrees, flying to its right
    assert odometry.twist.covariance[7] == pytest.approx(4.0)
    assert odometry.pose.covariance[21] == 7.0


def test_a_second_reader_gets_every_message_of_a_bare_file(tmp_path: Path) -> None:
    """rosbags: other code for MCAP, for the definitions and for the bytes than the one above."""
    with Recorder(tmp_path / "flight.mcap", config=Config()) as recorder:
        for reading in READINGS:
            recorder.write(reading.sensor, reading.t_ns + 1000, reading)
        recorder.write("state", 20, state(20))
    with AnyReader([tmp_path / "flight.mcap"]) as reader:
        found = {c.topic: (t, reader.deserialize(raw, c.msgtype)) for c, t, raw in reader.messages()}
    assert {f"/{reading.sensor}" for reading in READINGS} <= set(found)
    arrival_ns, range_ = found["/tof0"]
    assert (arrival_ns, range_.header.stamp.nanosec, range_.range_m) == (1009, 9, 0.1 + 0.2)
    assert found["/imu0"][1].linear_acceleration.x == 1 / 3
    assert found["/uwb1"][1].anchor_b == "12"
    assert found["/state"][1].twist.twist.linear.y == pytest.approx(-1.5)
    picture = cv2.imdecode(np.frombuffer(found["/cam0"][1].data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(picture, PICTURE)


@pytest.mark.parametrize("name", m.STANDARD)
def test_standard_messages_are_those_of_ros(name: str) -> None:
    text, _ = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(name, ros_version=2)

    def spread(fields: tuple[Field, ...]) -> list[Any]:
        return [(f.name, f.kind, f.count, spread(f.fields)) for f in fields]

    assert spread(parse_definition(name, m.STANDARD[name])) == spread(parse_definition(name, text))


def test_the_file_tells_its_config_before_anything_else(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", config=Config(disabled=("x",)), about={"name": "tunnel"}):
        pass
    with (tmp_path / "a.mcap").open("rb") as file:
        [metadata] = list(make_reader(file).iter_metadata())
    assert metadata.metadata["name"] == "tunnel"
    assert 'disabled = ["x"]' in metadata.metadata["config"]


def test_a_recording_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    with pytest.raises(FlightError, match="exists already"):
        Recorder(tmp_path / "a.mcap")
    with pytest.raises(FlightError, match="No such file"):
        Recorder(tmp_path / "nowhere" / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == b"precious"


def test_a_slow_disk_costs_pictures_and_no_number(tmp_path: Path) -> None:
    disk = threading.Event()

    def slow(_: CameraFrame) -> tuple[str, bytes]:
        disk.wait(30)
        return "png", b"picture"

    limits = Limits(picture_queue=10 * PICTURE.nbytes)
    recorder = Recorder(tmp_path / "a.mcap", picture=slow, limits=limits)
    taken = [recorder.write("cam0", t, frame(t)) for t in range(100)]
    assert all(recorder.write("imu0", t, imu(t)) for t in range(1000))
    disk.set()
    status = recorder.close()
    assert status.written["imu0"] == 1000
    assert status.dropped == {"cam0": 100 - sum(taken)}
    assert 10 <= sum(taken) <= 20
    assert status.reasons == {"disk too slow": 100 - sum(taken)}
    found = decoded(tmp_path / "a.mcap")
    assert len(found["/imu0"]) == 1000
    assert len(found["/cam0"]) == sum(taken)
    assert "disk too slow: " in found["/recorder/log"][-1].msg


def test_numbers_too_have_a_limit_in_memory(tmp_path: Path) -> None:
    disk = threading.Event()

    def slow(_: CameraFrame) -> tuple[str, bytes]:
        disk.wait(30)
        return "png", b"picture"

    recorder = Recorder(tmp_path / "a.mcap", picture=slow, limits=Limits(queue=40_000))
    recorder.write("cam0", 0, frame(0))
    taken = sum(recorder.write("imu0", t, imu(t)) for t in range(1000))
    disk.set()
    status = recorder.close()
    assert 100 <= taken <= 200
    assert status.written["imu0"] == taken
    assert status.dropped["imu0"] == 1000 - taken


def test_a_filling_disk_stops_pictures_then_everything_and_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("axialnav.fusion.live.recorder.recorder.FLUSH_S", 0.1)
    free = {"now": 10 << 30}
    recorder = Recorder(tmp_path / "a.mcap", free_bytes=lambda: free["now"])
    phases = [("plenty", 10 << 30), ("little", 100 << 20), ("none", 1 << 20), ("again", 10 << 30)]
    for phase, (_, space) in enumerate(phases):
        free["now"] = space
        for k in range(20):
            recorder.write("cam0", 100 * phase + k, frame(100 * phase + k))
            recorder.write("imu0", 100 * phase + k, imu(100 * phase + k))
        assert wait_for(partial(has_done_with, recorder, 40 * (phase + 1)))
    status = recorder.close()
    assert (status.written["cam0"], status.written["imu0"]) == (40, 60)
    assert (status.dropped["cam0"], status.dropped["imu0"]) == (40, 20)
    assert status.reasons == {"disk nearly full": 20, "disk full": 40}
    texts = [message.msg for message in decoded(tmp_path / "a.mcap")["/recorder/log"]]
    assert [text.partition(":")[0] for text in texts] == [
        "pictures stopped",
        "recording stopped",
        "recording resumed",
        "pictures resumed",
        "60 messages were given up",
    ]


def has_done_with(recorder: Recorder, count: int) -> bool:
    """Whether so many readings are on disk or given up."""
    status = recorder.status()
    return sum(what.get(s, 0) for what in (status.written, status.dropped) for s in ("imu0", "cam0")) == count


FULL_DISK = """
import resource, sys
from axialnav.fusion.live.recorder import recorder as module
from axialnav.fusion.live.recorder.recorder import Recorder
from tests.fusion.live.accounts import wait_for
from tests.fusion.live.test_recorder import has_done_with, imu
module.FLUSH_S = 0.1
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
recorder = Recorder(sys.argv[1])
for t in range(4000):
    recorder.write("imu0", t * 5_000_000, imu(t * 5_000_000))
    if t % 400 == 0:
        assert wait_for(lambda: has_done_with(recorder, t + 1))
status = recorder.close()
print(status.written["imu0"], status.dropped["imu0"], status.problem)
"""


def test_a_file_that_the_system_refuses_to_grow_stays_whole(tmp_path: Path) -> None:
    """A real refusal of the kernel (file size limit) in the middle of a chunk."""
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 300_000
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path / "a.mcap")], capture_output=True, text=True, check=True
    )
    written, dropped, problem = done.stdout.split(maxsplit=2)
    assert "File too large" in problem
    assert int(written) + int(dropped) == 4000
    assert int(written) > 100
    counts: Counter[str] = Counter()
    with (tmp_path / "a.mcap").open("rb") as file, suppress(EndOfFile):  # it ends without a footer
        for record in StreamReader(file).records:
            counts[type(record).__name__] += 1
    assert counts["Message"] == int(written)
    assert counts["Footer"] == 0
    assert (tmp_path / "a.mcap").stat().st_size <= 300_000


def test_what_cannot_be_recorded_is_counted_with_its_reason(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.write("cam0", 0, frame(0, np.zeros((4, 6), dtype=np.complex128)))
        recorder.write("imu0", 0, imu(2**61))
        recorder.write("imu0", 0, imu(1))
    status = recorder.status()
    assert status.written == {"imu0": 1, "recorder/log": 1}
    assert status.dropped == {"cam0": 1, "imu0": 1}
    assert sorted(reason.partition(":")[0] for reason in status.reasons) == ["not recordable", "not recordable"]
    assert recorder.write("imu0", 2, imu(2)) is False


def test_a_sink_that_lost_a_chunk_goes_on_with_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sink = McapSink(tmp_path / "a.mcap", "test")
    definition = m.DEFINITIONS["rcl_interfaces/msg/Log"]
    data = m.MessageEncoder(lambda _: ("", b"")).encode("log", 0, "hello")[0].data
    sink.add("/log", "rcl_interfaces/msg/Log", definition, data, log_ns=1, publish_ns=1)
    real = os.write

    def half(fd: int, block: Any) -> int:
        real(fd, bytes(block[: len(block) // 2]))
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", half)
    with pytest.raises(OSError, match="No space left"):
        sink.flush()
    monkeypatch.setattr(os, "write", real)
    sink.add("/log", "rcl_interfaces/msg/Log", definition, data, log_ns=2, publish_ns=2)
    sink.finish()
    assert [message.msg for message in decoded(tmp_path / "a.mcap")["/log"]] == ["hello"]
