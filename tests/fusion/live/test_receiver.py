"""What gets through: damage, forgery, floods and strangers, and an exact account of what did not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live.receiver import BURST, MAX_PARSED, Receiver
from axialnav.fusion.live.security import TICKS_PER_S, Signatures, read_key, signing_ticks
from axialnav.fusion.live.sender import Sender
from tests.fusion.live.hostile import feed_mavlink

S = 1_000_000_000
KEY, OTHER = bytes(range(32)), bytes(32)
TODAY = 12 * 365 * 86_400 * TICKS_PER_S


def talker(system: int = 1, component: int = 1, key: bytes | None = None, ticks: int = TODAY) -> Any:
    packer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    if key is not None:
        packer.signing.secret_key, packer.signing.sign_outgoing, packer.signing.timestamp = key, True, ticks
    return packer


def packet(packer: Any, k: int = 0) -> bytes:
    data = mavlink.MAVLink_attitude_quaternion_message(k, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3).pack(packer)
    packer.seq = (packer.seq + 1) % 256
    return bytes(data)


def receiver(key: bytes | None = None) -> Receiver:
    return Receiver([(1, 1)], key=key, ticks=lambda: TODAY)


def test_only_listed_senders_are_heard() -> None:
    heard = receiver()
    for who in ((1, 1), (1, 2), (2, 1), (255, 190), (1, 1)):
        heard.feed(packet(talker(*who)), 0)
    assert heard.counts == {"accepted": 2, "unlisted": 3}
    assert heard.all_counts()["unlisted 255/190"] == 1


def test_a_flood_of_invented_senders_takes_no_memory() -> None:
    heard = receiver()
    for system in range(2, 250):
        for component in (3, 4):
            heard.feed(packet(talker(system, component)), 0)
    assert heard.counts["unlisted"] == 496
    assert len(heard.allow.refused) <= 65
    assert sum(heard.allow.refused.values()) == 496


def test_damage_costs_only_what_was_damaged() -> None:
    """Bit flips, truncation and garbage in a tenth of the packets of a stream: every intact one is recovered."""
    rng, packer, heard = np.random.default_rng(1), talker(), receiver()
    stream, intact = bytearray(), 0
    for k in range(2000):
        data = bytearray(packet(packer, k))
        kind = int(rng.integers(30))
        if kind == 0:
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            del data[int(rng.integers(1, len(data))) :]
        elif kind == 2:
            data[:] = rng.bytes(len(data))
        intact += kind > 2
        stream += data
    messages = [m for at in range(0, len(stream), 97) for m in heard.feed(bytes(stream[at : at + 97]), 0)]
    messages += heard.feed(bytes(300), 0)  # a false start at the end claims up to 280 bytes
    got = {m.time_boot_ms for m in messages}
    assert len(got) == len(messages) == intact
    assert heard.lost()[1, 1] == 2000 - intact
    assert heard.counts["damaged"] > 100


def test_packets_out_of_order_are_not_lost() -> None:
    packer, heard = talker(), receiver()
    packets = [packet(packer, k) for k in range(600)]
    for k in range(0, 600, 3):
        packets[k], packets[k + 1] = packets[k + 1], packets[k]
    del packets[100:110]
    for data in packets:
        heard.feed(data, 0)
    assert heard.lost() == {(1, 1): 10}


def test_with_a_key_only_signed_packets_count() -> None:
    heard = receiver(KEY)
    for key in (KEY, None, OTHER):
        heard.feed(packet(talker(key=key)), 0)
    assert heard.counts == {"accepted": 1, "bad_signature": 2}
    assert heard.all_counts()["forged"] == 1


def test_a_forged_packet_from_the_far_future_mutes_nobody() -> None:
    """pymavlink alone would refuse every later packet of the sender; ``stock`` shows that this is still so."""
    forged = packet(talker(key=OTHER, ticks=2**48 - 2))
    genuine = talker(key=KEY)
    stock = mavlink.MAVLink(None)
    stock.robust_parsing, stock.signing.secret_key = True, KEY
    heard = receiver(KEY)
    stock.parse_buffer(forged)
    heard.feed(forged, 0)
    data = packet(genuine)
    assert stock.parse_buffer(data)[0].get_type() == "BAD_DATA"
    assert [m.get_type() for m in heard.feed(data, 0)] == ["ATTITUDE_QUATERNION"]


def test_even_a_right_signature_from_the_far_future_is_refused_and_a_replayed_one_too() -> None:
    heard, genuine = receiver(KEY), talker(key=KEY)
    heard.feed(packet(talker(key=KEY, ticks=2**48 - 2)), 0)
    data = packet(genuine)
    assert len(heard.feed(data, 0)) == 1
    assert heard.feed(data, 0) == []
    old = talker(key=KEY, ticks=TODAY - 120 * TICKS_PER_S)
    old.signing.link_id = 3
    assert heard.feed(packet(old), 0) == []
    counts = heard.all_counts()
    assert (counts["far_future"], counts["replayed"]) == (1, 2)


def test_a_burst_of_bad_packets_makes_a_new_parser_and_loses_nothing_good() -> None:
    heard, packer = receiver(), talker()
    spoilt = bytearray(packet(packer))
    spoilt[-1] ^= 0xFF
    for k in range(3 * BURST):
        heard.feed(bytes(spoilt), k * S // 1000)
    assert heard.counts["parser_restarts"] == 1
    assert len(heard.feed(packet(packer), S)) == 1


def test_foreign_dialects_are_no_attack() -> None:
    heard = receiver()
    unknown = bytes([0xFD, 4, 0, 0, 0, 1, 1, 0x30, 0x75, 0, 1, 2, 3, 4, 0, 0])  # message 30000
    for k in range(2 * BURST):
        heard.feed(unknown, k)
    assert heard.counts == {"unknown": 2 * BURST}


def test_random_bytes_do_no_harm() -> None:
    rng, heard, packer = np.random.default_rng(2), receiver(), talker()
    genuine = packet(packer)
    for k in range(300):
        heard.feed(rng.bytes(1000), k * S)
        spoilt = bytearray(genuine * 3)
        for at in rng.integers(len(spoilt), size=4):
            spoilt[int(at)] = int(rng.integers(256))
        heard.feed(bytes(spoilt), k * S)
        assert len(heard._parser.buf) < 2 * MAX_PARSED
    heard.feed(bytes(600), 0)
    assert [m.get_type() for m in heard.feed(packet(packer), 0)] == ["ATTITUDE_QUATERNION"]


@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_a_million_random_and_mutated_bytes_do_no_harm(key: bytes | None) -> None:
    """Neither to the parser nor to what takes its messages: contents are arbitrary behind right checksums."""
    survived = feed_mavlink(key, 1_000_000, seed=3)
    assert survived.taken == 1_000_000
    assert (survived.came_out > 1000) == (key is None)
    assert survived.most_waiting < 4 * MAX_PARSED


def test_a_stream_that_never_pauses_at_the_end_of_a_packet_is_not_kept() -> None:
    """As from a serial port: every read ends within a packet, so that the parser's buffer is never empty."""
    packer, heard, count, rest = talker(), receiver(), 0, b""
    for k in range(2000):
        data = rest + packet(packer, k)
        rest = data[-20:]
        count += len(heard.feed(data[:-20], 0))
        assert len(heard._parser.buf) < 2 * MAX_PARSED
    assert count >= 1998


