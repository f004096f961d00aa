"""Small flight folders written by hand, for the tests of the readers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

IMU_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
)
STEP_NS = 5_000_000
IMU_ROWS = 400
UWB_YAML = "sensor_type: uwb\nmeasurement: {kind}\nanchors:\n  7: [0, 0, 0]\n  9: [4, 0, 1.5]\n  11: [0, 3, 0.5]\n"
FLOW_YAML = "sensor_type: optical_flow\nintrinsics: [419.0, 419.0]\nsurface: floor\n"
TOF_YAML = "sensor_type: range_finder\nrange_min_m: 0.02\nrange_max_m: 4.0\nsurface: floor\n"


def imu_lines(rows: int = IMU_ROWS, start_ns: int = 1_000_000_000) -> list[str]:
    """Rows of an IMU at 200 Hz that stands still; the third value numbers the row."""
    return [f"{start_ns + i * STEP_NS},0.0,0.0,{i / 1e4!r},0.0,0.0,9.81" for i in range(rows)]


def picture(name: str) -> bytes:
    """A small PNG whose grey value tells the pictures of a flight apart."""
    done, png = cv2.imencode(".png", np.full((4, 6), len(name), np.uint8))
    assert done
    return png.tobytes()


def write_sensor(flight: Path, name: str, lines: list[str], yaml: str | None = None, end: str = "\n") -> Path:
    """Write ``mav0/<name>/`` with a data.csv of ``lines`` and, if given, its sensor.yaml; return the data.csv."""
    folder = flight / "mav0" / name
    folder.mkdir(parents=True, exist_ok=True)
    if yaml is not None:
        (folder / "sensor.yaml").write_text(yaml, encoding="utf-8")
    path = folder / "data.csv"
    path.write_bytes(end.join([*lines, ""]).encode())
    return path


def standing_flight(flight: Path) -> Path:
    """A flight of 2 s with nothing but an IMU."""
    write_sensor(flight, "imu0", [IMU_HEADER, *imu_lines()], "sensor_type: imu\nrate_hz: 200\n")
    return flight


BLUR_YAML = (
    "sensor_type: blur\nintrinsics: [600, 600]\nsurface: wall\nlaw: composite\nframe_period_s: 0.033\nframes: 5\n"
)
BLUR_HEADER = "#timestamp [ns],window [s],length [px],sigma [px]"
CAM_YAML = (
    "sensor_type: camera\nresolution: [64, 48]\nintrinsics: [100, 101, 32, 24]\nsurface: wall\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [0.1, 0, 0, 1e-05]\n"
)
TRUTH_HEADER = "#timestamp [ns], " + ", ".join(
    [
        *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
        *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
        *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
        *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
        *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
    ]
)
GPS_HEADER = "#timestamp [ns],east [m],north [m],up [m],v_east [m s^-1],v_north [m s^-1],v_up [m s^-1]"

# folder -> (header, milliseconds between rows, values, sensor.yaml); "s" is random in +-1, "m" random in 0.1..9,
# "w" random in 0.005..0.02, anything else stands as it is
SENSORS: dict[str, tuple[str, int, str, str | None]] = {
    "imu0": (IMU_HEADER, 5, "s s s s s 9.81", "sensor_type: imu\nrate_hz: 200\n"),
    "flow0": ("#timestamp [ns],window [s],dx [px],dy [px],quality []", 11, "w s s 200", FLOW_YAML),
    "blur0": (BLUR_HEADER, 33, "0.165 m 0.5", BLUR_YAML),
    "blur1": (BLUR_HEADER, 33, "0.165 s 0.5", BLUR_YAML + "signed: true\n"),
    "tof0": ("#timestamp [ns],range [m]", 40, "m", TOF_YAML),
    "uwb0": (
        "#timestamp [ns],anchor,range [m],rssi [dBm],first_path_rssi [dBm]",
        20,
        "9 m -80.5 s",
        UWB_YAML.format(kind="range"),
    ),
    "uwb1": ("#timestamp [ns],anchor_a,anchor_b,difference [m]", 3, "11 7 s", UWB_YAML.format(kind="tdoa")),
    "uwb2": (
        "#timestamp [ns],x [m],y [m],z [m],sigma_x [m],sigma_y [m],sigma_z [m]",
        50,
        "s s s 0.1 0.2 0.3",
        "sensor_type: uwb\nmeasurement: position\nT_BS: [1,0,0,-0.01245, 0,1,0,0.00127, 0,0,1,0.0908, 0,0,0,1]\n",
    ),
    "baro0": ("#timestamp [ns],altitude [m]", 20, "m", "sensor_type: barometer\n"),
    "att0": ("#timestamp [ns],roll [rad],pitch [rad],yaw [rad]", 100, "s s s", "sensor_type: attitude\n"),
    "gps0": (GPS_HEADER, 200, "s s s s s s", "sensor_type: gps\n"),
    "state_groundtruth_estimate0": (TRUTH_HEADER, 10, "s s s 0.6 0.0 -0.8 0.0 s s s s s s s s s", None),
}


def full_flight(flight: Path, seed: int = 7) -> Path:
    """A flight of 2 s with every kind of sensor, random values, truth, GPS and all tables of flight.toml."""
    rng = np.random.default_rng(seed)
    limits = {"s": (-1.0, 1.0), "m": (0.1, 9.0), "w": (0.005, 0.02)}

    def cell(kind: str) -> str:
        return repr(float(rng.uniform(*limits[kind]))) if kind in limits else kind

    for name, (header, step_ms, kinds, yaml) in SENSORS.items():
        stamps = range(1_000_000_000, 3_000_000_000, step_ms * 1_000_000)
        rows = [",".join([str(t), *(cell(kind) for kind in kinds.split())]) for t in stamps]
        write_sensor(flight, name, [header, *rows], yaml)
    frames = ["1000000000,a b.png,0.002", "1033000000,2.png,0.004"]
    images = write_sensor(flight, "cam0", ["#timestamp [ns],filename,exposure [s]", *frames], CAM_YAML).parent / "data"
    images.mkdir()
    for image in ("a b.png", "2.png"):
        (images / image).write_bytes(picture(image))
    (flight / "flight.toml").write_text(FULL_TOML, encoding="utf-8")
    return flight


FULL_TOML = """
[flight]
name = "everything"
source = "made up"
licence = "MIT"
note = "a line with \\"quotes\\" and a backslash \\\\"
[world]
gravity_m_s2 = 9.7803
[corridor]
axis = [0.6, 0.8, 0.0]
[[corridor.section]]
kind = "straight"
start = [0, 0, 0]
end = [12.5, 0, 0]
width = 4.2
[surface.floor]
normal = [0, 0, 1]
[surface.wall]
normal = [0, -1, 0]
offset_m = "unknown"
[initial]
position_m = [1.495, 0.037, 0.03]
yaw_rad = -0.0027
[evaluation]
start_s = 0.25
end_s = 1.75
"""
