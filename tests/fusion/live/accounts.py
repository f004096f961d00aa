"""Book-keeping of a streamed flight: what was sent is what was taken plus what is counted as lost."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.live.node import Node
from axialnav.fusion.readings import ImuSample
from axialnav.replay.flight import load_flight
from axialnav.replay.flight_readings import merge_readings
from axialnav.replay.run import replay
from tests.fusion.live.streamed import StreamedVehicle, serial_sensors

TAIL = 5  # what is lost of the very last packets leaves no gap in the sequence
PATIENCE_S = 120.0
FRAME_BYTES = {"ranges": 29, "wall": 16}


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE_S, pause_s: float = 0.02) -> bool:
    """Whether something came true; the time is for a machine that hangs, not for one that is busy."""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(pause_s)
    return True


def account_for_every_message(streamed: StreamedVehicle, status: dict[str, Any]) -> None:
    """What the vehicle sent is what was accepted plus what the gaps in the sequence say is missing."""
    over_udp = Counter(streamed.sent)
    for name in streamed.serial:
        del over_udp[name]
    accepted, lost = status["link"]["counts"]["accepted"], status["link"]["lost"]["1/1"]
    spoilt = sum(n for name, n in streamed.dropped.items() if not name.startswith(tuple(streamed.serial)))
    assert accepted + lost <= sum(over_udp.values()) <= accepted + lost + TAIL
    assert abs(lost - spoilt) <= TAIL
    messages, pilot = status["autopilot"]["messages"], status["autopilot"]
    assert sum(messages.values()) == accepted
    sensors = sum(pilot["readings"].values()) + sum(pilot["refused"].values())
    silent = sum(messages.get(m, 0) for m in ("TIMESYNC", "HEARTBEAT", "EKF_STATUS_REPORT", "ATTITUDE_QUATERNION"))
    unknown = messages["ATTITUDE_QUATERNION"] - sum(n for r, n in pilot["refused"].items() if "ATTITUDE" in r)
    assert unknown >= 0
    assert sensors + silent - pilot["refused"].get("clock not known yet", 0) <= accepted <= sensors + silent
    filter_ = status["filter"]
    pushed = sum(n for sensor in filter_["verdicts"].values() for n in sensor.values())
    delivered = sum(pilot["readings"].values()) + sum(line["readings"] for line in status["nooploop"].values())
    delivered += status["camera"]["measured"] if status["camera"] else 0
    assert pushed + filter_["dropped"] + filter_["waiting"] + sum(filter_["refused"].values()) == delivered


def account_for_every_serial_frame(streamed: StreamedVehicle, status: dict[str, Any]) -> None:
    """Frames that arrived whole are decoded; every byte of the others is counted."""
    kinds = serial_sensors(streamed.course.config)
    for name in streamed.serial:
        size = FRAME_BYTES[kinds[name]]
        line = status["nooploop"][streamed.ttys[name]]
        spoilt = streamed.dropped[name] + streamed.dropped[f"{name} damaged"]
        decoded = sum(line["frames"].values())
        assert decoded == streamed.sent[name] - spoilt
        assert line["total_bytes"] == decoded * size + line["skipped_bytes"] + line["waiting_bytes"]


def recorded_is_what_was_pushed(path: Path, status: dict[str, Any]) -> None:
    with path.open("rb") as file:
        statistics = make_reader(file).get_summary()
    assert statistics is not None
    assert statistics.statistics is not None
    counts = statistics.statistics.channel_message_counts
    topics = {channel.topic: counts[number] for number, channel in statistics.channels.items()}
    for sensor, verdicts in status["filter"]["verdicts"].items():
        assert topics[f"/{sensor}"] == sum(verdicts.values())
    assert topics["/wire/mavlink_in"] >= status["link"]["counts"]["accepted"]
    assert topics["/state"] == status["output"]["sent"] > 0


def the_recording_replays_to_the_last_bit(path: Path, node: Node) -> None:
    """Late, damaged and lost as it was, what was flown is what its recording gives, pushed and in one run."""
    snapshot = node.core.snapshot(0)
    assert snapshot is not None
    flight = load_flight(path)
    estimator = CorridorEstimator(flight.config)
    last = None
    for reading in merge_readings(flight):
        estimator.push(reading)
        if reading.t_ns == snapshot.imu_ns and isinstance(reading, ImuSample):
            last = estimator.state()
    flown, pushed = snapshot.state, estimator.state()
    assert pushed.t_ns == flown.t_ns
    assert pushed.velocity_m_s.tobytes() == flown.velocity_m_s.tobytes()
    assert pushed.position_m.tobytes() == flown.position_m.tobytes()
    assert pushed.covariance.tobytes() == flown.covariance.tobytes()
    track = replay(flight).track  # has the state at the last inertial sample, before what came after it
    assert last is not None
    assert track.t_ns[-1] == last.t_ns
    assert track.velocity_m_s[-1].tobytes() == last.velocity_m_s.tobytes()
    assert track.position_m[-1].tobytes() == last.position_m.tobytes()
