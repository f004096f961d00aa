"""What the numbers in a folder mean: signs, units, frames and stamps."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.readings import (
    Attitude,
    BlurLength,
    CameraFrame,
    Height,
    ImuSample,
    PixelMotion,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from axialnav.fusion.sources import fused_sensors
from axialnav.models.rig import BlurMeter, Flow, Gps, RangeFinder, Uwb
from axialnav.replay.flight import Flight, load_flight
from tests.replay.flight_texts import FLOW_YAML, SENSORS, TOF_YAML, full_flight, standing_flight, write_sensor


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return load_flight(full_flight(tmp_path_factory.mktemp("flight") / "full"))


def test_every_kind_of_sensor_becomes_its_reading(everything: Flight) -> None:
    kinds = {reading.sensor: type(reading) for reading in everything.readings()}
    assert kinds == {
        "imu0": ImuSample,
        "cam0": CameraFrame,
        "att0": Attitude,
        "baro0": Height,
        "blur0": BlurLength,
        "blur1": PixelMotion,
        "flow0": PixelMotion,
        "tof0": WallRange,
        "uwb0": UwbRange,
        "uwb1": UwbTdoa,
        "uwb2": UwbFix,
    }
    assert everything.drops == ()


def test_readings_come_in_time_order_ties_by_sensor_and_none_is_lost(everything: Flight) -> None:
    readings = list(everything.readings())
    order = fused_sensors(everything.config)
    keys = [(reading.t_ns, order.index(reading.sensor)) for reading in readings]
    assert keys == sorted(keys)
    assert order[0] == "imu0"
    assert set(order) == set(everything.tables)
    assert len(readings) == sum(len(everything.tables[name]) for name in order)
    assert all(len(everything.tables[name]) == math.ceil(2000 / SENSORS[name][1]) for name in order if name != "cam0")


def test_readings_equal_the_tables(everything: Flight) -> None:
    for name, table in everything.tables.items():
        rows = [reading for reading in everything.readings() if reading.sensor == name]
        for field, column in table.columns.items():
            if field == "filename":
                continue
            for reading, value in zip(rows, column.tolist(), strict=False):
                got = getattr(reading, field)
                if field.startswith("anchor"):
                    assert got == table.anchors[value]
                elif got is None:
                    assert np.isnan(value).all()
                else:
                    assert got == (tuple(value) if isinstance(value, list) else value)


def test_flow_is_stamped_at_the_end_in_the_file_and_at_the_middle_in_the_table(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    rows = ["1100000000,0.0101,3.0,-2.0", "1110000000,0.010000001,-1,0"]
    write_sensor(tmp_path, "flow0", ["#timestamp [ns],window [s],dx [px],dy [px]", *rows], FLOW_YAML)
    table = load_flight(tmp_path).tables["flow0"]
    assert table.t_ns.tolist() == [1_100_000_000 - 5_050_000, 1_110_000_000 - 5_000_000]
    assert table.columns["dx_px"].tolist() == [3.0, -1.0]
    assert table.columns["dy_px"].tolist() == [-2.0, 0.0]


def test_windows_that_change_places_are_put_in_order_of_their_middles(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    rows = ["1100000000,0.01,1,0", "1102000000,0.1,2,0"]
    write_sensor(tmp_path, "flow0", ["#timestamp [ns],window [s],dx [px],dy [px]", *rows], FLOW_YAML)
    flight = load_flight(tmp_path)
    assert flight.tables["flow0"].t_ns.tolist() == [1_052_000_000, 1_095_000_000]
    assert flight.tables["flow0"].columns["dx_px"].tolist() == [2.0, 1.0]
    assert flight.drops == ()


def test_blur_and_camera_are_stamped_at_the_middle_already(everything: Flight) -> None:
    assert everything.tables["blur0"].t_ns[0] == 1_000_000_000
    assert everything.tables["cam0"].t_ns.tolist() == [1_000_000_000, 1_033_000_000]
    assert everything.tables["cam0"].columns["exposure_s"].tolist() == [0.002, 0.004]


def test_the_mounting_is_row_major_and_takes_sensor_to_body(tmp_path: Path) -> None:
    """A beam that looks down: its z is the body's -z, its origin lies 0.2 m ahead."""
    standing_flight(tmp_path)
    mounting = "T_BS:\n  rows: 4\n  cols: 4\n  data: [0, 1, 0, 0.2, 1, 0, 0, 0, 0, 0, -1, -0.05, 0, 0, 0, 1]\n"
    write_sensor(tmp_path, "tof0", ["#timestamp [ns],range [m]", "1100000000,1.5"], TOF_YAML + mounting)
    spec = load_flight(tmp_path).config.sensor["tof0"]
    assert isinstance(spec, RangeFinder)
    np.testing.assert_array_equal(spec.rotation_BS @ [0, 0, 1], [0, 0, -1])
    np.testing.assert_array_equal(spec.lever_arm_m, [0.2, 0, -0.05])
    assert (spec.range_min_m, spec.range_max_m, spec.surface) == (0.02, 4.0, "floor")


