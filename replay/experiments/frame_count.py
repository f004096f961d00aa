"""How many frames: 2, 3, 5, 10 and 20 (the paper's Fig. 8)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from axialnav.estimators.baselines.composite_mean import composite_mean
from axialnav.replay.experiments.figures import COLOURS, draw, log_spectrum, picture
from axialnav.replay.experiments.methods import METHODS, Window
from axialnav.replay.experiments.result import ExperimentResult
from axialnav.replay.experiments.scores import Score, score
from axialnav.replay.experiments.tables import Table
from axialnav.replay.simulate.render import DIM, Scene, Trajectory, photographic_wall, render_frames

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "frames"
COUNTS = (2, 3, 5, 10, 20)
CONTRAST, TRIALS = 0.05, 20
SLOWEST_PX, FASTEST_PX = 1.0, 20.0
SHOWN_PX = 8.0  # displacement of the spectra in the figure
COMPARED = (
    "stripes, composite",
    "stripes, composite, oracle",
    "dark line, composite",
    "DCT, composite",
    "cepstrum, composite",
    "composite fit",
    "joint",
)
Scores = dict[str, list[Score]]


def run(out: Path, seed: int, trials: int | None) -> ExperimentResult:
    """Measure windows of every length with every method that uses them whole; see ``experiment_command``."""
    scores = measure(seed, trials or TRIALS)
    table = Table(
        ("method", "frames", "window [s]", "trials", "failed [%]", "median |error| [px]", "rms of good [px]"),
        tuple(
            (name, n, (n - 1) / 30.0, s.trials, 100.0 * s.failed, s.median_px, s.rms_px)
            for name, row in scores.items()
            for n, s in zip(COUNTS, row, strict=True)
        ),
    )
    files = (table.write(out / f"{NAME}.csv"), figure(out / f"{NAME}.svg", seed, scores))
    return ExperimentResult(NAME, pivot(scores).text(), files)


def measure(seed: int, trials: int) -> Scores:
    """Scores for every number of frames; contrast 0.05, dim light, displacements log-uniform over 1-20 px."""
    wall = photographic_wall(np.random.default_rng(seed))
    scores: Scores = {name: [] for name in COMPARED}
    for count in COUNTS:
        answers: dict[str, list[tuple[float, ...]]] = {name: [] for name in COMPARED}
        truths = []
        for trial in range(trials):
            rng = np.random.default_rng([seed, trial])
            truths.append(math.exp(rng.uniform(math.log(SLOWEST_PX), math.log(FASTEST_PX))))
            window = _window(Scene(wall, CONTRAST, DIM, trajectory=Trajectory(truths[-1])), count, rng)
            for name in COMPARED:
                answers[name].append(METHODS[name](window))
        for name in COMPARED:
            scores[name].append(score(answers[name], truths))
    return scores


def pivot(scores: Scores) -> Table:
    """Methods down, numbers of frames across: failures [%] / median error [px]."""
    columns = ("failed % / median error px with N =", *(str(n) for n in COUNTS))
    return Table(columns, tuple((name, *(_cell(s) for s in row)) for name, row in scores.items()))


def figure(path: Path, seed: int, scores: Scores) -> Path:
    """Spectra of composites of 2 to 20 frames above the errors they lead to."""
    wall = photographic_wall(np.random.default_rng(seed))
    scene = Scene(wall, 2.0 * CONTRAST, DIM, trajectory=Trajectory(SHOWN_PX))

    def paint(sheet: Figure) -> None:
        """Spectra above, errors against N below."""
        grid = sheet.add_gridspec(2, 2 * len(COUNTS), height_ratios=(1, 2.2))
        for i, count in enumerate(COUNTS):
            composite = composite_mean(_window(scene, count, np.random.default_rng(seed)).frames)
            axes = sheet.add_subplot(grid[0, 2 * i : 2 * i + 2])
            picture(axes, log_spectrum(composite, (90, 140)), f"spectrum, N = {count}")
        left, right = sheet.add_subplot(grid[1, : len(COUNTS)]), sheet.add_subplot(grid[1, len(COUNTS) :])
        for colour, name in zip(COLOURS, COMPARED, strict=True):
            row = scores[name]
            left.plot(COUNTS, [100 * s.failed for s in row], "o-", ms=3, lw=1.2, color=colour, label=name)
            right.plot(COUNTS, [s.rms_px for s in row], "o-", ms=3, lw=1.2, color=colour)
        left.set_title("failed (error > 20 % or no answer) [%]")
        right.set_title("rms error of those that did not fail [px/frame]")
        right.set_yscale("log")
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_xticks(COUNTS, [str(n) for n in COUNTS], minor=False)
            axes.minorticks_off()
            axes.set_xlabel("frames N")
        sheet.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    return draw(path, (9.0, 5.4), paint)


def _window(scene: Scene, frames: int, rng: np.random.Generator) -> Window:
    rendering = render_frames(scene, frames, rng)
    return Window(rendering.frames, scene.camera.frame_period_s, scene.camera.exposure_s)


def _cell(entry: Score) -> str:
    median = "-" if math.isnan(entry.median_px) else f"{entry.median_px:.2g}"
    return f"{100 * entry.failed:.0f} / {median}"
