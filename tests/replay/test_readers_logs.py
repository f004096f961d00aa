"""Real logs of both autopilots, foreign bags, dumps and videos, through default and own mappings."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap_ros2.writer import Writer

from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Flow, RangeFinder, Uwb
from axialnav.replay.flight import load_flight
from axialnav.replay.motion import pictures
from axialnav.replay.readers.expression import MissingFieldError, evaluate, holds
from axialnav.replay.readers.mapping import load_mapping
from tests.fusion.live.nooploop_vectors import BYTES

DEFAULTS = ("mavlink", "dataflash", "ulog", "ros", "nooploop", "video")


@pytest.mark.flights
def test_a_real_px4_log(shared: Path) -> None:
    flight = load_flight(shared / "logs" / "px4_fmuv3_lidar_44s.ulg")
    rows = {name: len(table) for name, table in flight.tables.items()}
    assert rows == {"imu0": 341, "att0": 1099, "baro0": 110, "tof0": 361}
    assert 0.3 < flight.tables["tof0"].columns["range_m"].min() < flight.tables["tof0"].columns["range_m"].max() < 13.0
    assert flight.gps is not None
    assert np.abs(flight.gps.velocity_m_s).max() < 30.0


@pytest.mark.flights
def test_a_real_ardupilot_log_as_pymavlink_reads_it(shared: Path) -> None:
    from pymavlink.DFReader import DFReader_binary

    path = shared / "logs" / "arducopter_3.6.8_indoor_52s.bin"
    reader = DFReader_binary(str(path))
    expected, angles = [], []
    while (message := reader.recv_match(type=["IMU", "ATT"])) is not None:
        if message.get_type() == "IMU":
            stamp = message.TimeUS * 1000
            expected.append(
                (stamp, message.GyrX, -message.GyrY, -message.GyrZ, message.AccX, -message.AccY, -message.AccZ)
            )
        else:
            angles.append((message.TimeUS * 1000, message.Roll, message.Pitch, message.Yaw))
    reader.data_map.close()
    reader.filehandle.close()
    imu, attitude = (load_flight(path).tables[name] for name in ("imu0", "att0"))
    assert imu.t_ns.tolist() == [row[0] for row in expected]
    assert np.array_equal(np.hstack([imu.columns["gyro_rad_s"], imu.columns["accel_m_s2"]]), np.array(expected)[:, 1:])
    roll = np.degrees(attitude.columns["roll_rad"])
    assert np.abs(roll - np.array(angles)[:, 1]).max() < 1e-9
    assert 8.0 < np.median(imu.columns["accel_m_s2"][:, 2]) < 11.0


IMU_TEXT = (
    "std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n"
    + "=" * 80
    + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + "=" * 80
    + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
)
NODES_TEXT = (
    "uint8 role\nuint8 id\nmy_parser/Node[] nodes\n"
    + "=" * 80
    + "\nMSG: my_parser/Node\nuint8 id\nfloat32 dis\nfloat32 fp_rssi"
)
MAPPING = """
[sensor.imu0]
kind = "imu"

[sensor.uwb0]
kind = "uwb"
measurement = "range"
anchors = { 1 = [0, 0, 0], 7 = [5, 0, 0], 9 = [0, 5, 1] }

[source.imu0]
from = ["/fcu/imu"]
fields.gyro_rad_s = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
fields.accel_m_s2 = ["linear_acceleration.x", "linear_acceleration.y", "linear_acceleration.z"]