def test_descriptions_say_what_sensor_yaml_says(everything: Flight) -> None:
    sensor = everything.config.sensor
    flow, blur, uwb = sensor["flow0"], sensor["blur1"], sensor["uwb1"]
    assert isinstance(flow, Flow)
    assert flow.focal_px == (419.0, 419.0)
    assert isinstance(blur, BlurMeter)
    assert (blur.law, blur.frame_period_s, blur.frames, blur.signed) == ("composite", 0.033, 5, True)
    assert isinstance(uwb, Uwb)
    assert uwb.anchors == {"7": (0.0, 0.0, 0.0), "9": (4.0, 0.0, 1.5), "11": (0.0, 3.0, 0.5)}
    assert isinstance(sensor["gps0"], Gps)
    assert "gps0" not in everything.tables


def test_flight_toml_fills_the_rig_part_of_the_configuration(everything: Flight) -> None:
    config = everything.config
    assert everything.name == "everything"
    assert everything.info["note"] == 'a line with "quotes" and a backslash \\'
    assert config.gravity_m_s2 == 9.7803
    assert config.corridor is not None
    assert config.corridor.axis == (0.6, 0.8, 0.0)
    assert config.corridor.section[0].width == 4.2
    assert config.surface["wall"].offset_m == "unknown"
    assert config.initial is not None
    assert (config.initial.position_m, config.initial.yaw_rad) == ((1.495, 0.037, 0.03), -0.0027)
    assert config.initial.sigma_yaw_rad == 0.05
    assert everything.evaluation == (0.25, 1.75)


def test_a_configuration_with_other_anchors_finds_the_same_rows(everything: Flight) -> None:
    """The indices follow the list of whoever describes the sensor; names stay with their rows."""
    spec = everything.config.sensor["uwb1"]
    assert isinstance(spec, Uwb)
    backwards = msgspec.structs.replace(spec, anchors=dict(reversed(spec.anchors.items())))
    config = Config(sensor={**everything.config.sensor, "uwb1": backwards})
    before, after = everything.tables["uwb1"], everything.tables_for(config)["uwb1"]
    assert after.anchors == ("11", "9", "7")
    assert before.columns["anchor_a"][0] == 2
    assert after.columns["anchor_a"][0] == 0
    assert after.anchor_names("anchor_b") == before.anchor_names("anchor_b")
    assert everything.tables_for(everything.config)["uwb1"] is before


def test_truth_and_gps_are_references(everything: Flight) -> None:
    truth, gps = everything.truth, everything.gps
    assert truth is not None
    assert gps is not None
    np.testing.assert_array_equal(truth.quaternion_WB[0], [0.6, 0.0, -0.8, 0.0])
    assert truth.accel_bias is not None
    assert truth.accel_bias.shape == truth.position_m.shape == (200, 3)
    assert gps.velocity_m_s.shape == (10, 3)


def test_ten_sensors_of_one_kind_keep_their_numbers_in_order(tmp_path: Path) -> None:
    standing_flight(tmp_path)
    for number in range(12):
        write_sensor(tmp_path, f"tof{number}", ["#timestamp [ns],range [m]", "1100000000,1.5"], TOF_YAML)
    assert list(load_flight(tmp_path).tables) == ["imu0", *(f"tof{number}" for number in range(12))]
