"""What is converted replays to the same digest, whatever the format."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import axialnav as an
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay import cli
from axialnav.replay.convert.convert import convert
from axialnav.replay.flight import Flight, SensorTable, load_flight
from axialnav.replay.flight_cut import cut_flight
from axialnav.replay.run import replay
from axialnav.replay.sample_flights import sample_flight_path
from tests.replay.flight_texts import full_flight

FORMATS = ["a.mcap", "a.tlog", "a.bin", "a.bag", "a.ros2", "folder"]
WITH_PICTURES = ["a.mcap", "a.bag", "a.ros2", "folder"]


def equal_tables(one: SensorTable, other: SensorTable, without: set[str] = frozenset()) -> bool:  # type: ignore[assignment]
    """Same rows up to the order of equal stamps."""

    def sorted_rows(table: SensorTable) -> list[tuple[object, ...]]:
        columns = [table.columns[name] for name in sorted(table.columns) if name not in without]
        return sorted(
            str((t, *row)) for t, *row in zip(table.t_ns.tolist(), *(c.tolist() for c in columns), strict=True)
        )  # type: ignore[misc]

    kept = {name for name in one.columns if not _absent(one, name)} - without
    there = {name for name in other.columns if not _absent(other, name)} - without
    if kept != there or one.anchors != other.anchors:
        return False
    trim = {name for name in {*one.columns, *other.columns} if name not in kept} | set(without)
    without = trim
    return sorted_rows(one) == sorted_rows(other)


def _absent(table: SensorTable, name: str) -> bool:
    values = table.columns[name]
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


@pytest.mark.parametrize("name", FORMATS)
def test_every_kind_of_sensor_survives_bit_for_bit(tmp_path: Path, name: str) -> None:
    flight = load_flight(full_flight(tmp_path / "made"))
    back = load_flight(convert(flight, tmp_path / name))
    cameras = set() if name in WITH_PICTURES else {"cam0"}
    assert set(back.tables) == set(flight.tables) - cameras
    for sensor in back.tables:
        skipped = {"filename"} if sensor == "cam0" else set()
        assert equal_tables(flight.tables[sensor], back.tables[sensor], skipped), sensor
    assert (back.name, back.info, back.evaluation) == (flight.name, flight.info, flight.evaluation)
    assert back.config.surface == flight.config.surface
    assert back.config.initial == flight.config.initial
    assert {n: s for n, s in back.config.sensor.items() if n not in cameras} == {
        n: s for n, s in flight.config.sensor.items() if n not in cameras
    }
    assert flight.truth is not None
    assert back.truth is not None
    for field in ("t_ns", "position_m", "quaternion_WB", "velocity_m_s", "gyro_bias", "accel_bias"):
        assert np.array_equal(getattr(back.truth, field), getattr(flight.truth, field)), field
    assert flight.gps is not None
    assert back.gps is not None
    assert np.array_equal(back.gps.velocity_m_s, flight.gps.velocity_m_s)
    if cameras:
        assert any("camera that this format cannot carry" in drop.reason for drop in back.drops)


@pytest.mark.parametrize("name", WITH_PICTURES)
def test_pictures_come_back_pixel_for_pixel(tmp_path: Path, name: str) -> None:
    from axialnav.replay.motion import pictures

    flight = load_flight(full_flight(tmp_path / "made"))
    first = load_flight(convert(flight, tmp_path / "first.mcap"))
    back = load_flight(convert(first, tmp_path / name))
    before, after = list(pictures(flight, "cam0")), list(pictures(back, "cam0"))
    assert len(before) == len(after) == 2
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    assert back.tables["cam0"].columns["exposure_s"].tolist() == [0.002, 0.004]


@pytest.fixture(scope="module")
def sample() -> tuple[Flight, str]:
    """Twenty seconds of the flight that ships with the package, and its digest."""
    flight = cut_flight(load_flight(sample_flight_path()), 0.0, 20.0)
    return flight, replay(flight).metrics["digest"]


@pytest.mark.parametrize("name", FORMATS)
def test_a_converted_flight_replays_to_the_same_digest(tmp_path: Path, sample: tuple[Flight, str], name: str) -> None:
    flight, digest = sample
    run = replay(load_flight(convert(flight, tmp_path / name)))
    assert run.metrics["digest"] == digest


@pytest.mark.flights
@pytest.mark.slow
@pytest.mark.parametrize("name", ["a.mcap", "a.tlog", "a.bin", "a.ros2"])
def test_a_uwb_flight_replays_to_the_same_numbers(tmp_path: Path, shared: Path, name: str) -> None:
    """Ten seconds with range differences, range finder and optical flow, scored against motion capture."""
    flight = cut_flight(load_flight(shared / "flights" / "util_nlos_tdoa2_obs_flow_tof"), 0.0, 10.0)
    ours, back = replay(flight).metrics, an.replay(convert(flight, tmp_path / name)).metrics
    assert back["digest"] == ours["digest"]
    assert back["velocity_rmse_m_s"] == ours["velocity_rmse_m_s"]
    assert back["sensors"] == ours["sensors"]


def test_the_standard_messages_of_a_tlog_are_the_flight_too(tmp_path: Path, sample: tuple[Flight, str]) -> None:
    """Other tools see HIGHRES_IMU and friends; read through the default mapping they are the flight, rounded."""
    flight, _ = sample
    path = convert(flight, tmp_path / "a.tlog")
    (tmp_path / "plain.toml").write_text("")
    plain = load_flight(path, mapping=tmp_path / "plain.toml")
    for name in ("gyro_rad_s", "accel_m_s2"):
        before, after = flight.tables["imu0"].columns[name], plain.tables["imu0"].columns[name]
        assert np.abs(before @ flight.config.sensor["imu0"].rotation_BS.T - after).max() < 1e-5
    focal = flight.config.sensor["flow0"].focal_px[0]  # type: ignore[union-attr]
    scaled = plain.tables["flow0"].columns["dx_px"] * focal
    assert np.corrcoef(scaled, flight.tables["flow0"].columns["dx_px"])[0, 1] > 0.999


def test_pymavlink_reads_the_bin_that_we_write(tmp_path: Path, sample: tuple[Flight, str]) -> None:
    from pymavlink.DFReader import DFReader_binary

    flight, _ = sample
    reader = DFReader_binary(str(convert(flight, tmp_path / "a.bin")))
    first = reader.recv_match(type="IMU")
    turned = flight.config.sensor["imu0"].rotation_BS.T @ [first.GyrX, -first.GyrY, -first.GyrZ]
    assert turned == pytest.approx(flight.tables["imu0"].columns["gyro_rad_s"][0], abs=1e-6)
    counted = 1
    while reader.recv_match(type="IMU") is not None:
        counted += 1
    reader.data_map.close()
    reader.filehandle.close()
    assert counted == len(flight.tables["imu0"])


def test_the_verb_says_what_it_wrote(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full_flight(tmp_path / "made")
    assert cli.main(["convert", str(tmp_path / "made"), str(tmp_path / "out.mcap")]) == 0
    out = capsys.readouterr().out
    assert "imu0" in out
    assert "200.0 Hz" in out
    assert f"written    {tmp_path / 'out.mcap'}" in out


@pytest.mark.parametrize("name", FORMATS)
def test_nothing_is_overwritten(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    made = full_flight(tmp_path / "made")
    if name == "folder":
        shutil.copytree(made, tmp_path / name)
    else:
        (tmp_path / name).write_text("precious")
    assert cli.main(["convert", str(made), str(tmp_path / name)]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "already" in error


def test_an_unknown_ending_is_a_usage_error(tmp_path: Path) -> None:
    flight = load_flight(full_flight(tmp_path / "made"))
    with pytest.raises(ConfigError, match=r"no format has the ending '\.xlsx'"):
        convert(flight, tmp_path / "a.xlsx")
    with pytest.raises(FlightError, match="cannot be written"):
        convert(flight, tmp_path / "made" / "flight.toml" / "a.tlog")
