"""The manufacturer's published frames decode to exactly the published numbers."""

from __future__ import annotations

import struct

import msgspec
import pytest

from axialnav.fusion.live.nooploop import frames as f
from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from tests.fusion.live import nooploop_vectors as v


def one(name: str) -> f.Frame:
    [frame] = NLinkDecoder().feed(v.BYTES[name])
    assert type(frame).__name__ == name
    return frame


def single(text: str) -> tuple[float, ...]:
    """Numbers of a text as the 32-bit floats that the wire carries, at published precision."""
    return tuple(float(word) for word in text.split())


def powers(frame: f.NodeFrame3 | f.NodeFrame2) -> list[tuple[int, float, float | None, float | None]]:
    return [(r.id, r.distance_m, r.first_path_dbm, r.total_dbm) for r in frame.ranges]


def test_all_sixteen_in_one_stream() -> None:
    decoder = NLinkDecoder()
    found = decoder.feed(v.ALL)
    assert len(found) == 16
    assert decoder.status.frames == {name: 4 if name == "NodeFrame4" else 1 for name in v.BYTES}
    assert (decoder.status.skipped_bytes, decoder.status.waiting_bytes, decoder.status.damaged) == (0, 0, {})


def test_tag_frame0() -> None:
    frame = one("TagFrame0")
    assert isinstance(frame, f.TagFrame0)
    assert (frame.id, frame.role) == (1, f.Role.TAG)
    assert frame.position_m == (2.702, -0.091, 1.0)
    assert frame.velocity_m_s == (-0.0038, -0.0006, 0.0)
    assert frame.distances_m == (3.125, 5.539, 6.861, 4.684, 0.0, 0.0, 0.0, 0.0)
    assert frame.gyro_rad_s == pytest.approx(single("0.02767 0.008514 -0.045762"), abs=5e-6)
    assert frame.accel_m_s2 == pytest.approx(single("0.251265 9.74908 -0.040681"), abs=5e-6)
    assert frame.angle_deg == (144.49, 97.17, -14.68)
    assert frame.quaternion == pytest.approx(single("-0.656777 -0.125699 -0.739489 0.0512801"), abs=5e-7)
    assert frame.position_error_m == (0.11, 0.16, 2.55)
    assert (frame.local_time_ms, frame.system_time_ms, frame.voltage_v) == (44556, 71627, 4.948)
    assert frame.gyro_rad_s == struct.unpack_from("<3f", v.BYTES["TagFrame0"], 46)


def test_anchor_frame0() -> None:
    frame = one("AnchorFrame0")
    assert isinstance(frame, f.AnchorFrame0)
    assert [(n.position_m, n.distances_m) for n in frame.nodes] == [
        ((2.895, 2.419, -0.263), (3.64, 3.34, 4.9, 4.93, 0.0, 0.0, 0.0, 0.0)),
        ((2.435, 2.399, -1.117), (3.18, 2.98, 5.3, 5.31, 0.0, 0.0, 0.0, 0.0)),
    ]
    assert (frame.local_time_ms, frame.system_time_ms, frame.voltage_v) == (33313, 32000, 4.995)


@pytest.mark.parametrize("name", ["NodeFrame0", "NodeFrame6"])
def test_pass_through_data(name: str) -> None:
    frame = one(name)
    assert isinstance(frame, f.NodeFrame0)
    assert [len(node.data) for node in frame.nodes] == [9, 37]
    assert frame.nodes[0].data == bytes.fromhex("112233445566778899")


def test_node_frame1() -> None:
    frame = one("NodeFrame1")
    assert isinstance(frame, f.NodeFrame1)
    assert [node.position_m for node in frame.nodes] == [(2.911, 2.438, -0.101), (2.451, 2.373, -0.828)]
    assert (frame.system_time_ms, frame.local_time_ms, frame.voltage_v) == (33000, 34304, 4.936)


