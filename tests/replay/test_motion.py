"""``axialnav motion`` on a small rendered flight past a wall: score, table, CSV, exit codes."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.cli import main
from axialnav.replay.flight import load_flight
from axialnav.replay.motion import run_motion
from axialnav.replay.motion_table import motion_summary, score
from tests.estimators.scenes import EXPOSURE_S, HEIGHT, PERIOD_S, WIDTH, rendered

FOCAL_PX, DISTANCE_M, FRAMES = 300.0, 2.0, 9
PERIOD_NS = round(PERIOD_S * 1e9)
DISPLACEMENT_PX = -6.0  # the camera flies to its right, the wall moves to the left
SPEED_M_S = -DISPLACEMENT_PX * DISTANCE_M / (FOCAL_PX * PERIOD_S)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vehicle that flies along x and looks left, at the wall y = 2 m."""
    folder = tmp_path_factory.mktemp("wall")
    (folder / "flight.toml").write_text(
        '[flight]\nname = "wall"\n[corridor]\naxis = [1, 0, 0]\n'
        f"[surface.wall]\nnormal = [0.0, -1.0, 0.0]\noffset_m = {-DISTANCE_M}\n"
    )
    camera = folder / "mav0" / "cam0"
    (camera / "data").mkdir(parents=True)
    (camera / "sensor.yaml").write_text(
        "sensor_type: camera\nT_BS:\n  rows: 4\n  cols: 4\n"
        "  data: [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1]\n"
        f"rate_hz: 30.0\nresolution: [{WIDTH}, {HEIGHT}]\ncamera_model: pinhole\n"
        f"intrinsics: [{FOCAL_PX}, {FOCAL_PX}, {WIDTH / 2}, {HEIGHT / 2}]\n"
        f"distortion_model: none\ndistortion_coefficients: []\nexposure_s: {EXPOSURE_S}\nsurface: wall\n"
    )
    rows = ["#timestamp [ns],filename"]
    truth = [
        "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
        "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
    ]
    for k, frame in enumerate(rendered(DISPLACEMENT_PX, 21, frames=FRAMES).frames):
        t_ns = 10**9 + k * PERIOD_NS
        rows.append(f"{t_ns},{t_ns}.png")
        truth.append(f"{t_ns},{SPEED_M_S * k * PERIOD_S:.6f},0,0,1,0,0,0,{SPEED_M_S:.6f},0,0")
        cv2.imwrite(str(camera / "data" / f"{t_ns}.png"), frame)
    (camera / "data.csv").write_text("\n".join(rows) + "\n")
    place = folder / "mav0" / "state_groundtruth_estimate0"
    place.mkdir()
    (place / "data.csv").write_text("\n".join(truth) + "\n")
    return folder


def test_displacement_and_speed_are_scored_with_their_signs(flight: Path) -> None:
    run = run_motion(load_flight(flight))
    assert len(run.estimates) == FRAMES - 4
    pixels, metres = score(run, "px"), score(run, "m/s")
    assert pixels is not None
    assert metres is not None
    assert pixels.mean_truth == pytest.approx(DISPLACEMENT_PX, rel=1e-4)
    assert metres.mean_truth == pytest.approx(SPEED_M_S, rel=1e-4)
    assert pixels.rmse < 0.02
    assert metres.rmse < 0.005
    assert metres.used == FRAMES - 4


def test_unsigned_methods_are_scored_without_sign(flight: Path) -> None:
    run = run_motion(load_flight(flight), method="composite")
    result = score(run, "px")
    assert result is not None
    assert result.mean_truth == pytest.approx(-DISPLACEMENT_PX, rel=1e-3)


def test_the_table_counts_windows_and_the_csv_holds_every_one(
    flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "motion.csv"
    assert main(["motion", str(flight), "--out", str(out)]) == 0
    assert f"written    {out}" in capsys.readouterr().out
    lines = out.read_text().splitlines()
    assert lines[0].startswith("#timestamp [ns],window [s],displacement [px]")
    assert len(lines) == 1 + FRAMES - 4
    values = np.array([[float(x) for x in line.split(",")[:4]] for line in lines[1:]])
    assert np.abs(values[:, 2] - DISPLACEMENT_PX).max() < 0.05
    summary = motion_summary(run_motion(load_flight(flight)))
    assert f"used {FRAMES - 4}/{FRAMES - 4} (100 %)" in summary


def test_without_a_distance_nothing_is_scored_and_it_says_so(flight: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / "mav0").symlink_to(flight / "mav0", target_is_directory=True)
    (bare / "flight.toml").write_text('[flight]\nname = "bare"\n[corridor]\naxis = [1, 0, 0]\n')
    run = run_motion(load_flight(bare))
    assert run.truth is None
    assert "NOT_EVALUATED" in motion_summary(run)
    given = score(run_motion(load_flight(bare), distance_m=DISTANCE_M), "m/s")
    assert given is not None
    assert given.mean_error == pytest.approx(0.0, abs=0.005)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"camera": "cam7"}, FlightError, "cam7"),
        ({"frames": 50}, FlightError, "50 are needed"),
        ({"distance_m": -1.0}, ConfigError, "--distance-m"),
    ],
)
def test_what_cannot_run_is_named(flight: Path, options: dict[str, object], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        run_motion(load_flight(flight), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "code"), [(["--method", "joit"], 2), (["--camera", "cam7"], 3), (["--axis", "q"], 2)]
)
def test_exit_codes_tell_usage_from_input(flight: Path, arguments: list[str], code: int) -> None:
    assert main(["motion", str(flight), *arguments]) == code
