"""An independent parser (MAVSDK, C++) reads what we send, field by field, on the bytes that go out."""

from __future__ import annotations

import json
import math
import threading
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest

from axialnav.fusion.live.core import Snapshot
from axialnav.fusion.live.mavlink_out import heartbeat, odometry, position_delta
from tests.fusion.live.accounts import PATIENCE_S
from tests.fusion.live.test_output import state

AXIS = np.array([1.0, 0.0, 0.0])


class Decoder:
    """MAVSDK as a ground station that is handed bytes."""

    def __init__(self, mavsdk: Any, direct: Any) -> None:
        configuration = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
        self.station = mavsdk.Mavsdk(configuration)
        assert self.station.add_any_connection("raw://") == mavsdk.ConnectionResult.SUCCESS
        self.packer = mavlink.MAVLink(None, srcSystem=1, srcComponent=197)
        found = threading.Event()
        self.station.subscribe_on_new_system(lambda *_: found.set())
        for _ in range(1000):
            self.give(heartbeat())
            if found.wait(0.05) or self.station.system_count():
                break
        (self.system,) = self.station.get_systems()
        self.direct = direct.MavlinkDirect(self.system)

    def give(self, message: Any) -> None:
        self.station.pass_received_raw_bytes(bytes(message.pack(self.packer)))
        self.packer.seq = (self.packer.seq + 1) % 256

    def decode(self, message: Any) -> dict[str, Any]:
        """Fields of a message as MAVSDK understood them."""
        got: list[Any] = []
        ready = threading.Event()

        def take(found: Any, _: Any) -> None:
            got.append(found)
            ready.set()

        handle = self.direct.subscribe_message(message.get_type(), take)
        try:
            self.give(message)
            assert ready.wait(PATIENCE_S), f"{message.get_type()} was not recognised"
        finally:
            self.direct.unsubscribe_message(handle)
        assert (got[0].system_id, got[0].component_id) == (1, 197)
        fields: dict[str, Any] = json.loads(got[0].fields_json)
        return fields


@pytest.fixture(scope="module")
def decoder() -> Any:
    mavsdk = pytest.importorskip("mavsdk", reason="the mavsdk wheel is not installed (pip install 'axialnav[dev]')")
    try:
        from mavsdk.plugins import mavlink_direct as direct

        made = Decoder(mavsdk, direct)
    except (OSError, ImportError) as error:
        pytest.skip(f"the native library of mavsdk does not run here: {error}")
    yield made
    made.direct.destroy()
    made.station.destroy()


def snapshot(t_ns: int = 5_000_000_000) -> Snapshot:
    return Snapshot(state(t_ns), np.array([0.1, 0.2, 0.3]), t_ns, t_ns, t_ns, 0)


@pytest.mark.parametrize(("content", "quality", "counter"), [("full", 80, 7), ("velocity", 1, 0), ("axial", 100, 255)])
def test_odometry_field_by_field(decoder: Decoder, content: Any, quality: int, counter: int) -> None:
    message = odometry(snapshot(), AXIS, 0.4, content, quality, counter)
    fields = decoder.decode(message)
    assert (fields["frame_id"], fields["child_frame_id"]) == (20, 12)
    assert (fields["estimator_type"], fields["quality"], fields["reset_counter"]) == (3, quality, counter)
    assert fields["time_usec"] == message.time_usec
    for name in ("x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed"):
        assert same(fields[name], getattr(message, name)), name
    for name in ("q", "pose_covariance", "velocity_covariance"):
        wanted = getattr(message, name)
        assert len(fields[name]) == len(wanted)
        assert all(same(a, b) for a, b in zip(fields[name], wanted, strict=True)), name
    assert math.hypot(*fields["q"]) == pytest.approx(1.0, abs=1e-6)


def same(decoded: float | None, sent: float) -> bool:
    """JSON has null for what is not a number; the wire has 32 bits."""
    if decoded is None:
        return math.isnan(sent)
    return math.isclose(decoded, sent, rel_tol=1e-6, abs_tol=1e-7)


def test_the_heartbeat_of_an_onboard_computer(decoder: Decoder) -> None:
    fields = decoder.decode(heartbeat())
    assert (fields["type"], fields["autopilot"]) == (mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID)


def test_deltas_field_by_field(decoder: Decoder) -> None:
    """VISION_POSITION_DELTA is of ArduPilot alone, so MAVSDK is shown its definition first."""
    xml = (
        "<mavlink><messages><message id='11011' name='VISION_POSITION_DELTA'><description>d</description>"
        "<field type='uint64_t' name='time_usec'>t</field><field type='uint64_t' name='time_delta_usec'>t</field>"
        "<field type='float[3]' name='angle_delta'>a</field><field type='float[3]' name='position_delta'>p</field>"
        "<field type='float' name='confidence'>c</field></message></messages></mavlink>"
    )
    decoder.direct.load_custom_xml(xml)
    message = position_delta(snapshot(), snapshot(5_055_000_000))
    fields = decoder.decode(message)
    assert fields["time_delta_usec"] == 55_000
    assert fields["position_delta"] == pytest.approx([0.055, 0.0, 0.0])
    assert fields["confidence"] == pytest.approx(100.0)
