"""The paper's experiments run, write what they promise and are repeatable."""

from __future__ import annotations

import csv
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.errors import ConfigError
from axialnav.replay.experiments import calibration, frame_count, single_vs_composite
from axialnav.replay.experiments.command import EXPERIMENTS, experiment_command
from axialnav.replay.experiments.line import fit_line
from axialnav.replay.experiments.methods import METHODS, Window
from axialnav.replay.experiments.scores import score
from axialnav.replay.experiments.tables import Table
from axialnav.replay.simulate.render import BRIGHT, Scene, Trajectory, photographic_wall, render_frames


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if name != "field"])  # its own test: test_field
def test_an_experiment_writes_a_table_and_a_small_figure(name: str, tmp_path: Path) -> None:
    trials = 4 if name == "calibration" else 1
    result = experiment_command(name, tmp_path / "out", seed=3, trials=trials)
    assert "joint" in result.text
    assert {f.suffix for f in result.files} == {".csv", ".svg"}
    for file in result.files:
        assert file.stat().st_size < 300_000
        if file.suffix == ".svg":
            assert ET.parse(file).getroot().tag.endswith("svg")
        else:
            rows = list(csv.reader(file.read_text().splitlines()))
            assert len(rows) > 3
            assert all(len(row) == len(rows[0]) for row in rows)
    again = experiment_command(name, tmp_path / "again", seed=3, trials=trials)
    assert again.text == result.text
    for first, second in zip(result.files, again.files, strict=True):
        assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    ("name", "seed", "trials", "words"),
    [("colour", 1, None, "single-vs-composite"), ("frames", 1, 0, "at least 1"), ("frames", -1, 1, "negative")],
)
def test_nonsense_is_refused(name: str, seed: int, trials: int | None, words: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=words):
        experiment_command(name, tmp_path, seed, trials)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ConfigError, match="file"):
        experiment_command("frames", tmp_path / "file" / "out", 1, 1)


def test_the_composite_law_of_the_papers_camera_has_the_papers_slope() -> None:
    assert calibration.law_m_s_px() == pytest.approx(0.0202, abs=5e-5)
    one_exposure = calibration.DISTANCE_M / calibration.CAMERA.focal_px / 0.010
    assert one_exposure / calibration.law_m_s_px() == pytest.approx(5 * (1 / 30) / 0.010)  # 16.7: never mix the laws


def test_the_line_fit_agrees_with_numpy_and_its_errors_with_its_scatter() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(0.0, 120.0, 80)
    slopes, sigmas = [], []
    for _ in range(200):
        y = 0.02 * x + 0.005 + 0.05 * rng.standard_normal(80)
        line = fit_line(x, y)
        assert line is not None
        np.testing.assert_allclose([line.slope_m_s_px, line.intercept_m_s], np.polyfit(x, y, 1), rtol=1e-9, atol=1e-12)
        slopes.append(line.slope_m_s_px)
        sigmas.append(line.slope_sigma)
    assert np.std(slopes) == pytest.approx(np.mean(sigmas), rel=0.15)
    assert fit_line(np.array([1.0, 2.0, math.nan]), np.ones(3)) is None
    assert fit_line(np.ones(5), np.arange(5.0)) is None


def test_scores_count_silence_as_failure_and_take_the_nearest_candidate() -> None:
    result = score([(10.0,), (math.nan,), (2.0, 10.5), (30.0,)], [10.0] * 4)
    assert result.failed == pytest.approx(0.5)
    assert result.median_px == pytest.approx(0.5)
    assert result.rms_px == pytest.approx(math.sqrt(0.125))
    silent = score([(math.nan,)], [1.0])
    assert silent.failed == 1.0
    assert math.isnan(silent.median_px)
    with pytest.raises(ValueError, match="truths"):
        score([], [])


def test_a_table_is_aligned_on_screen_and_complete_in_csv() -> None:
    table = Table(("name", "x [px]"), (("a", 1.23456), ("bcd", math.nan)))
    lines = table.text().splitlines()
    assert lines[0] == "name  x [px]"
    assert lines[2].endswith("1.235")
    assert lines[3].endswith("-")
    assert table.csv() == "name,x [px]\na,1.23456\nbcd,\n"
    with pytest.raises(ValueError, match="2 cells"):
        Table(("a", "b"), (("c",),))


def test_every_method_means_px_per_frame() -> None:
    wall = photographic_wall(np.random.default_rng(4), rows_px=768, cols_px=2304)
    rendering = render_frames(Scene(wall, 0.2, BRIGHT, trajectory=Trajectory(45.0)), 5, np.random.default_rng(5))
    window = Window(rendering.frames, 1 / 30, 0.010)
    for name in ("dark line, one frame", "DCT, one frame", "cepstrum, one frame", "joint"):
        assert METHODS[name](window)[0] == pytest.approx(45.0, rel=0.1), name
    short = render_frames(Scene(wall, 0.2, BRIGHT, trajectory=Trajectory(4.0)), 5, np.random.default_rng(5))
    window = Window(short.frames, 1 / 30, 0.010)
    for name in ("DCT, composite", "cepstrum, composite", "composite fit", "joint"):
        assert METHODS[name](window)[0] == pytest.approx(4.0, rel=0.1), name


def test_black_frames_give_no_number() -> None:
    window = Window(np.zeros((5, 128, 320), dtype=np.uint8), 1 / 30, 0.010)
    for name, method in METHODS.items():
        assert all(math.isnan(answer) for answer in method(window)), name


def test_experiments_compare_known_methods() -> None:
    used = {*frame_count.COMPARED, *calibration.FITTED, *single_vs_composite.PLOTTED}
    assert used <= set(METHODS)
    assert {"joint", "composite fit"} <= used
