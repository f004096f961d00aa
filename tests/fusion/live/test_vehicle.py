"""The vehicle file: the example of the documentation is read, and what cannot work is refused in one line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.live import vehicle as tables
from axialnav.fusion.live.vehicle import Vehicle
from tests.house import ROOT

PAGE = (ROOT / "docs" / "flight-stack.md").read_text(encoding="utf-8")
(EXAMPLE,) = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def read(tmp_path: Path, text: str) -> Vehicle:
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return Vehicle.from_toml(path)


def test_the_example_of_the_page_is_read(tmp_path: Path) -> None:
    vehicle = read(tmp_path, EXAMPLE)
    assert vehicle.content == "full"
    assert [line.ranges or line.wall for line in vehicle.nooploop] == ["uwb0", "tof0"]
    assert vehicle.camera is not None
    assert vehicle.camera.exposure_s == 0.01


def test_every_key_is_on_the_page() -> None:
    rows = re.findall(r"^\| (?:`\[+\w+\]+` |top |)\| (.+?) \|", PAGE, re.MULTILINE)
    named = {key for cell in rows for key in re.findall(r"`(\w+)`", cell)}
    kinds = (
        tables.Mavlink,
        tables.Inputs,
        tables.Output,
        tables.CameraInput,
        tables.Nooploop,
        tables.Recording,
        tables.Status,
    )
    exist = {key for kind in kinds for key in kind.__struct_fields__} | {"estimator", "filter_file"}
    assert exist <= named


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("profile =", "profil =", "unknown key `mavlink.profil`; did you mean `profile`"),
        (
            'imu = "imu0"',
            'imu = "imu9"',
            "input.imu = 'imu9' is not a Imu described in [filter.sensor]; there are imu0",
        ),
        ('ranges = "uwb0"', 'ranges = "tof0"', "nooploop.ranges = 'tof0' is not a Uwb"),
        ("[output]", '[output]\ncontent = "axial"', "ArduPilot takes all three axes"),
        ("[output]", "[output]\nrate_hz = 60.0", "output.rate_hz"),
        ("[output]", "[output]\nstale_s = 0.5", "output.stale_s"),
        ("allow = [[1, 1]]", "allow = [[1, 300]]", "mavlink.allow"),
        ("[output]", "[output", "not valid TOML"),
        ("[mavlink]", 'filter_file = "filter.toml"\n[mavlink]', "filter_file and [filter] are both there"),
    ],
)
def test_what_cannot_work_is_one_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        read(tmp_path, EXAMPLE.replace(old, new, 1))
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_the_filter_may_have_a_file_of_its_own(tmp_path: Path) -> None:
    whole = read(tmp_path, EXAMPLE)
    (tmp_path / "filter.toml").write_text(whole.filter.to_toml(), encoding="utf-8")
    head = 'filter_file = "filter.toml"\n' + EXAMPLE[: EXAMPLE.index("[filter.corridor]")]
    assert read(tmp_path, head).filter == whole.filter
    (tmp_path / "filter.toml").write_text(Config().to_toml(), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"input\.imu = 'imu0' is not a Imu"):
        read(tmp_path, head)


def test_what_is_sent_follows_from_what_is_known(tmp_path: Path) -> None:
    without = EXAMPLE.replace("[filter.corridor]", '[filter]\ndisabled = ["uwb0"]\n[filter.corridor]')
    assert read(tmp_path, without).content == "velocity"
    axial = EXAMPLE.replace("[mavlink]", 'estimator = "axial"\n[mavlink]', 1)
    assert read(tmp_path, axial).content == "velocity"
    assert read(tmp_path, axial.replace('"ardupilot"', '"px4"')).content == "axial"
    with pytest.raises(ConfigError, match="the axial one knows one axis"):
        read(tmp_path, axial.replace("[output]", '[output]\ncontent = "full"'))