def test_node_frame2() -> None:
    frame = one("NodeFrame2")
    assert isinstance(frame, f.NodeFrame2)
    assert frame.position_m == (2.782, -0.033, 1.0)
    assert frame.velocity_m_s == (-0.0006, 0.0026, 0.0)
    assert frame.gyro_rad_s == pytest.approx(single("0.02767 0.00958 -0.04576"), abs=5e-6)
    assert frame.accel_m_s2 == pytest.approx(single("0.224942 9.73712 -0.05504"), abs=5e-6)
    assert frame.angle_deg == (90.69, 91.93, -88.48)
    assert frame.quaternion == pytest.approx(single("0.691282 0.694677 0.154792 -0.110552"), abs=5e-7)
    assert frame.position_error_m == (0.06, 0.09, 2.55)
    assert (frame.local_time_ms, frame.system_time_ms, frame.voltage_v) == (9157, 1926842, 4.973)
    assert powers(frame) == [
        (0, 3.179, -88.5, -79.5),
        (1, 5.548, -90.0, -80.5),
        (2, 6.728, -101.0, -79.5),
        (3, 4.651, -99.0, -80.0),
    ]


@pytest.mark.parametrize("name", ["NodeFrame3", "NodeFrame5"])
def test_ranges_with_powers(name: str) -> None:
    frame = one(name)
    assert isinstance(frame, f.NodeFrame3)
    assert (frame.local_time_ms, frame.system_time_ms, frame.voltage_v) == (463352, 7262319, 4.954)
    assert powers(frame) == [
        (0, 2.85, -90.5, -79.5),
        (1, 6.051, -91.0, -80.0),
        (2, 7.304, -85.0, -79.5),
        (3, 5.35, -92.0, -80.0),
    ]


def test_node_frame4_four_times() -> None:
    frames = NLinkDecoder().feed(v.BYTES["NodeFrame4"])
    last = frames[-1]
    assert len(frames) == 4
    assert isinstance(last, f.NodeFrame4)
    assert (last.local_time_ms, last.system_time_ms, last.voltage_v) == (106020, 106020, 4.44)
    assert [(tag.id, tag.voltage_v, [(r.id, r.distance_m) for r in tag.ranges]) for tag in last.tags] == [
        (2, 4.45, [(0, 2.422), (1, 1.729), (2, 2.107), (3, 1.762)]),
        (5, 3.65, [(0, 2.701), (1, 1.429), (2, 2.378), (3, 1.33)]),
    ]


def test_aoa_node_frame0() -> None:
    frame = one("AoaNodeFrame0")
    assert isinstance(frame, f.AoaNodeFrame0)
    assert (frame.id, frame.role, frame.local_time_ms, frame.system_time_ms) == (0, f.Role.TAG, 160702, 0)
    assert frame.voltage_v == 4.847
    assert [(r.distance_m, r.angle_deg) for r in frame.ranges] == [
        (0.767, 28.5),
        (0.77, 1.73),
        (1.004, 9.71),
        (1.416, -49.67),
    ]


def test_iot_frame0_shares_its_head_with_tag_frame0() -> None:
    frame = one("IotFrame0")
    assert isinstance(frame, f.IotFrame0)
    assert frame.id == 7012434
    assert [msgspec.structs.astuple(node) for node in frame.nodes] == [
        (6422602, 3, 0.096, -4.309, 0.0),
        (4718663, 172, 0.082, 55.918, 0.0),
    ]


def test_tofsense_frame0() -> None:
    frame = one("TofSenseFrame0")
    assert isinstance(frame, f.TofSenseFrame0)
    assert msgspec.structs.asdict(frame) == {
        "id": 0,
        "system_time_ms": 17858,
        "distance_m": 0.64,
        "status": 0,
        "signal": 8,
        "precision_m": None,
    }


def test_tofsense_m_frame0_is_in_micrometres() -> None:
    frame = one("TofSenseMFrame0")
    assert isinstance(frame, f.TofSenseMFrame0)
    published = [int(word) for word in v.TOF_M_PIXELS.split()]
    expected = list(zip(published[::3], published[1::3], published[2::3], strict=True))
    assert (frame.id, frame.system_time_ms, len(frame.pixels)) == (0, 51475, 64)
    assert [(round(p.distance_m * 1e3, 6), p.status, p.signal) for p in frame.pixels] == expected
