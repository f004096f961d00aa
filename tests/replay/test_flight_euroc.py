"""Folders that other people recorded, in the published EuRoC/ASL form and in what became of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from axialnav.models.rig import Camera, Imu
from axialnav.replay.flight import load_flight
from tests.replay.flight_texts import IMU_HEADER, TRUTH_HEADER

IMU_YAML = """\
#Default imu sensor yaml file
sensor_type: imu
comment: VI-Sensor IMU (ADIS16448)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0,
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 200

# inertial sensor noise model parameters (static)
gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]   ( gyro "white noise" )
gyroscope_random_walk: 1.9393e-05       # [ rad / s^2 / sqrt(Hz) ] ( gyro bias diffusion )
accelerometer_noise_density: 2.0000e-3  # [ m / s^2 / sqrt(Hz) ]   ( accel "white noise" )
accelerometer_random_walk: 3.0000e-3    # [ m / s^3 / sqrt(Hz) ].  ( accel bias diffusion )
"""
CAM_YAML = """\
# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam{n} (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,
         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,
        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,
         0.0, 0.0, 0.0, 1.0]

# Camera specific definitions.
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
"""
OTHER_YAML = """\
sensor_type: {kind}
comment: outside tracker
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0.07, 0, 1, 0, -0.01, 0, 0, 1, 0.14, 0, 0, 0, 1]
"""
IMU_CSV = f"""\
{IMU_HEADER}
1403636579758555392,-0.099134701513277898,0.14730578886832138,0.027,8.1476917083333333,-0.37592,-2.4026292499999999
1403636579763555584,-0.099134701513277898,0.14032447186034408,0.029,8.0332807916666666,-0.40861,-2.4026292499999999
1403636579768555520,-0.098436569812480182,0.12775810124598494,0.037,7.8861810416666662,-0.42495,-2.4353180833333332
"""
TRUTH_CSV = f"""\
{TRUTH_HEADER.replace(" [ns]", "", 1)}
1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152,\
-0.027876,0.033207,0.800006,-0.003172,0.021267,0.078502,-0.025266,0.136696,0.075593
1403636580843555328,4.688177,-1.786770,0.787350,0.534640,-0.152990,-0.826976,-0.082863,\
-0.029272,0.033992,0.802000,-0.003172,0.021267,0.078502,-0.025266,0.136696,0.075593
"""
STAMPS = (1403636579763555584, 1403636579813555456)


@pytest.fixture
def machine_hall(tmp_path: Path) -> Path:
    """The layout of MH_01_easy: two cameras, IMU, a Leica tracker, ground truth; no flight.toml."""
    mav0 = tmp_path / "MH_01_easy" / "mav0"
    parts = {
        "imu0": (IMU_YAML, IMU_CSV),
        "cam0": (CAM_YAML.format(n=0), "#timestamp [ns],filename\n" + "".join(f"{t},{t}.png\n" for t in STAMPS)),
        "cam1": (CAM_YAML.format(n=1), "#timestamp [ns],filename\n" + "".join(f"{t},{t}.png\n" for t in STAMPS)),
        "leica0": (OTHER_YAML.format(kind="position"), "#timestamp [ns], p_RS_R_x [m]\n1403636580838555648,4.6\n"),
        "state_groundtruth_estimate0": (OTHER_YAML.format(kind="visual-inertial"), TRUTH_CSV),
    }
    for name, (yaml, csv) in parts.items():
        (mav0 / name).mkdir(parents=True)
        (mav0 / name / "sensor.yaml").write_text(yaml, encoding="utf-8")
        (mav0 / name / "data.csv").write_bytes(csv.replace("\n", "\r\n").encode())
    for camera in ("cam0", "cam1"):
        (mav0 / camera / "data").mkdir()
        for t in STAMPS:
            (mav0 / camera / "data" / f"{t}.png").touch()
    (mav0 / "body.yaml").write_text("comment: asctec firefly\n", encoding="utf-8")
    return mav0.parent


def test_the_published_form_reads_without_any_change(machine_hall: Path) -> None:
    flight = load_flight(machine_hall)
    assert flight.name == "MH_01_easy"
    assert flight.info == {}
    assert flight.evaluation == (None, None)
    assert list(flight.tables) == ["imu0", "cam0", "cam1"]

    imu = flight.config.sensor["imu0"]
    assert isinstance(imu, Imu)
    assert (imu.gyro_noise_density, imu.gyro_bias_walk) == (1.6968e-04, 1.9393e-05)
    assert (imu.accel_noise_density, imu.accel_bias_walk) == (2.0e-3, 3.0e-3)
    assert imu.rate_hz == 200.0

    camera = flight.config.sensor["cam1"]
    assert isinstance(camera, Camera)
    assert camera.resolution == (752, 480)
    assert camera.focal_px == (458.654, 457.296)
    assert camera.distortion_coefficients[3] == 1.76187114e-05
    # row-major: the lever arm is the last column
    np.testing.assert_array_equal(camera.lever_arm_m, [-0.0216401454975, -0.064676986768, 0.00981073058949])
    np.testing.assert_array_equal(camera.rotation_BS[0], [0.0148655429818, -0.999880929698, 0.00414029679422])


def test_values_keep_every_digit(machine_hall: Path) -> None:
    flight = load_flight(machine_hall)
    first = next(iter(flight.readings()))
    assert first.t_ns == 1403636579758555392
    assert first.gyro_rad_s[0] == -0.099134701513277898
    assert first.accel_m_s2[2] == -2.4026292499999999
    truth = flight.truth
    assert truth is not None
    assert truth.t_ns.tolist() == [1403636580838555648, 1403636580843555328]
    np.testing.assert_array_equal(truth.position_m[0], [4.688319, -1.786938, 0.783338])
    np.testing.assert_array_equal(truth.quaternion_WB[0], [0.534108, -0.153029, -0.827383, -0.082152])
    np.testing.assert_array_equal(truth.velocity_m_s[1], [-0.029272, 0.033992, 0.802])
    assert truth.gyro_bias is not None
    assert truth.accel_bias is not None
    np.testing.assert_array_equal(truth.accel_bias[1], [-0.025266, 0.136696, 0.075593])


def test_sensors_without_use_are_named_and_nothing_else_is(machine_hall: Path) -> None:
    drops = load_flight(machine_hall).drops
    assert [(drop.sensor, drop.example) for drop in drops] == [("leica0", "sensor_type position")]


def test_the_path_may_be_the_flight_or_its_mav0(machine_hall: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = load_flight(machine_hall)
    inner = load_flight(machine_hall / "mav0")
    monkeypatch.chdir(machine_hall / "mav0")
    here = load_flight(".")
    assert whole.name == inner.name == here.name == "MH_01_easy"
    assert whole.path == inner.path == here.path
    assert whole.image_path("cam1", f"{STAMPS[0]}.png").is_file()


def test_a_download_without_images_still_gives_imu_and_truth(machine_hall: Path) -> None:
    (machine_hall / "mav0" / "cam0" / "data" / f"{STAMPS[1]}.png").unlink()
    flight = load_flight(machine_hall)
    missing = [drop for drop in flight.drops if drop.reason == "image file missing"]
    assert [(drop.sensor, drop.count, drop.example) for drop in missing] == [
        ("cam0", 1, f"line 3: {STAMPS[1]},{STAMPS[1]}.png")
    ]
    assert flight.tables["cam0"].columns["filename"].tolist() == [f"{STAMPS[0]}.png"]


def test_a_camera_may_come_as_a_video(machine_hall: Path) -> None:
    cam0 = machine_hall / "mav0" / "cam0"
    (cam0 / "video.mp4").touch()
    (cam0 / "data.csv").write_text("#timestamp [ns]\n" + "".join(f"{t}\n" for t in STAMPS), encoding="utf-8")
    table = load_flight(machine_hall).tables["cam0"]
    assert table.t_ns.tolist() == list(STAMPS)
    assert table.columns["filename"].tolist() == ["", ""]


def test_folders_without_sensor_yaml_take_defaults_and_say_so(machine_hall: Path) -> None:
    for name in ("imu0", "cam0", "cam1"):  # as in the exports of the TUM VI data set
        (machine_hall / "mav0" / name / "sensor.yaml").unlink()
    flight = load_flight(machine_hall)
    assert list(flight.tables) == ["imu0"]
    assert flight.config.sensor["imu0"] == Imu()
    said = [(drop.sensor, drop.reason) for drop in flight.drops if drop.sensor != "leica0"]
    assert ("imu0", "no sensor.yaml: mounted as the body frame, default values") in said
    assert ("cam0", "sensor.yaml says no `resolution`, which sensor_type camera needs: left out") in said


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("#Default imu sensor yaml file\n", "%YAML:1.0\n---\n"),  # OpenCV's FileStorage
        ("sensor_type: imu\n", ""),  # told by the folder's name
        ("cols: 4\n  rows: 4\n", "dt: d\n  cols: 4\n  rows: 4\n"),
        ("comment: VI-Sensor IMU (ADIS16448)\n", "comment: {}\n"),
        ("rate_hz: 200\n", "rate_hz: 2e2\n"),  # YAML 1.1 takes this for text
    ],
)
def test_dialects_of_sensor_yaml_mean_the_same(old: str, new: str, machine_hall: Path) -> None:
    expected = load_flight(machine_hall).config.sensor["imu0"]
    path = machine_hall / "mav0" / "imu0" / "sensor.yaml"
    assert old in IMU_YAML
    path.write_text(IMU_YAML.replace(old, new), encoding="utf-8")
    assert load_flight(machine_hall).config.sensor["imu0"] == expected


def test_foreign_keys_are_tolerated_and_reported_with_the_nearest_of_ours(machine_hall: Path) -> None:
    path = machine_hall / "mav0" / "imu0" / "sensor.yaml"
    path.write_text(IMU_YAML + "time_offset: 0.0\ngyroscope_noise_densty: 1.0\n", encoding="utf-8")
    notes = [drop.example for drop in load_flight(machine_hall).drops if drop.reason.startswith("unknown key")]
    assert notes == ["time_offset: 0.0", "gyroscope_noise_densty: 1.0; is `gyroscope_noise_density` meant?"]