class Wire:
    """A link that keeps what is sent."""

    def __init__(self) -> None:
        self.unsent = 0
        self.data: list[bytes] = []

    def send(self, data: bytes) -> bool:
        self.data.append(data)
        return True


def test_what_we_sign_is_accepted_and_follows_a_clock_that_is_ahead() -> None:
    """An autopilot whose clock is an hour ahead of ours takes our packets once we have heard it."""
    wire = Wire()
    ours = Signatures(KEY, lambda: TODAY)
    sender = Sender(wire, system=1, component=197, signatures=ours, ticks=lambda: TODAY)  # type: ignore[arg-type]
    theirs = Receiver([(1, 197)], key=KEY, ticks=lambda: TODAY + 3600 * TICKS_PER_S)
    beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    sender.send(beat)
    assert theirs.feed(wire.data[-1], 0) == []
    signed = packet(talker(key=KEY, ticks=TODAY + 3600 * TICKS_PER_S))
    assert ours.check(bytearray(signed), 1, 1)
    for _ in range(3):
        sender.send(beat)
        assert len(theirs.feed(wire.data[-1], 0)) == 1


def test_keys_are_read_as_ground_stations_write_them(tmp_path) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n")
    assert read_key(path) == KEY
    path.write_text("tunnel twelve\n")
    assert len(read_key(path)) == 32
    path.write_text("")
    with pytest.raises(ConfigError, match="is empty"):
        read_key(path)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_key(tmp_path / "none")
    assert signing_ticks() > 10 * 365 * 86_400 * TICKS_PER_S
