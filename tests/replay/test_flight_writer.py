"""What is written reads back equal, number for number."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Flow, Imu, Uwb
from axialnav.replay.flight import Flight, SensorTable, load_flight
from axialnav.replay.flight_cut import cut_flight
from axialnav.replay.flight_writer import write_flight
from tests.replay.flight_texts import UWB_YAML, full_flight, picture, standing_flight, write_sensor


def assert_same_flight(one: Flight, other: Flight) -> None:
    """Equal to the last bit, NaN equal to NaN; the folder and the drops may differ."""
    assert (one.name, one.info, one.config, one.evaluation) == (other.name, other.info, other.config, other.evaluation)
    assert list(one.tables) == list(other.tables)
    for name, table in one.tables.items():
        assert (table.anchors, table.unlisted) == (other.tables[name].anchors, other.tables[name].unlisted)
        assert_same_arrays(
            {"t": table.t_ns, **table.columns}, {"t": other.tables[name].t_ns, **other.tables[name].columns}
        )
    for mine, theirs in ((one.truth, other.truth), (one.gps, other.gps)):
        assert (mine is None) == (theirs is None)
        if mine is not None and theirs is not None:
            assert_same_arrays(vars(mine), vars(theirs))


def assert_same_arrays(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    for name, array in one.items():
        is_text = array is not None and array.dtype.kind == "U"  # of which numpy also compares the longest length
        np.testing.assert_array_equal(array, other[name], err_msg=name, strict=not is_text)


def test_every_kind_of_sensor_reads_back_equal(tmp_path: Path) -> None:
    flight = load_flight(full_flight(tmp_path / "first"))
    copy = load_flight(write_flight(flight, tmp_path / "copy"))
    assert_same_flight(flight, copy)
    assert copy.drops == ()
    assert copy.image_path("cam0", "a b.png").read_bytes() == picture("a b.png")


def test_a_written_copy_is_a_fixed_point(tmp_path: Path) -> None:
    first = write_flight(load_flight(full_flight(tmp_path / "first")), tmp_path / "second")
    second = write_flight(load_flight(first), tmp_path / "third")
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(second) for path in second.rglob("*") if path.is_file())
    for file in files:
        assert (first / file).read_bytes() == (second / file).read_bytes(), file


def test_rows_without_a_listed_anchor_survive(tmp_path: Path) -> None:
    standing_flight(tmp_path / "first")
    rows = ["1100000000,23,3.5", "1100000000,0x1F,3.25", "1110000000,7,1e-300"]
    write_sensor(tmp_path / "first", "uwb0", rows, UWB_YAML.format(kind="range"))
    flight = load_flight(tmp_path / "first")
    assert_same_flight(flight, load_flight(write_flight(flight, tmp_path / "copy")))


finite = st.floats(-1e5, 1e5)
moments = st.integers(-(10**18), 10**18)


@settings(max_examples=40, deadline=None)
@given(
    start_ns=moments,
    rows=st.lists(
        st.tuples(st.integers(1, 10**8), st.floats(1e-6, 10.0), finite, finite | st.just(np.nan)), max_size=8
    ),
    anchors=st.lists(st.integers(-1, 1), max_size=8),
)
def test_any_numbers_read_back_equal(
    start_ns: int,
    rows: list[tuple[int, float, float, float]],
    anchors: list[int],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    steps = np.array([row[0] for row in rows], dtype=np.int64)
    t_ns = start_ns + np.cumsum(steps)
    imu_ns = start_ns + np.arange(2, dtype=np.int64) * 10**9
    values = np.array([row[1:] for row in rows]).reshape(-1, 3)
    uwb_ns = start_ns + np.arange(len(anchors), dtype=np.int64)
    nothing = np.full(len(rows), np.nan)
    index = np.array(anchors, dtype=np.int64)
    order = np.argsort(t_ns, kind="stable")
    tables = {
        "imu0": SensorTable(imu_ns, {"gyro_rad_s": np.full((2, 3), 0.1), "accel_m_s2": np.full((2, 3), 1 / 3)}),
        "flow0": SensorTable(
            t_ns[order],
            {
                "window_s": values[:, 0],
                "dx_px": values[:, 1],
                "dy_px": values[:, 2],
                "sigma_px": nothing,
                "quality": nothing,
                "sigma_dy_px": nothing,
                "coherence_px": nothing,
            },
        ),
        "uwb0": SensorTable(
            uwb_ns,
            {
                "anchor": index,
                **dict.fromkeys(("range_m", "sigma_m", "rssi_dbm", "first_path_dbm"), np.full(len(anchors), 0.5)),
            },
            ("é", "B 2"),
            dict.fromkeys(np.flatnonzero(index < 0).tolist(), ("none",)),
        ),
    }
    specs = {
        "imu0": Imu(gyro_noise_density=1e-5),
        "flow0": Flow(focal_px=(419.0, 1 / 3), surface="floor"),
        "uwb0": Uwb(measurement="range", anchors={"é": (0.1, 0.2, 0.3), "B 2": (1.0, 1e-7, 0.0)}),
    }
    folder = tmp_path_factory.mktemp("any") / "flight"
    flight = Flight("any", folder, {"note": 'línea # 1, [x] = "y"'}, Config(sensor=specs), tables)
    assert_same_flight(flight, load_flight(write_flight(flight, folder)))


def test_an_existing_flight_is_never_overwritten(tmp_path: Path) -> None:
    flight = load_flight(standing_flight(tmp_path / "first"))
    before = (tmp_path / "first" / "mav0" / "imu0" / "data.csv").read_bytes()
    with pytest.raises(FlightError, match=r"holds a flight already .*remove it or choose another folder"):
        write_flight(flight, tmp_path / "first")
    assert (tmp_path / "first" / "mav0" / "imu0" / "data.csv").read_bytes() == before


def test_images_already_in_place_are_left_alone(tmp_path: Path) -> None:
    """A simulator renders into the folder first and writes the tables afterwards."""
    flight = load_flight(full_flight(tmp_path / "first"))
    images = tmp_path / "second" / "mav0" / "cam0" / "data"
    images.mkdir(parents=True)
    (images / "2.png").write_bytes(b"rendered")
    write_flight(flight, tmp_path / "second")
    assert (images / "2.png").read_bytes() == b"rendered"
    assert (images / "a b.png").read_bytes() == picture("a b.png")


def test_an_anchor_that_a_csv_file_cannot_hold_is_refused(tmp_path: Path) -> None:
    standing_flight(tmp_path / "first")
    write_sensor(tmp_path / "first", "uwb0", ["1100000000,7,3.5"], UWB_YAML.format(kind="range"))
    flight = load_flight(tmp_path / "first")
    table = dataclasses.replace(flight.tables["uwb0"], anchors=("7,8", "9", "11"))
    renamed = dataclasses.replace(flight, tables={**flight.tables, "uwb0": table})
    with pytest.raises(FlightError, match="anchor '7,8' cannot stand in a CSV file"):
        write_flight(renamed, tmp_path / "copy")


def test_a_cut_keeps_stamps_and_moves_the_scoring_window(tmp_path: Path) -> None:
    flight = load_flight(full_flight(tmp_path / "first"))
    cut = cut_flight(flight, 0.5, 1.5, name="middle")
    assert cut.name == "middle"
    assert cut.tables["imu0"].t_ns[[0, -1]].tolist() == [1_500_000_000, 2_500_000_000]
    assert cut.evaluation == (0.0, 1.0)
    assert cut.config.initial is None  # it belonged to the old beginning
    for name, table in flight.tables.items():
        inside = (table.t_ns >= 1_500_000_000) & (table.t_ns <= 2_500_000_000)
        for field, column in table.columns.items():
            np.testing.assert_array_equal(cut.tables[name].columns[field], column[inside])
    assert cut.truth is not None
    assert flight.truth is not None
    np.testing.assert_array_equal(cut.truth.position_m, flight.truth.position_m[50:151])
    assert_same_flight(cut, load_flight(write_flight(cut, tmp_path / "cut")))


def test_a_cut_from_the_start_keeps_the_first_state(tmp_path: Path) -> None:
    flight = load_flight(full_flight(tmp_path))
    cut = cut_flight(flight, 0.0, 1.0)
    assert msgspec.to_builtins(cut.config) == msgspec.to_builtins(flight.config)
    assert cut.evaluation == (0.25, 1.0)
    with pytest.raises(FlightError, match="no IMU sample from 5 s to 9 s"):
        cut_flight(flight, 5.0, 9.0)