[source.uwb0]
from = ["/uwb"]
where = "nodes[].dis > 0"
fields.anchor = "nodes[].id"
fields.range_m = "nodes[].dis"
fields.first_path_dbm = "nodes[].fp_rssi"
"""


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A compressed MCAP as another recorder writes it; UWB messages have between 0 and 3 nodes and no stamp."""
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file, Writer(file, chunk_size=5000) as writer:
        imu = writer.register_msgdef("my_msgs/msg/Imu", IMU_TEXT)
        uwb = writer.register_msgdef("my_parser/msg/Frame", NODES_TEXT)
        for k in range(400):
            t_ns = 1_000_000_000 + 5_000_000 * k
            header = {"stamp": {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}, "frame_id": "imu" * (1 + k % 3)}
            body = {
                "angular_velocity": {"x": k / 1e3, "y": 0.0, "z": 0.0},
                "linear_acceleration": {"x": 0.0, "y": 0.0, "z": 9.81},
            }
            writer.write_message("/fcu/imu", imu, {"header": header, **body}, log_time=t_ns + 77, publish_time=t_ns)
            if k % 10 == 0:
                nodes = [
                    {"id": (1, 7, 9)[n], "dis": (0.0, 2.5, k / 64)[n], "fp_rssi": -88.5} for n in range(k // 10 % 4)
                ]
                writer.write_message(
                    "/uwb", uwb, {"role": 2, "id": 1, "nodes": nodes}, log_time=t_ns, publish_time=t_ns
                )
    return path


def test_foreign_messages_by_a_mapping_beside_the_log(foreign: Path) -> None:
    foreign.with_name("foreign.mcap.toml").write_text(MAPPING)
    flight = load_flight(foreign)
    imu, uwb = flight.tables["imu0"], flight.tables["uwb0"]
    assert imu.t_ns.tolist() == [1_000_000_000 + 5_000_000 * k for k in range(400)]
    assert imu.columns["gyro_rad_s"][:, 0].tolist() == [k / 1e3 for k in range(400)]
    expected = [
        (1_000_000_000 + 5_000_000 * k, anchor, distance)
        for k in range(0, 400, 10)
        for anchor, distance in [("7", 2.5), ("9", k / 64)][: max(k // 10 % 4 - 1, 0)]
        if distance > 0
    ]
    found = zip(uwb.t_ns.tolist(), uwb.anchor_names("anchor"), uwb.columns["range_m"].tolist(), strict=True)
    assert list(found) == expected
    assert isinstance(flight.config.sensor["uwb0"], Uwb)
    assert any("no stamps" in drop.reason and drop.sensor == "/uwb" for drop in flight.drops)


def test_without_a_mapping_the_topics_are_named(foreign: Path) -> None:
    with pytest.raises(
        FlightError, match=r"holds no sensor that the mapping knows; there are /fcu/imu, /uwb; say what"
    ):
        load_flight(foreign)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('from = ["/uwb"]', 'from = ["/uwbs"]'), "no /uwbs for uwb0; there are /fcu/imu, /uwb"),
        (('"nodes[].dis"', '"nodes[].distance"'), r"/uwb has no field nodes\[\].distance; it has role, id"),
        (("fields.range_m", "fields.ranges"), "no field 'ranges'; there are"),
        (("[source.uwb0]", "[source.uwb7]"), r"\[source.uwb7\] has no \[sensor.uwb7\].*is uwb. meant"),
        (('where = "nodes[].dis > 0"', 'where = "dis"'), "'dis' is no condition"),
        (("from =", "form ="), "form.*from"),
        (('kind = "uwb"', 'kind = "uwbs"'), "uwbs"),
        (("[sensor.imu0]", "[sensor.imu0"), "not valid TOML"),
    ],
)
def test_a_wrong_mapping_is_one_line_that_names_the_way_out(
    foreign: Path, tmp_path: Path, change: tuple[str, str], words: str
) -> None:
    (tmp_path / "own.toml").write_text(MAPPING.replace(*change))
    with pytest.raises(FlightError, match=words) as caught:
        load_flight(foreign, mapping=tmp_path / "own.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", DEFAULTS)
def test_every_default_mapping_is_valid_and_every_source_has_a_sensor(tmp_path: Path, name: str) -> None:
    mapping, asked = load_mapping(tmp_path / "log", None, name)
    cameras = {"cam0"} if name == "video" else set()
    assert set(mapping.source) - cameras == set(mapping.sensor) | ({"truth"} & set(mapping.source))
    assert asked == frozenset()
    for spec in mapping.sensor.values():
        if isinstance(spec, RangeFinder | Flow):
            assert spec.rotation_BS[:, 2].tolist() == [0.0, 0.0, -1.0]  # looks down
            assert spec.surface in mapping.surface


