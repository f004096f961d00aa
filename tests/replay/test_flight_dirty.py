"""One bad row costs one row, and every row that is left out is counted and named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from axialnav.replay.flight import Drop, Flight, load_flight
from tests.replay.flight_texts import (
    FLOW_YAML,
    IMU_HEADER,
    IMU_ROWS,
    STEP_NS,
    TOF_YAML,
    UWB_YAML,
    imu_lines,
    standing_flight,
    write_sensor,
)

Lines = list[str]


def the_drop(flight: Flight, sensor: str, reason: str) -> Drop:
    """The one drop of ``sensor`` whose reason contains ``reason``."""
    found = [drop for drop in flight.drops if drop.sensor == sensor and reason in drop.reason]
    assert len(found) == 1, f"wanted one {sensor!r} drop with {reason!r}, have {flight.drops}"
    return found[0]


def with_cell(lines: Lines, row: int, column: int, text: str) -> Lines:
    cells = lines[row].split(",")
    cells[column] = text
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


# name -> (change of the clean rows, phrase of the reason, rows lost, first line named)
DIRT: dict[str, tuple[Callable[[Lines], Lines], str, int, int]] = {
    "NaN": (lambda r: with_cell(with_cell(r, 4, 2, "nan"), 9, 2, "NaN"), "is empty or NaN", 2, 6),
    "empty value": (lambda r: with_cell(r, 4, 2, ""), "is empty or NaN", 1, 6),
    "infinite": (lambda r: with_cell(r, 4, 4, "inf"), "a_RS_S_x outside -2000..2000 m s^-2", 1, 6),
    "absurd": (lambda r: with_cell(r, 4, 1, "-1e9"), "w_RS_S_x outside -200..200 rad s^-1", 1, 6),
    "not a number": (lambda r: with_cell(r, 7, 3, "0.1.2"), "not a number", 1, 9),
    "stamp in other digits": (lambda r: with_cell(r, 3, 0, "\u0663"), "timestamp is not a whole number", 1, 5),
    "Python-only number": (lambda r: with_cell(r, 7, 3, "1_0"), "not a number", 1, 9),
    "short": (lambda r: [*r[:5], "1025000000,0.0", *r[6:]], "row too short", 1, 7),
    "cut off at the end": (lambda r: [*r[:-1], r[-1][:12]], "row too short", 1, 401),
    "two rows in one line": (lambda r: [*r[:5], r[5] + r[6], *r[7:]], "row too long", 1, 7),
    "stamp in seconds": (lambda r: with_cell(r, 3, 0, "1.015"), "timestamp is not a whole number", 1, 5),
    "stamp beyond 2**62": (lambda r: with_cell(r, 3, 0, str(2**62)), "timestamp is not a whole number", 1, 5),
    "stamp of 30 digits": (lambda r: with_cell(r, 3, 0, "9" * 30), "timestamp is not a whole number", 1, 5),
    "twice": (lambda r: [*r[:6], r[5], r[5], *r[6:]], "duplicate row", 2, 8),
    "two values for a stamp": (
        lambda r: [*r[:6], r[5].replace("9.81", "9.71"), *r[6:]],
        "other values for a stamp already read",
        1,
        8,
    ),
    "stamp of zero": (lambda r: with_cell(r, 100, 0, "0"), "stamp leaves its neighbours", 1, 102),
    "stamp 5 s ahead": (lambda r: with_cell(r, 100, 0, "6500000000"), "stamp leaves its neighbours", 1, 102),
    "last stamp an hour ahead": (lambda r: with_cell(r, 399, 0, "3601000000000"), "far from the rest", 1, 401),
}


@pytest.mark.parametrize("dirt", DIRT)
def test_dirty_imu_rows_are_left_out_counted_and_named(dirt: str, tmp_path: Path) -> None:
    change, reason, lost, first_line = DIRT[dirt]
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *change(imu_lines())], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    drop = the_drop(flight, "imu0", reason)
    assert drop.count == lost
    assert drop.example.startswith(f"line {first_line}: ")
    kept = flight.tables["imu0"].columns["gyro_rad_s"][:, 2] * 1e4
    clean = set(range(IMU_ROWS))
    assert clean >= set(np.rint(kept).astype(int).tolist())
    # every undamaged row is there, once: duplicates cost nothing, damage costs its row (two where lines ran together)
    assert len(kept) == IMU_ROWS - {"duplicate row": 0, "other values for a stamp already read": 0}.get(
        reason, lost + (dirt == "two rows in one line")
    )
    assert len(list(flight.readings())) == len(kept)
    assert sum(drop.count for drop in flight.drops) == lost


HARMLESS: dict[str, Callable[[Lines], bytes]] = {
    "byte order mark": lambda r: b"\xef\xbb\xbf" + "\n".join([IMU_HEADER, *r]).encode(),
    "CRLF": lambda r: "\r\n".join([IMU_HEADER, *r, ""]).encode(),
    "CR": lambda r: "\r".join([IMU_HEADER, *r, ""]).encode(),
    "spaces after commas": lambda r: "\n".join([IMU_HEADER, *(line.replace(",", ", ") for line in r)]).encode(),
    "blank lines": lambda r: "\n\n".join([IMU_HEADER, *r]).encode(),
    "lines of spaces": lambda r: "\n   \n".join([IMU_HEADER, *r]).encode(),
    "remarks": lambda r: "\n".join(["# flown by hand", IMU_HEADER, "# start", *r, "# end"]).encode(),
    "remarks in lines": lambda r: "\n".join([IMU_HEADER, *(line + " # good" for line in r)]).encode(),
    "trailing commas": lambda r: "\n".join([IMU_HEADER, *(line + "," for line in r)]).encode(),
    "no header": lambda r: "\n".join(r).encode(),
    "header without #": lambda r: "\n".join([IMU_HEADER[1:], *r]).encode(),
    "other header names": lambda r: "\n".join(["#t,wx,wy,wz,ax,ay,az", *r]).encode(),
    "header repeated": lambda r: "\n".join([IMU_HEADER[1:], *r[:50], IMU_HEADER[1:], *r[50:]]).encode(),
    "stamps as numpy.savetxt writes them": lambda r: "\n".join(
        [IMU_HEADER, *(f"{float(s.partition(',')[0]):.18e},{s.partition(',')[2]}" for s in r)]
    ).encode(),
    "stamps written as floats": lambda r: "\n".join([IMU_HEADER, *(s.replace(",", ".0,", 1) for s in r)]).encode(),
}


@pytest.mark.parametrize("form", HARMLESS)
def test_harmless_forms_read_the_same_and_drop_nothing(form: str, tmp_path: Path) -> None:
    clean = load_flight(standing_flight(tmp_path / "clean")).tables["imu0"]
    path = write_sensor(tmp_path / "other", "imu0", [], "sensor_type: imu\nrate_hz: 200\n")
    path.write_bytes(HARMLESS[form](imu_lines()))
    flight = load_flight(tmp_path / "other")
    assert flight.drops == ()
    np.testing.assert_array_equal(flight.tables["imu0"].t_ns, clean.t_ns)
    for name, column in clean.columns.items():
        np.testing.assert_array_equal(flight.tables["imu0"].columns[name], column)


def test_columns_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    lines = [
        "#timestamp [ns],ax,ay,az,temperature [C],wx,wy,wz",
        "1000000000,1,2,3,40,0.1,0.2,0.3",
        "1005000000,1,2,3,40,0,0,0",
    ]
    write_sensor(tmp_path, "imu0", lines)
    flight = load_flight(tmp_path)
    reading = next(iter(flight.readings()))
    assert reading.accel_m_s2 == (1.0, 2.0, 3.0)
    assert reading.gyro_rad_s == (0.1, 0.2, 0.3)
    assert the_drop(flight, "imu0", "column not known").example == "temperature"


def test_strange_names_are_taken_in_the_documented_order_and_noted(tmp_path: Path) -> None:
    write_sensor(tmp_path, "imu0", ["#timestamp [ns],g1,g2,g3,b1,b2,b3", *imu_lines()], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    assert the_drop(flight, "imu0", "taken in the documented order").example == "g1"
    assert flight.tables["imu0"].columns["accel_m_s2"][0].tolist() == [0.0, 0.0, 9.81]


def test_shuffled_rows_are_sorted_and_the_shuffle_is_named(tmp_path: Path) -> None:
    rows = imu_lines()
    order = np.random.default_rng(1).permutation(len(rows))
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *(rows[i] for i in order)], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    drop = the_drop(flight, "imu0", "out of time order: sorted, kept")
    best = np.maximum.accumulate(order)
    assert drop.count == int(np.count_nonzero(order < best))
    np.testing.assert_array_equal(flight.tables["imu0"].columns["gyro_rad_s"][:, 2], np.arange(IMU_ROWS) / 1e4)


def test_a_file_pasted_twice_reads_once(tmp_path: Path) -> None:
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *imu_lines(), IMU_HEADER, *imu_lines()], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    assert len(flight.tables["imu0"]) == IMU_ROWS
    assert the_drop(flight, "imu0", "duplicate row").count == IMU_ROWS


def test_uwb_ranges_to_several_anchors_share_a_stamp_and_all_stay(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    rows = [
        "1100000000,7,3.23",
        "1100000000,9,4.15",
        "1100000000,11,2.5",
        "1200000000,7,3.23",
        "1200000000,9,4.15",
        "1200000000,7,3.23",  # the same again
        "1200000000,9,4.95",  # one anchor, one stamp, two answers: the first counts
    ]
    write_sensor(tmp_path, "uwb0", ["#timestamp [ns],anchor,range [m]", *rows], UWB_YAML.format(kind="range"))
    flight = load_flight(tmp_path)
    table = flight.tables["uwb0"]
    assert table.columns["range_m"].tolist() == [3.23, 4.15, 2.5, 3.23, 4.15]
    assert table.columns["anchor"].tolist() == [0, 1, 2, 0, 1]
    duplicate, conflict = the_drop(flight, "uwb0", "duplicate row"), the_drop(flight, "uwb0", "other values")
    assert (duplicate.count, duplicate.example) == (1, "line 7: 1200000000,7,3.23")
    assert (conflict.count, conflict.example) == (1, "line 8: 1200000000,9,4.95")


def test_rows_of_unlisted_anchors_are_kept_for_the_filter_to_refuse(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    rows = [
        "1100000000,7,9,0.5",
        "1110000000,7,23,0.5",
        "1120000000,0x1F,9,0.5",
        "1130000000,9,9,0.5",
        "1140000000,,9,1",
    ]
    write_sensor(
        tmp_path, "uwb0", ["#timestamp [ns],anchor_a,anchor_b,difference [m]", *rows], UWB_YAML.format(kind="tdoa")
    )
    flight = load_flight(tmp_path)
    table = flight.tables["uwb0"]
    assert table.columns["anchor_a"].tolist() == [0, 0, -1]
    assert table.columns["anchor_b"].tolist() == [1, -1, 1]
    pairs = [(r.anchor_a, r.anchor_b) for r in flight.readings() if r.sensor == "uwb0"]
    assert pairs == [("7", "9"), ("7", "23"), ("0x1F", "9")]
    assert the_drop(flight, "uwb0", "anchor not in sensor.yaml").count == 2
    assert the_drop(flight, "uwb0", "are the same").example == "line 5: 1130000000,9,9,0.5"
    assert the_drop(flight, "uwb0", "anchor_a is empty").count == 1
    other = table.renumbered(("23", "9", "7"))
    assert other.columns["anchor_a"].tolist() == [2, 2, -1]
    assert other.columns["anchor_b"].tolist() == [1, 0, 1]
    assert other.anchor_names("anchor_a") == ["7", "7", "0x1F"]
    assert other.renumbered(table.anchors).columns["anchor_b"].tolist() == [1, -1, 1]


@pytest.mark.parametrize("spelling", ["7", "007", "7.0", " 7 "])
def test_one_anchor_may_be_spelt_in_several_ways(spelling: str, tmp_path: Path) -> None:
    standing_flight(tmp_path)
    write_sensor(
        tmp_path,
        "uwb0",
        ["#timestamp [ns],anchor,range [m]", f"1100000000,{spelling},3.23"],
        UWB_YAML.format(kind="range"),
    )
    assert load_flight(tmp_path).tables["uwb0"].columns["anchor"].tolist() == [0]


def test_no_anchors_at_all_is_said_and_the_rest_stays_usable(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    write_sensor(
        tmp_path,
        "uwb0",
        ["#timestamp [ns],anchor,range [m]", "1100000000,7,3.2"],
        "sensor_type: uwb\nmeasurement: range\n",
    )
    flight = load_flight(tmp_path)
    assert "lists no anchors" in the_drop(flight, "uwb0", "lists no anchors").reason
    assert flight.tables["uwb0"].columns["anchor"].tolist() == [-1]


def test_values_outside_a_sensors_limits_of_sense(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    flow = ["1100000000,0.01,1,1,50", "1110000000,0,1,1,50", "1120000000,0.01,1,,", "1130000000,0.01,2e5,1,50"]
    write_sensor(tmp_path, "flow0", ["#timestamp [ns],window [s],dx [px],dy [px],quality []", *flow], FLOW_YAML)
    tof = ["1100000000,-0.5,0.1", "1110000000,1.5,0", "1120000000,1.5,", "1130000000,0.01,0.2"]
    write_sensor(tmp_path, "tof0", ["#timestamp [ns],range [m],sigma [m]", *tof], TOF_YAML)
    flight = load_flight(tmp_path)
    assert the_drop(flight, "flow0", "window outside 1e-06..10 s").count == 1
    assert the_drop(flight, "flow0", "dx outside").example == "line 5: 1130000000,0.01,2e5,1,50"
    assert the_drop(flight, "tof0", "range outside 0..100000 m").count == 1
    assert the_drop(flight, "tof0", "sigma outside the positive finite numbers m").count == 1
    readings = {name: [r for r in flight.readings() if r.sensor == name] for name in ("flow0", "tof0")}
    assert [(r.dy_px, r.quality) for r in readings["flow0"]] == [(1.0, 50.0), (None, None)]
    # below range_min_m is for the filter to judge, not for the reader
    assert [(r.range_m, r.sigma_m) for r in readings["tof0"]] == [(1.5, None), (0.01, 0.2)]


def test_truth_with_broken_quaternions_loses_those_rows(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    rows = ["1000000000,0,0,0,1,0,0,0,0,0,0", "1010000000,0,0,0,0,0,0,0,0,0,0", "1020000000,0,0,0,0.6,0,0.8,0,0,0,0"]
    write_sensor(tmp_path, "state_groundtruth_estimate0", rows)
    flight = load_flight(tmp_path)
    assert flight.truth is not None
    assert flight.truth.t_ns.tolist() == [1_000_000_000, 1_020_000_000]
    assert the_drop(flight, "state_groundtruth_estimate0", "quaternion not of length 1").count == 1


def test_truth_without_velocities_says_that_they_cannot_be_scored(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    write_sensor(tmp_path, "state_groundtruth_estimate0", ["1000000000,0,0,0,1,0,0,0"])
    flight = load_flight(tmp_path)
    assert flight.truth is not None
    assert np.isnan(flight.truth.velocity_m_s).all()
    assert the_drop(flight, "state_groundtruth_estimate0", "no velocity columns").count == 1


def test_a_sensor_on_another_clock_is_left_out_and_the_clock_suspected(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    epoch_ns = 1_700_000_000_000_000_000
    rows = [f"{epoch_ns + i * STEP_NS},1.5" for i in range(100)]
    write_sensor(tmp_path, "tof0", ["#timestamp [ns],range [m]", *rows], TOF_YAML)
    flight = load_flight(tmp_path)
    assert the_drop(flight, "tof0", "outside the IMU's time: another clock?").count == 100
    assert the_drop(flight, "tof0", "no usable row").count == 1
    assert len(flight.tables["tof0"]) == 0
    assert "tof0" in flight.config.sensor


def test_a_pause_of_minutes_is_a_pause_and_not_a_clock_jump(tmp_path: Path) -> None:
    later = imu_lines(start_ns=120_000_000_000)
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *imu_lines(), *later], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    assert len(flight.tables["imu0"]) == 2 * IMU_ROWS
    assert flight.drops == ()


def test_files_joined_in_the_wrong_order_are_put_right(tmp_path: Path) -> None:
    later = imu_lines(start_ns=20_000_000_000)
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *later, *imu_lines()], "sensor_type: imu\n")
    flight = load_flight(tmp_path)
    assert len(flight.tables["imu0"]) == 2 * IMU_ROWS
    assert the_drop(flight, "imu0", "out of time order").count == IMU_ROWS


def test_accelerations_in_g_are_remarked(tmp_path: Path) -> None:
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *(line.replace("9.81", "1.001") for line in imu_lines())])
    assert "look like g" in the_drop(load_flight(tmp_path), "imu0", "look like g").reason


def test_stamps_of_1e18_keep_every_nanosecond(tmp_path: Path) -> None:
    start_ns = 1_403_636_579_758_555_393  # a float64 would round this
    write_sensor(tmp_path, "imu0", [IMU_HEADER, *imu_lines(start_ns=start_ns)], "sensor_type: imu\n")
    write_sensor(tmp_path, "tof0", ["#timestamp [ns],range [m]", f"{start_ns + 1},1.5", "x,y"], TOF_YAML)
    flight = load_flight(tmp_path)
    assert flight.tables["imu0"].t_ns[0] == start_ns
    assert flight.tables["tof0"].t_ns[0] == start_ns + 1  # by the slow way too
