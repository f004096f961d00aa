"""Missions: what cannot be flown is one clear line, what can be is the same bytes for the same seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from axialnav.replay import cli
from axialnav.replay.flight import load_flight
from axialnav.replay.simulate.flight import fly_mission, simulate
from axialnav.replay.simulate.scenarios import mission_of

GOOD = """
[[section]]
kind = "straight"
length_m = 12.0
left = {texture = "near_blank", contrast = 0.02}
opening = [{side = "left", start_m = 5.0, length_m = 1.0}]

[[section]]
kind = "corner"
length_m = 3.5
turn_deg = 60.0

[[section]]
kind = "straight"
length_m = 8.0
width_m = 4.0
height_m = 3.4
"""
BAD = {
    "zero width": (GOOD.replace("width_m = 4.0", "width_m = 0.0"), r"section 3 .*width_m is 0, must be 1 to 50"),
    "anchor in a wall": (GOOD + "[uwb.anchors]\na1 = [2.0, 1.7, 1.0]\n", r"anchor a1 .* is inside a wall"),
    "too fast": (GOOD + "[vehicle]\nspeed_m_s = 14.0\n", r"beyond the camera's reach of 64; fly at most 9\.0"),
    "unknown key": (GOOD + "widht_m = 3.0\n", "widht_m.*width_m"),
    "no section": ("name = 'x'\n", "section"),
    "turn in a straight": (GOOD.replace("length_m = 12.0", "length_m = 12.0\nturn_deg = 9.0"), "only a corner turns"),
    "sharp corner": (GOOD.replace("length_m = 3.5", "length_m = 1.5"), "would cut the inner wall"),
    "steep stairs": (GOOD.replace('"corner"', '"stairs"').replace("turn_deg = 60.0", "rise_m = 9.0"), "nor steeper"),
    "too low": (GOOD + "[vehicle]\nheight_m = 0.2\n", "of the floor, must keep"),
    "opening outside": (GOOD.replace("start_m = 5.0", "start_m = 11.5"), "must lie between"),
    "long exposure": (GOOD + "[camera]\nexposure_s = 0.05\n", "longer than the frame period"),
    "slow readout": (GOOD + "[camera]\nreadout_s = 0.05\n", "longer than the frame period"),
    "odd width": (GOOD + "[camera]\nwidth_px = 641\n", "must be even"),
    "days of standing": (GOOD + "[vehicle]\nstill_s = 1e9\n", "must be at most 36000; shorten it"),
    "creeping": (GOOD + "[vehicle]\nspeed_m_s = 1e-6\n", "fly faster"),
    "endless": ("duration_s = 1e12\n" + GOOD, "must be at most 36000; shorten it"),
    "fast radio": (GOOD + "[uwb]\nrate_hz = 1e9\n", "<= 1000.0, at `uwb.rate_hz`"),
    "no such texture": (GOOD.replace("near_blank", "wood"), "'wood', at .*; there are concrete, plaster, rock"),
    "no such fault": ('faults = ["fog"]\n' + GOOD, "'fog', at .*; there are tof_misses"),
    "no number": (GOOD.replace("width_m = 4.0", "width_m = nan"), "must be a finite number"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mission_is_one_clear_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, message = BAD[name]
    (tmp_path / "m.toml").write_text(text, encoding="utf-8")
    assert cli.main(["simulate", str(tmp_path / "m.toml"), str(tmp_path / "out")]) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(printed)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["strait", "OUT"], "is 'straight' meant"),
        (["straight", "OUT", "--uwb", "rampp"], "must be one of clean"),
        (["straight", "OUT", "--duration", "1"], "must be 5 to"),
        (["straight", "OUT", "--seed", "-1"], "must be 0 or more"),
        (["missing.toml", "OUT"], "cannot be read"),
    ],
)
def test_bad_arguments_are_usage_errors(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(tmp_path / "out") if word == "OUT" else word for word in arguments]
    assert cli.main(["simulate", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_flight_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "straight", str(tmp_path / "f"), "--no-frames", "--duration", "6"]
    assert cli.main(words) == 0
    assert cli.main(words) == 3
    assert "holds a flight already" in capsys.readouterr().err


def small_camera(mission: Path) -> str:
    mission.write_text(GOOD + "[camera]\nwidth_px = 96\nheight_px = 64\nfocal_px = 60.0\n", encoding="utf-8")
    return str(mission)


def test_equal_seeds_write_equal_bytes_and_others_do_not(tmp_path: Path) -> None:
    mission = mission_of(small_camera(tmp_path / "m.toml"), duration_s=6.0)
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        simulate(mission, tmp_path / name, seed=seed)
    a, b, c = (
        {p.relative_to(tmp_path / n).as_posix(): p.read_bytes() for p in (tmp_path / n).rglob("*") if p.is_file()}
        for n in "abc"
    )
    assert a == b
    same = {name for name in a if name in c and a[name] == c[name]}
    assert {name for name in same if name.endswith((".csv", ".png"))} <= {"mav0/cam0/data.csv"}


def test_a_written_flight_reads_back_without_a_drop(tmp_path: Path) -> None:
    flight = simulate(mission_of(small_camera(tmp_path / "m.toml"), duration_s=6.0), tmp_path / "f", seed=1)
    again = load_flight(tmp_path / "f")
    assert again.drops == ()
    assert again.config == flight.config
    for name, table in flight.tables.items():
        np.testing.assert_array_equal(again.tables[name].t_ns, table.t_ns)
        for column, values in table.columns.items():
            np.testing.assert_array_equal(again.tables[name].columns[column], values)


CONDITIONS = {
    "clean": (0.0, 0.02),
    "ramp": (2.3, 2.8),
    "step": (1.3, 1.7),
    "spikes": (-0.02, 0.02),
    "wild": (1.1, 1.9),
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_radio_is_as_wrong_as_its_condition_says(condition: str) -> None:
    from axialnav.replay.simulate.flight import sensed

    mission = mission_of("straight", duration_s=60.0, uwb=condition)
    flown = fly_mission(mission, seed=5)
    flight = sensed(flown, Path(), frames=False)
    table, anchors = flight.tables["uwb0"], flight.config.sensor["uwb0"].anchors
    t = (table.t_ns - 1_000_000_000) * 1e-9
    motion = flown.trajectory.at(t)
    antenna = motion.position_m + motion.rotation_WB.apply([0.0, 0.0, 0.1])
    places = np.array(list(anchors.values()))[table.columns["anchor"]]
    error = table.columns["range_m"] - np.linalg.norm(antenna - places, axis=1)
    event = (t > 25.0) & (t < 34.0)
    low, high = CONDITIONS[condition]
    assert low - 0.03 < np.median(error[event]) < high
    assert abs(np.median(error[t < 15.0])) < 0.03
    if condition == "spikes":
        assert np.mean(np.abs(error) > 1.0) == pytest.approx(0.05, abs=0.015)