def test_a_nooploop_dump_by_its_own_clock(tmp_path: Path) -> None:
    frame = bytearray(BYTES["NodeFrame3"])
    parts = []
    for k in range(50):
        frame[6:10] = (463352 + 20 * k).to_bytes(4, "little")
        frame[-1] = sum(frame[:-1]) & 0xFF
        parts += [bytes(frame), b"\x00\x55"]
    (tmp_path / "uwb.dump").write_bytes(b"".join(parts))
    flight = load_flight(tmp_path / "uwb.dump")
    table = flight.tables["uwb0"]
    assert len(table) == 200
    assert np.diff(np.unique(table.t_ns)).tolist() == [20_000_000] * 49
    assert table.columns["first_path_dbm"][:4].tolist() == [-90.5, -91.0, -85.0, -92.0]
    assert {drop.reason: drop.count for drop in flight.drops}["bytes that belong to no frame: skipped"] >= 99


def test_a_video_with_stamps_and_an_imu(tmp_path: Path) -> None:
    writer = cv2.VideoWriter(str(tmp_path / "wall.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for k in range(10):
        writer.write(np.full((48, 64, 3), 20 * k, np.uint8))
    writer.release()
    stamps = [1_000_000_000 + 40_000_000 * k for k in range(9)]
    rows = "\n".join(f"{t},{0.001 * k}" for k, t in enumerate(stamps, 1))
    (tmp_path / "frames.csv").write_text(f"#timestamp [ns],exposure [s]\n{rows}\n")
    imu = "\n".join(f"{1_000_000_000 + 5_000_000 * k},0,0,0.1,0,0,9.81" for k in range(100))
    (tmp_path / "imu.csv").write_text(f"timestamp,w_x,w_y,w_z,a_x,a_y,a_z\n{imu}\nbroken,row\n")
    flight = load_flight(tmp_path)
    assert flight.tables["cam0"].t_ns.tolist() == stamps
    assert flight.tables["cam0"].columns["exposure_s"][2] == 0.003
    assert [round(float(picture.mean()) / 20) for picture in pictures(flight, "cam0")] == list(range(9))
    assert len(flight.tables["imu0"]) == 100
    reasons = {drop.reason for drop in flight.drops}
    assert "frames and stamps differ in number: the surplus is left out" in reasons
    assert "row is not numbers: left out" in reasons
    alone = load_flight(tmp_path / "wall.avi")
    assert len(alone.tables["cam0"]) == 9


def test_expressions_are_products_with_alternatives() -> None:
    columns = {"a": np.array([1.0, 2.0]), "q": np.array([[1.0, 2.0], [3.0, 4.0]]), "b.c": np.array([4, 5])}
    assert evaluate("-0.5 * a * b.c", columns, 2).tolist() == [-2.0, -5.0]
    assert evaluate("none | q[1] / 2", columns, 2).tolist() == [1.0, 2.0]
    assert evaluate("-q[0]", columns, 2).tolist() == [-1.0, -3.0]
    assert holds("a > 1 and b.c <= 5 and none == 3", columns, 2).tolist() == [False, True]
    with pytest.raises(MissingFieldError, match="none"):
        evaluate("none", columns, 2)


@pytest.mark.parametrize("better", [False, True])
def test_raw_imu_of_a_tlog_is_taken_where_there_is_nothing_better(tmp_path: Path, better: bool) -> None:
    import struct

    from pymavlink.dialects.v20 import ardupilotmega as dialect

    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    with (tmp_path / "a.tlog").open("wb") as file:
        for k in range(200):
            us = 20_000 * k
            messages = [dialect.MAVLink_raw_imu_message(us, 10, -20, -1001, 100, -200, 300, 0, 0, 0)]
            if better:
                rest = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 63)
                messages.append(dialect.MAVLink_highres_imu_message(us, 0.1, -0.2, -9.8, 0.01, 0.02, 0.03, *rest))
            for message in messages:
                file.write(struct.pack(">Q", 1_700_000_000_000_000 + us) + message.pack(link))
    flight = load_flight(tmp_path / "a.tlog")
    assert list(flight.tables) == (["imu0"] if better else ["imu1"])
    [imu] = flight.tables.values()
    assert imu.t_ns.tolist() == [20_000_000 * k for k in range(200)]
    expected = [0.1, 0.2, 9.8] if better else [0.0980665, 0.196133, 9.81645665]
    assert imu.columns["accel_m_s2"][7].tolist() == pytest.approx(expected, rel=1e-6)
    assert imu.columns["gyro_rad_s"][7].tolist() == pytest.approx([0.01, -0.02, -0.03] if better else [0.1, 0.2, -0.3])
