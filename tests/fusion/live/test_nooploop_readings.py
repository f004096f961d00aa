"""Which numbers of a frame become readings, and what is refused and counted."""

from __future__ import annotations

import msgspec
import pytest

from axialnav.fusion.live.nooploop import frames as f
from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
from axialnav.fusion.live.nooploop.readings import NLinkReadings, module_time_ms
from axialnav.fusion.readings import UwbFix, UwbRange, WallRange
from tests.fusion.live import nooploop_vectors as v


def frame(name: str) -> f.Frame:
    return NLinkDecoder().feed(v.BYTES[name])[-1]


@pytest.mark.parametrize("name", ["NodeFrame2", "NodeFrame3", "NodeFrame5", "AoaNodeFrame0"])
def test_ranges_carry_both_powers(name: str) -> None:
    readings = NLinkReadings().of(frame(name), 7)
    assert [type(r) for r in readings] == [UwbRange] * 4
    assert [r.anchor for r in readings if isinstance(r, UwbRange)] == ["0", "1", "2", "3"]
    for reading in readings:
        assert isinstance(reading, UwbRange)
        assert (reading.t_ns, reading.sensor) == (7, "uwb0")
        assert reading.rssi_dbm is not None
        assert reading.first_path_dbm is not None
        assert reading.first_path_dbm < reading.rssi_dbm


def test_absent_anchors_of_a_tag_are_no_ranges() -> None:
    readings = NLinkReadings().of(frame("TagFrame0"), 0)
    assert [(r.anchor, r.range_m, r.rssi_dbm) for r in readings if isinstance(r, UwbRange)] == [
        ("0", 3.125, None),
        ("1", 5.539, None),
        ("2", 6.861, None),
        ("3", 4.684, None),
    ]


def test_a_fix_states_its_error_only_where_the_module_knows_it() -> None:
    known = msgspec.structs.replace(frame("NodeFrame2"), position_error_m=(0.06, 0.3, 0.5))
    turned = NLinkReadings(ranges=None, fixes="uwb1")
    assert turned.of(known, 3) == [
        UwbFix(t_ns=3, sensor="uwb1", position_m=(2.782, -0.033, 1.0), sigma_m=(0.1, 0.3, 0.5))
    ]
    [unknown] = turned.of(frame("NodeFrame2"), 3)
    assert isinstance(unknown, UwbFix)
    assert unknown.sigma_m is None


def test_a_console_gives_the_ranges_of_our_tag_alone() -> None:
    turned = NLinkReadings(tag=5)
    ranges = [r.range_m for r in turned.of(frame("NodeFrame4"), 0) if isinstance(r, UwbRange)]
    assert ranges == [2.701, 1.429, 2.378, 1.33]
    assert turned.refused["another tag"] == 1


def test_an_anchor_gives_ranges_and_position_of_our_tag() -> None:
    readings = NLinkReadings(fixes="uwb1", tag=2).of(frame("AnchorFrame0"), 0)
    assert [r.range_m for r in readings if isinstance(r, UwbRange)] == [3.18, 2.98, 5.3, 5.31]
    assert [r.position_m for r in readings if isinstance(r, UwbFix)] == [(2.435, 2.399, -1.117)]


def tof(status: int, distance_m: float = 0.64, precision_m: float | None = None) -> f.TofSenseFrame0:
    return f.TofSenseFrame0(
        id=0, system_time_ms=1, distance_m=distance_m, status=status, signal=8, precision_m=precision_m
    )


@pytest.mark.parametrize(
    ("model", "taken"),
    [("tofsense", {0, 1, 7}), ("tofsense-p", {0}), ("tofsense-f", {0, 1, 7}), ("tofsense-m", {5})],
)
def test_each_model_has_its_own_status(model: str, taken: set[int]) -> None:
    turned = NLinkReadings(tof_model=model)  # type: ignore[arg-type]
    believed = {status for status in (0, 1, 5, 7, 255) if turned.of(tof(status), 0)}
    assert believed == taken | ({5} if model in {"tofsense", "tofsense-f"} else set())
    assert sum(turned.refused.values()) == 5 - len(believed)


def test_the_vehicle_s_own_list_of_status_wins() -> None:
    turned = NLinkReadings(tof_model="tofsense-p", refused_status=[2])
    assert turned.of(tof(1), 0) == [WallRange(t_ns=0, sensor="tof0", range_m=0.64)]
    assert turned.of(tof(2), 0) == []
    assert turned.refused == {"status 1": 0, "status 2": 1}


def test_precision_of_a_tofsense_f_is_its_sigma() -> None:
    [reading] = NLinkReadings().of(tof(0, 2.221, 0.06), 0)
    assert reading == WallRange(t_ns=0, sensor="tof0", range_m=2.221, sigma_m=0.06)


def test_a_tofsense_m_reads_what_is_straight_ahead() -> None:
    [reading] = NLinkReadings().of(frame("TofSenseMFrame0"), 0)
    assert isinstance(reading, WallRange)
    assert reading.range_m == pytest.approx((2.446 + 2.471) / 2)  # of 2.517, 2.471, 2.434, 2.446


def test_nothing_to_believe_is_nothing_read_and_counted() -> None:
    turned = NLinkReadings()
    nodes = (f.NodeRange(role=1, id=0, distance_m=-0.3), f.NodeRange(role=1, id=1, distance_m=0.0))
    empty = msgspec.structs.replace(frame("NodeFrame3"), ranges=nodes)
    assert turned.of(empty, 0) == turned.of(tof(0, -0.001), 0) == []
    assert turned.refused["range not positive"] == 3


def test_the_clock_of_the_module_is_its_own_where_it_sends_both() -> None:
    assert module_time_ms(frame("NodeFrame2")) == 9157
    assert module_time_ms(frame("TofSenseFrame0")) == 17858
    assert module_time_ms(frame("NodeFrame0")) is None
