"""The link and the other end of it: ports, questions and answers, what is asked for again, and heartbeats."""

from __future__ import annotations

import select
import socket
from collections import Counter
from typing import Any

import msgspec
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.autopilot import Autopilot
from axialnav.fusion.live.transport import Link, UdpLink, open_link
from axialnav.fusion.live.vehicle import Inputs, Mavlink, Vehicle
from axialnav.fusion.readings import ImuSample
from tests.fusion.live.accounts import PATIENCE_S
from tests.fusion.live.streamed import streamed_flight

S, MS = 1_000_000_000, 1_000_000
CONFIG = streamed_flight().config
VEHICLE = Vehicle(filter=CONFIG, input=Inputs(flow="flow0", range={"range0": 25}))


class Ground:
    """An autopilot object with a clock that the test moves, and everything that it sent."""

    def __init__(self, vehicle: Vehicle = VEHICLE) -> None:
        self.now_ns = 1000 * S
        self.sent: list[Any] = []
        self.restarts: list[str] = []
        self.boot_ns = 990 * S
        self.autopilot = Autopilot(vehicle, self.send, lambda: self.now_ns, self.restarts.append)

    def send(self, message: Any) -> bool:
        self.sent.append(message)
        return True

    def asked(self) -> Counter[int]:
        """Message numbers of the streams that were asked for."""
        return Counter(int(m.param1) for m in self.sent if m.get_type() == "COMMAND_LONG")

    def boot(self) -> int:
        return self.now_ns - self.boot_ns

    def imu(self, name: str = "highres_imu") -> Any:
        if name == "highres_imu":
            noise = (self.now_ns % 1013) * 1e-5
            return mavlink.MAVLink_highres_imu_message(
                self.boot() // 1000, 0.1, 0.2, -9.8 + noise, 0.0, 0.0, 0.0, *[0.0] * 7, 0x3F
            )
        return mavlink.MAVLink_raw_imu_message(self.boot() // 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0)

    def run(self, seconds: float, source: str | None = "highres_imu", answers: bool = True) -> list[Any]:
        """Live for a while: tick, answer questions, send inertial samples at 100 Hz."""
        readings = []
        for _ in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            heard = len(self.sent)
            self.autopilot.tick(self.now_ns)
            for message in self.sent[heard:]:
                if answers and message.get_type() == "TIMESYNC":
                    answer = mavlink.MAVLink_timesync_message(self.boot(), message.ts1)
                    self.autopilot.take(answer, self.now_ns + MS // 2)
            if source is not None:
                readings.append(self.autopilot.take(self.imu(source), self.now_ns + MS // 2))
        return readings


def test_the_heartbeat_has_its_own_rhythm() -> None:
    ground = Ground()
    ground.run(10.0, source=None, answers=False)
    beats = [m for m in ground.sent if m.get_type() == "HEARTBEAT"]
    assert len(beats) == 10
    assert {(m.type, m.autopilot) for m in beats} == {(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8)}


def test_questions_are_answered_with_our_clock() -> None:
    ground = Ground()
    ground.autopilot.take(mavlink.MAVLink_timesync_message(0, 123456), ground.now_ns)
    assert [(m.tc1, m.ts1) for m in ground.sent] == [(ground.now_ns, 123456)]
    assert ground.autopilot.timesync.served == 1


def test_our_questions_set_the_clock_and_unasked_answers_do_not() -> None:
    ground = Ground()
    ground.autopilot.take(mavlink.MAVLink_timesync_message(5, 77), ground.now_ns)
    assert ground.autopilot.timesync.unasked == 1
    ground.run(2.0)
    clock = ground.autopilot.clock
    assert clock.synchronised
    assert clock.to_companion_ns(ground.boot()) == pytest.approx(ground.now_ns, abs=MS)


def test_what_does_not_come_is_asked_for_again_and_what_comes_is_not() -> None:
    ground = Ground()
    ground.run(10.0)
    asked = ground.asked()
    assert asked[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] == 1
    assert asked[mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT] == 5
    assert asked[mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR] == 5
    assert mavlink.MAVLINK_MSG_ID_RAW_IMU not in asked
    intervals = {int(m.param1): m.param2 for m in ground.sent if m.get_type() == "COMMAND_LONG"}
    assert intervals[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] == 5000
    assert "HIGHRES_IMU" not in ground.autopilot.streams.silent(ground.now_ns)


def test_coarse_samples_are_asked_for_where_the_fine_ones_do_not_come() -> None:
    ground = Ground()
    ground.run(6.0, source=None)
    assert ground.asked()[mavlink.MAVLINK_MSG_ID_RAW_IMU] >= 1
    readings = ground.run(2.0, source="raw_imu")
    assert sum(isinstance(r, ImuSample) for r in readings) > 150
    assert ground.restarts == ["inertial samples now come from RAW_IMU"]
    config = ground.autopilot.input.filter_config()
    assert config.sensor["imu0"].accel_noise_density > CONFIG.sensor["imu0"].accel_noise_density  # type: ignore[union-attr]


def test_a_reboot_restarts_the_filter_and_asks_for_everything_again() -> None:
    ground = Ground()
    ground.run(5.0)
    before = ground.asked()[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU]
    ground.run(4.0, source=None, answers=False)  # it boots
    ground.boot_ns = ground.now_ns - 2 * S
    readings = ground.run(5.0)
    assert ground.restarts == ["the autopilot's clock started anew"]
    assert ground.asked()[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] > before
    good = [r for r in readings[-200:] if r is not None]
    assert len(good) == 200
    assert good[-1].t_ns == pytest.approx(ground.now_ns, abs=MS)


def test_another_autopilot_than_the_profile_says_is_told() -> None:
    ground = Ground()
    ground.autopilot.take(mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 4, 3), ground.now_ns)
    said = ground.autopilot.sentence(ground.now_ns, sending=True, why_not="", bad_signatures=0)
    assert said.startswith('the autopilot is px4, mavlink.profile says "ardupilot"')


# ports --------------------------------------------------------------------------------------------------------------


def received(link: Link) -> Any:
    """What arrives next."""
    select.select([link.fileno()], [], [], PATIENCE_S)
    return link.receive()


@pytest.mark.parametrize(
    "name", ["", "udp:1.2.3.4:5", "udpin:here", "serial:/dev/ttyS0", "udpin:127.0.0.1:99999", "tcp:a:1"]
)
def test_a_link_that_cannot_be_is_one_line(name: str) -> None:
    with pytest.raises(ConfigError, match=r"^mavlink\.link") as refusal:
        open_link(name)
    assert "\n" not in str(refusal.value)


def test_a_listening_link_answers_only_where_a_listed_sender_was_heard() -> None:
    link = UdpLink("127.0.0.1", 0, listen=True)
    other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    other.bind(("127.0.0.1", 0))
    other.settimeout(PATIENCE_S)
    try:
        assert link.send(b"nobody") is False
        other.sendto(b"hello", ("127.0.0.1", link.port))
        data, sender = received(link)
        assert data == b"hello"
        assert link.send(b"still nobody") is False
        link.confirm(sender)
        assert link.send(b"welcome")
        assert other.recv(100) == b"welcome"
        assert link.receive() == (b"", None)
    finally:
        link.close()
        other.close()


def test_a_calling_link_survives_a_closed_port() -> None:
    gone = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    gone.bind(("127.0.0.1", 0))
    port = gone.getsockname()[1]
    gone.close()
    link = open_link(f"udpout:127.0.0.1:{port}")
    try:
        for _ in range(5):
            link.send(b"anybody?")
            assert link.receive() == (b"", None)
    finally:
        link.close()


def test_the_serial_link_speaks_to_a_terminal(tmp_path) -> None:
    import os
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    link = open_link(f"serial:{os.ttyname(slave)}:115200")
    try:
        link.reopen()
        os.write(master, b"from the autopilot")
        assert received(link) == (b"from the autopilot", None)
        assert link.send(b"to the autopilot")
        assert os.read(master, 100) == b"to the autopilot"
        link.confirm(None)
    finally:
        link.close()
        os.close(master)
        os.close(slave)


def test_px4_is_asked_for_its_own_messages() -> None:
    ground = Ground(msgspec.structs.replace(VEHICLE, mavlink=Mavlink(profile="px4")))
    ground.run(3.0)
    assert mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS in ground.asked()
    assert mavlink.MAVLINK_MSG_ID_OPTICAL_FLOW_RAD in ground.asked()
    assert mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT not in ground.asked()
