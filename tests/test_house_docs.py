"""The pages say what is so: every verb and option, every column of a flight folder, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from axialnav.fusion import complaints
from axialnav.replay import cli
from axialnav.replay.readers import columns
from axialnav.replay.readers.flight_toml import read_flight_toml
from tests.house import ROOT

PAGE = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## `axialnav (\w+)[^`]*`\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
VERBS = sorted(name for name in cli.build_app() if not name.startswith("-"))


def options(text: str) -> set[str]:
    return set(re.findall(r"--[a-z][a-z-]*", text)) - {"--help", "--version"}


def test_every_verb_has_a_section() -> None:
    assert sorted(SECTIONS) == VERBS


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_on_the_page(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([verb, "--help"]) == 0
    exists = options(capsys.readouterr().out)
    assert exists
    assert options("\n".join(re.findall(r"^\| (`.*?) \|", SECTIONS[verb], re.MULTILINE))) == exists


def test_every_exit_code_is_on_the_page() -> None:
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", PAGE, re.MULTILINE)}
    exist = (complaints.PASSED, complaints.FAILED, complaints.USAGE, complaints.UNUSABLE, complaints.INTERRUPTED)
    assert codes == set(exist)


FORMAT = (ROOT / "docs" / "flight-format.md").read_text(encoding="utf-8")
TABLES = {
    "imu0": columns.IMU,
    "cam0": columns.CAMERA,
    "flow0": columns.FLOW,
    "blur0": columns.BLUR,
    "tof0": columns.RANGE,
    "uwb0 range": columns.UWB_RANGE,
    "uwb0 tdoa": columns.UWB_TDOA,
    "uwb0 position": columns.UWB_POSITION,
    "baro0": columns.HEIGHT,
    "att0": columns.ATTITUDE,
    "gps0": columns.GPS,
    "state_groundtruth_estimate0": columns.TRUTH,
}


def tables_of_the_page() -> dict[str, set[tuple[str, bool]]]:
    """Section (and measurement) -> header of each column as written, and whether it is required."""
    found = {}
    for section, body in re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", FORMAT, re.MULTILINE | re.DOTALL):
        for measurement, rows in re.findall(r"^\| column \|(.*?)\|\n\|-+\|-+\|\n((?:\|.*\n)+)", body, re.MULTILINE):
            cells = "".join(row.split("|")[1] for row in rows.splitlines())
            name = f"{section} {''.join(re.findall('measurement: ([a-z]+)', measurement))}".strip()
            found[name] = {(text, not star) for star, text in re.findall(r"(\*?)`([^`]+)`", cells)}
    return found


def test_every_column_of_a_flight_folder_is_on_the_page() -> None:
    written = {
        name: {(c.header if c.unit or c.name.startswith("q_RS") else c.name, c.required) for c in layout}
        for name, layout in TABLES.items()
    }
    assert tables_of_the_page() == written


def test_the_example_of_a_flight_toml_is_read(tmp_path: Path) -> None:
    (example,) = re.findall(r"^```toml\n(.*?)^```", FORMAT, re.MULTILINE | re.DOTALL)
    (tmp_path / "flight.toml").write_text(example, encoding="utf-8")
    read = read_flight_toml(tmp_path / "flight.toml")
    assert read.flight.name == "tunnel_12"
    assert read.corridor is not None
    assert read.corridor.section[0].width == 3.0
    assert read.initial is not None
    assert read.surface["left_wall"].offset_m == -1.5
