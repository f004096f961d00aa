"""OpenCV's own V4L2 backend against a driver that is preloaded into the process: what is set, read back and stamped."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fusion.live.accounts import PATIENCE_S
from tests.house import ROOT

DEVICE = "/dev/video77"
VEHICLE = f"""
[camera]
source = "{DEVICE}"
exposure_s = 0.01
fourcc = "YUYV"
gain = 7.0

[filter.sensor.imu0]
kind = "imu"

[filter.surface.wall]
normal = [0.0, -1.0, 0.0]

[filter.sensor.cam0]
kind = "camera"
resolution = [320, 240]
rate_hz = 15.0
surface = "wall"
intrinsics = [300.0, 300.0, 160.0, 120.0]
"""


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler here: the driver cannot be built")
    library = tmp_path_factory.mktemp("driver") / "v4l2_driver.so"
    source = Path(__file__).with_name("v4l2_driver.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", library, source, "-ldl"], check=True)
    return library


def camera(
    driver: Path, folder: Path, width: int = 320, seconds: int = 4, **behaviour: str
) -> subprocess.CompletedProcess[str]:
    """``axialnav camera`` for some seconds on the driver, whose pictures have 640x480 pixels if nobody says more."""
    (folder / "vehicle.toml").write_text(VEHICLE.replace("[320,", f"[{width},"))
    loaded = {"LD_PRELOAD": str(driver), "DRIVER_DEVICE": DEVICE, "OPENCV_LOG_LEVEL": "OFF", **behaviour}
    command = [sys.executable, "-m", "axialnav", "camera", "--config", "vehicle.toml", "--seconds", f"{seconds}"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **loaded}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )


def test_settings_are_taken_and_read_back_and_stamps_are_the_driver_s(driver: Path, tmp_path: Path) -> None:
    told = camera(driver, tmp_path)
    assert (told.returncode, told.stderr) == (0, "")
    for name in ("pixel format", "width", "height", "manual exposure", "exposure [0.1 ms]", "gain"):
        assert f"ok  set {name} " in told.stdout
    assert re.search(r"ok  set exposure \[0.1 ms\] +100  is 100\n", told.stdout)
    assert "ok  stamps from the driver" in told.stdout
    mean = re.search(r"motion measured in (\d+) windows, refused in \d+, mean ([-+.\d]+) px a frame", told.stdout)
    assert mean is not None
    assert int(mean[1]) > 20
    assert float(mean[2]) == pytest.approx(-3.0, abs=0.2)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("manual", "manual exposure was set to 1, the driver says 3"),
        ("exposure", "exposure [0.1 ms] was set to 100, the driver says 157"),
        ("size", "width was set to 800, the driver says 640"),
    ],
)
def test_what_the_driver_does_not_take_is_one_line(driver: Path, tmp_path: Path, what: str, words: str) -> None:
    told = camera(driver, tmp_path, width=800 if what == "size" else 320, DRIVER_REFUSES=what)
    assert told.returncode == 2
    assert words in told.stderr
    assert told.stderr.count("\n") == 1


def test_a_camera_that_goes_away_is_counted_and_not_waited_for(driver: Path, tmp_path: Path) -> None:
    told = camera(driver, tmp_path, DRIVER_BREAKS="25")
    assert told.returncode == 1
    unreadable = re.search(r"unreadable (\d+)", told.stdout)
    assert unreadable is not None
    assert int(unreadable[1]) > 5


def test_a_camera_that_comes_back_is_opened_anew_with_its_settings(driver: Path, tmp_path: Path) -> None:
    """It goes after 25 pictures, can be opened again after a second, and is still set to what was asked for."""
    told = camera(driver, tmp_path, seconds=6, DRIVER_BREAKS="25", DRIVER_RETURNS="1000")
    assert "NOT always there: gone and opened anew 1 times" in told.stdout
    assert re.search(r"ok  set exposure \[0.1 ms\] +100  is 100\n", told.stdout)
    pictures = re.search(r"(\d+) pictures\n", told.stdout)
    assert pictures is not None
    assert int(pictures[1]) > 25
    assert re.search(r"gaps [1-9]", told.stdout)
