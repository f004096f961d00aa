"""What the node lets in and what it tells, without its threads."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from typing import Any

import msgspec
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.node import Node
from axialnav.fusion.live.security import signing_ticks
from axialnav.fusion.live.status import StatusServer, encode, status_line
from axialnav.fusion.live.vehicle import Mavlink, Status
from tests.fusion.live.accounts import PATIENCE_S
from tests.fusion.live.test_output import VEHICLE

KEY = bytes(range(32))
S = 1_000_000_000


class Wire:
    """A link that keeps what is sent and where."""

    unsent = 0

    def __init__(self) -> None:
        self.peer: Any = None
        self.sent: list[bytes] = []

    def fileno(self) -> None: ...

    def reopen(self) -> None: ...

    def receive(self) -> tuple[bytes, None]:
        return b"", None

    def send(self, data: bytes) -> bool:
        self.sent.append(data)
        return True

    def confirm(self, address: Any) -> None:
        self.peer = address

    def close(self) -> None: ...


@pytest.fixture
def wire() -> Wire:
    return Wire()


def node_on(wire: Wire, **mav: Any) -> Node:
    """A node that is not started; the test hands it what arrives."""
    quiet = Status(port=0, line_s=0.0)
    return Node(msgspec.structs.replace(VEHICLE, mavlink=Mavlink(**mav), status=quiet), link=wire)


def flight(system: int, component: int, key: bytes | None = None) -> Iterator[bytes]:
    """A second of what an autopilot sends: answers about its clock, then inertial samples."""
    packer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    if key is not None:
        packer.signing.secret_key, packer.signing.sign_outgoing = key, True
        packer.signing.timestamp = signing_ticks()
    for k in range(200):
        boot_us = 5_000_000 + 5000 * k
        yield mavlink.MAVLink_timesync_message(0, boot_us * 1000).pack(packer)
        yield mavlink.MAVLink_highres_imu_message(
            boot_us, 0.1, 1e-3 * (k % 9), -9.8, 0.0, 0.0, 0.0, *[0.0] * 7, 0x3F
        ).pack(packer)
        packer.seq = (packer.seq + 1) % 256


def heard(node: Node, packets: Iterator[bytes]) -> int:
    """How many messages of the packets were taken."""
    for packet in packets:
        node._receive(packet, ("10.0.0.66", 14550))
    return sum(node.autopilot.messages.values())


@pytest.mark.parametrize("who", [(1, 2), (2, 1), (255, 190)])
def test_nothing_of_an_unlisted_sender_gets_in(wire: Wire, who: tuple[int, int]) -> None:
    """Neither a reading nor a clock, and no answer goes to where it came from."""
    node = node_on(wire)
    assert heard(node, flight(*who)) == 0
    assert wire.peer is None
    assert wire.sent == []
    assert node.core.verdicts == {}
    assert not node.autopilot.heard(0)
    assert node.status()["link"]["counts"]["unlisted"] == 400


def test_a_listed_sender_gets_in(wire: Wire) -> None:
    assert heard(node_on(wire), flight(1, 1)) == 400
    assert wire.peer == ("10.0.0.66", 14550)
    assert len(wire.sent) == 200  # its questions about our clock are answered


def test_with_a_key_the_unsigned_and_the_wrongly_signed_stay_outside(wire: Wire, tmp_path: Any) -> None:
    (tmp_path / "key").write_text(KEY.hex())
    node = node_on(wire, key_file=str(tmp_path / "key"))
    assert heard(node, flight(1, 1)) == 0
    assert heard(node, flight(1, 1, bytes(32))) == 0
    assert wire.peer is None
    assert heard(node, flight(1, 1, KEY)) > 0


def test_the_status_answers_on_the_loopback_address_alone_and_tells_no_key(tmp_path: Any) -> None:
    (tmp_path / "key").write_text(KEY.hex())
    node = node_on(Wire(), key_file=str(tmp_path / "key"))
    server, stop = StatusServer(0, node.status), threading.Event()
    thread = threading.Thread(target=server.run, args=(stop,))
    thread.start()
    try:
        assert server._socket.getsockname()[0] == "127.0.0.1"
        with socket.create_connection(("127.0.0.1", server.port), timeout=PATIENCE_S) as asked:
            text = asked.makefile("rb").read()
    finally:
        stop.set()
        thread.join()
    assert KEY.hex() not in text.decode()
    status = json.loads(text)
    assert status["state"] is None
    assert "no state yet" in status_line(status)


def test_a_status_port_that_is_taken_is_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(ConfigError, match="choose another") as refusal:
        StatusServer(taken.getsockname()[1], dict)
    assert "\n" not in str(refusal.value)


def test_what_is_not_a_number_is_null() -> None:
    assert json.loads(encode({"a": float("nan"), "b": [float("inf"), 1.0]})) == {"a": None, "b": [None, 1.0]}


def test_the_status_line_names_what_is_silent(wire: Wire) -> None:
    status = node_on(wire).status()
    status["state"] = {"axial_velocity_m_s": 1.0, "sigma_axial_velocity_m_s": 0.1}
    status["filter"]["silent"] = ["cam0", "uwb0"]
    assert ", without cam0, uwb0 |" in status_line(status)
    status["filter"]["silent"] = []
    assert "without" not in status_line(status)
