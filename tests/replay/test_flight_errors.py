"""What cannot be used gets one line: what, value, limit, way out."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from axialnav.fusion.errors import FlightError
from axialnav.replay.flight import load_flight
from tests.replay.flight_texts import FLOW_YAML, IMU_HEADER, TOF_YAML, imu_lines, standing_flight, write_sensor


def one_line(path: Path) -> str:
    """Message of the error that loading ``path`` ends in."""
    with pytest.raises(FlightError) as caught:
        load_flight(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


def flight_toml(text: str) -> Callable[[Path], object]:
    return lambda flight: (flight / "flight.toml").write_text(text, encoding="utf-8")


def imu_yaml(text: str) -> Callable[[Path], object]:
    return lambda flight: (flight / "mav0" / "imu0" / "sensor.yaml").write_text(text, encoding="utf-8")


def imu_csv(*lines: str) -> Callable[[Path], object]:
    return lambda flight: write_sensor(flight, "imu0", list(lines), "sensor_type: imu\n")


def tof(yaml: str, *lines: str) -> Callable[[Path], object]:
    return lambda flight: write_sensor(flight, "tof0", list(lines), yaml)


ERRORS: dict[str, tuple[Callable[[Path], object], str]] = {
    "empty IMU file": (imu_csv(), r"no usable IMU sample.*found: imu0.*imu0: no usable row"),
    "IMU header only": (imu_csv(IMU_HEADER), r"no usable IMU sample"),
    "all rows bad": (imu_csv(IMU_HEADER, *["1,2"] * 9), r"no usable IMU sample.*row too short \(needs 7 values\)"),
    "no IMU file": (
        lambda flight: (flight / "mav0" / "imu0" / "data.csv").unlink(),
        r"no usable IMU sample.*imu0: no data.csv.*needs at least imu0/data.csv, cam0/data.csv or att0/data.csv",
    ),
    "columns missing": (imu_csv("1,2,3", "2,2,3"), r"imu0/data.csv: 3 columns, needs at least 7: timestamp, w_RS_S_x"),
    "column missing by name": (
        imu_csv("#timestamp [ns],wx,wy,wz,ax,ay,aq", "1,0,0,0,0,0,9.8"),
        r"imu0/data.csv: no column `a_RS_S_z` among wx, wy, wz, ax, ay, aq; correct the header",
    ),
    "column misspelt": (
        tof(TOF_YAML, "#timestamp [ns],sigma [m],rnge [m]", "1,1,1"),
        r"tof0/data.csv: no column `range` \(is `rnge` meant\?\)",
    ),
    "stamp not first": (
        imu_csv("#wx,wy,wz,ax,ay,az,timestamp [ns]", *imu_lines()),
        r"imu0.*first column must be the timestamp",
    ),
    "millimetres": (
        tof(TOF_YAML, "#timestamp [ns],range [mm]", "1000000000,1500"),
        r"tof0/data.csv: column `range` is in \[mm\], must be in \[m\]; convert the file",
    ),
    "semicolons": (
        imu_csv(*(line.replace(",", ";") for line in imu_lines())),
        r"imu0/data.csv: .* by semicolons, must be",
    ),
    "decimal commas": (
        imu_csv(*(line.replace(",", ";").replace(".", ",") for line in imu_lines())),
        r"imu0/data.csv: values are separated by semicolons, must be by commas; convert the file",
    ),
    "tabs": (
        imu_csv(*(line.replace(",", "\t") for line in imu_lines())),
        r"imu0/data.csv: .* by tabs, must be by commas",
    ),
    "row numbers first": (
        imu_csv("," + IMU_HEADER[1:], *(f"{i},{line}" for i, line in enumerate(imu_lines()))),
        r"imu0/data.csv: the first column must be the timestamp \[ns\], is ``; reorder the file",
    ),
    "degrees": (
        imu_csv("#timestamp [ns],wx [deg/s],wy,wz,ax,ay,az", "1,0,0,0,0,0,9.8"),
        r"column `wx` is in \[deg/s\], must be in \[rad s\^-1\]",
    ),
    "seconds": (
        imu_csv(IMU_HEADER.replace("[ns]", "[s]"), *imu_lines()),
        r"`timestamp` is in \[s\], must be in \[ns\]",
    ),
    "microseconds unsaid": (
        imu_csv(IMU_HEADER, *(line.replace("000,", ",", 1) for line in imu_lines())),
        r"imu0/data.csv: the median step between stamps is 5000 ns, must be over 20000 ns; .*convert",
    ),
    "clock starts again": (
        imu_csv(IMU_HEADER, *imu_lines(), *imu_lines(start_ns=1_002_000_000)),
        r"imu0/data.csv: the clock starts again at line 402: 2\.0 s back, and 2\.0 s are covered twice.*split",
    ),
    "mirrored mounting": (
        imu_yaml("sensor_type: imu\nT_BS: [1,0,0,0, 0,1,0,0, 0,0,-1,0, 0,0,0,1]\n"),
        r"imu0/sensor.yaml: T_BS must hold a right-handed rotation.*det R is -1; check rows and signs",
    ),
    "short matrix": (
        imu_yaml("T_BS: [1, 0, 0]\n"),
        r"imu0/sensor.yaml: Expected `array` of length >= 16, at T_BS|T_BS",
    ),
    "infinite lever arm": (
        imu_yaml("T_BS: [1,0,0,inf, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"),
        r"imu0/sensor.yaml: T_BS.3 must be a finite number",
    ),
    "negative noise": (
        imu_yaml("gyroscope_noise_density: -1\n"),
        r"imu0/sensor.yaml: .*> 0.0.*gyroscope_noise_density",
    ),
    "word for a number": (imu_yaml("rate_hz: fast\n"), r"imu0/sensor.yaml: Expected `float.*at `rate_hz`; is 'fast'"),
    "not YAML": (imu_yaml("T_BS: [1, 0\nrate_hz: 3\n"), r"imu0/sensor.yaml: not valid YAML in line 2: "),
    "a list in sensor.yaml": (imu_yaml("- 1\n"), r"imu0/sensor.yaml: must hold `key: value` lines, holds a list"),
    "unknown law": (
        lambda f: write_sensor(f, "blur0", [], "intrinsics: [1, 1]\nsurface: wall\nlaw: guess\n"),
        r"blur0/sensor.yaml: Invalid enum value 'guess', at `law`",
    ),
    "not TOML": (flight_toml("[flight\n"), r"flight.toml: not valid TOML: .*line 1"),
    "unknown table": (flight_toml("[wrld]\n"), r"flight.toml: unknown key `wrld`; did you mean `world`\?"),
    "unknown key": (
        flight_toml("[world]\ngravity = 9.8\n"),
        r"flight.toml: unknown key `world.gravity`; did you mean `gravity_m_s2`\?",
    ),
    "wrong type": (
        flight_toml("[world]\ngravity_m_s2 = 'heavy'\n"),
        r"flight.toml: Expected `float`, got `str`, at `world.gravity_m_s2`",
    ),
    "gravity of 981": (
        flight_toml("[world]\ngravity_m_s2 = 981\n"),
        r"flight.toml: .*<= 30.0, at `world.gravity_m_s2`",
    ),
    "NaN position": (
        flight_toml("[initial]\nposition_m = [0, nan, 0]\n"),
        r"flight.toml: initial.position_m.1 must be a finite number",
    ),
    "long axis": (
        flight_toml("[corridor]\naxis = [1, 1, 0]\n"),
        r"flight.toml: corridor.axis has length 1.414, must be 1 \(tolerance 0.001\); divide",
    ),
    "long normal": (
        flight_toml("[surface.floor]\nnormal = [0, 0, 2]\n"),
        r"flight.toml: surface normal must have length 1",
    ),
    "window upside down": (
        flight_toml("[evaluation]\nstart_s = 5\nend_s = 5.0\n"),
        r"flight.toml: evaluation.end_s is 5, must be after start_s = 5",
    ),
    "flight.toml in Latin-1": (
        lambda flight: (flight / "flight.toml").write_bytes(b'[flight]\nname = "W\xe4nde"\n'),
        r"flight.toml: cannot be read: 'utf-8'",
    ),
}


@pytest.mark.parametrize("case", ERRORS)
def test_one_clear_line(case: str, tmp_path: Path) -> None:
    spoil, pattern = ERRORS[case]
    spoil(standing_flight(tmp_path))
    message = one_line(tmp_path)
    assert re.search(pattern, message), message


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    assert "no such file or folder; give a flight folder" in one_line(tmp_path / "nowhere")


def test_a_file_instead_of_a_folder(tmp_path: Path) -> None:
    path = standing_flight(tmp_path) / "mav0" / "imu0" / "data.csv"
    assert "is a text file, not a log; what is read: flight folder" in one_line(path)


def test_one_folder_too_high_names_the_right_one(tmp_path: Path) -> None:
    standing_flight(tmp_path / "flight_7")
    assert f"is {tmp_path / 'flight_7'} meant?" in one_line(tmp_path)


def test_a_folder_of_other_things(tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    assert "holds no mav0/" in one_line(tmp_path)


def test_an_empty_flight(tmp_path: Path) -> None:
    (tmp_path / "mav0").mkdir()
    assert "(found: nothing)" in one_line(tmp_path)


def test_a_flow_sensor_without_its_surface_is_left_out_and_named(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    yaml = FLOW_YAML.replace("surface: floor", "surfce: floor")
    write_sensor(tmp_path, "flow0", ["#timestamp [ns],window [s],dx [px],dy [px]", "1100000000,0.01,1,1"], yaml)
    flight = load_flight(tmp_path)
    assert "flow0" not in flight.tables
    assert "flow0" not in flight.config.sensor
    assert [(drop.sensor, drop.reason, drop.example) for drop in flight.drops] == [
        ("flow0", "unknown key in sensor.yaml, not used", "surfce: floor; is `surface` meant?"),
        ("flow0", "sensor.yaml says no `surface`, which sensor_type optical_flow needs: left out", "flow0"),
    ]


def test_frames_alone_are_a_flight(tmp_path: Path) -> None:
    """The camera folder of a slider has no IMU; its frames can still be measured."""
    yaml = "sensor_type: camera\nresolution: [240, 180]\nintrinsics: [335, 335, 130, 99]\n"
    write_sensor(tmp_path, "cam0", ["#timestamp [ns],filename", "33000000,a.png"], yaml)
    (tmp_path / "mav0" / "cam0" / "data").mkdir()
    (tmp_path / "mav0" / "cam0" / "data" / "a.png").touch()
    flight = load_flight(tmp_path)
    assert len(flight.tables["cam0"]) == 1
    assert list(flight.readings()) == []
    assert flight.truth is None
    assert flight.gps is None
