"""One frame against the composite of five (the paper's Fig. 5-7)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from axialnav.estimators.baselines.composite_mean import composite_mean
from axialnav.estimators.baselines.stripes import binarised_spectrum, stripes_length
from axialnav.replay.experiments.figures import COLOURS, draw, log_spectrum, picture, shrunk
from axialnav.replay.experiments.methods import METHODS, Window
from axialnav.replay.experiments.result import ExperimentResult
from axialnav.replay.experiments.scores import Score, score
from axialnav.replay.experiments.tables import Table
from axialnav.replay.simulate.render import BRIGHT, Scene, Trajectory, photographic_wall, render_frames
from axialnav.replay.simulate.textures import load_texture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "single-vs-composite"
DISPLACEMENTS_PX = (0.7, 1.5, 3.3, 6.7, 12.3, 20.7, 31.0, 45.0)
FRAMES, CONTRAST, TRIALS = 5, 0.1, 12
HAND_BLUR_PX = 63
PLOTTED = (
    "stripes, one frame",
    "stripes, composite",
    "DCT, one frame",
    "DCT, composite",
    "single fit, one frame",
    "composite fit",
    "joint",
)
Scores = dict[str, list[Score]]


def run(out: Path, seed: int, trials: int | None) -> ExperimentResult:
    """Measure rendered windows with every method; see ``experiment_command``."""
    scores = measure(seed, trials or TRIALS)
    table = Table(
        ("method", "d [px/frame]", "blur l [px]", "trials", "failed [%]", "median |error| [px]", "rms of good [px]"),
        tuple(
            (name, d, 0.3 * d, s.trials, 100.0 * s.failed, s.median_px, s.rms_px)
            for name, row in scores.items()
            for d, s in zip(DISPLACEMENTS_PX, row, strict=True)
        ),
    )
    reading = stripes_length(hand_blurred())
    first = f"Algorithm 1 on a noise-free photograph blurred by hand over {HAND_BLUR_PX} px: " + (
        f"{reading.length_px:.1f} px" if reading.found else reading.reason
    )
    files = (table.write(out / f"{NAME}.csv"), figure(out / f"{NAME}.svg", seed, scores))
    return ExperimentResult(NAME, f"{first}\n\n{pivot(scores).text()}", files)


def measure(seed: int, trials: int) -> Scores:
    """Scores of every method for every displacement, contrast 0.1, bright light, five frames."""
    wall = photographic_wall(np.random.default_rng(seed))
    scores: Scores = {name: [] for name in METHODS}
    for number, displacement in enumerate(DISPLACEMENTS_PX):
        answers: dict[str, list[tuple[float, ...]]] = {name: [] for name in METHODS}
        scene = Scene(wall, CONTRAST, BRIGHT, trajectory=Trajectory(displacement))
        for trial in range(trials):
            window = _window(scene, np.random.default_rng([seed, number, trial]))
            for name, method in METHODS.items():
                answers[name].append(method(window))
        for name in METHODS:
            scores[name].append(score(answers[name], [displacement] * trials))
    return scores


def pivot(scores: Scores) -> Table:
    """Methods down, displacements across: failures [%] / median error [px]."""
    columns = ("failed % / median error px at d =", *(f"{d:g}" for d in DISPLACEMENTS_PX))
    rows = tuple((name, *(_cell(s) for s in row)) for name, row in scores.items())
    return Table(columns, rows)


def hand_blurred() -> NDArray[np.float32]:
    """A photograph without noise under a box of ``HAND_BLUR_PX``, as in the paper's Fig. 5."""
    blurred = uniform_filter1d(load_texture("concrete"), HAND_BLUR_PX, axis=1)
    return np.asarray(blurred[100:640, 100:1060], dtype=np.float32)


def figure(path: Path, seed: int, scores: Scores) -> Path:
    """Spectra of the hand-blurred photograph, one frame and the composite, and failures against displacement."""
    wall = photographic_wall(np.random.default_rng(seed))
    scene = Scene(wall, CONTRAST, BRIGHT, trajectory=Trajectory(12.3))
    frames = _window(scene, np.random.default_rng([seed, 0])).frames
    still = _window(replace(scene, trajectory=Trajectory(0.0)), np.random.default_rng([seed, 0])).frames[0]
    shots = {
        f"blurred by hand, {HAND_BLUR_PX} px": hand_blurred(),
        "standing still": still,
        "one frame, d = 12.3 px": frames[2],
        "composite of five": composite_mean(frames),
    }

    def paint(sheet: Figure) -> None:
        """Spectra above, failures and errors below."""
        grid = sheet.add_gridspec(4, 4, height_ratios=(1, 1, 1, 2.4))
        for column, (title, image) in enumerate(shots.items()):
            image = np.asarray(image, dtype=np.float32)
            picture(sheet.add_subplot(grid[0, column]), shrunk(image), title)
            picture(sheet.add_subplot(grid[1, column]), log_spectrum(image), "spectrum")
            binary = binarised_spectrum(image - image.mean())
            picture(
                sheet.add_subplot(grid[2, column]),
                shrunk(binary[:, binary.shape[1] // 4 : -binary.shape[1] // 4]),
                "binarised",
            )
        _curves(sheet, grid, scores)

    return draw(path, (9.0, 7.2), paint)


def _curves(sheet: Figure, grid: object, scores: Scores) -> None:
    failed, error = sheet.add_subplot(grid[3, :2]), sheet.add_subplot(grid[3, 2:])  # type: ignore[index]
    for colour, name in zip(COLOURS, PLOTTED, strict=True):
        row = scores[name]
        failed.plot(DISPLACEMENTS_PX, [100 * s.failed for s in row], "o-", ms=3, lw=1.2, color=colour, label=name)
        error.plot(DISPLACEMENTS_PX, [s.median_px for s in row], "o-", ms=3, lw=1.2, color=colour)
    for axes, title in ((failed, "failed (error > 20 % or no answer) [%]"), (error, "median |error| [px/frame]")):
        axes.set_xscale("log")
        axes.set_title(title)
        axes.set_xlabel("displacement d [px/frame]")
    error.set_yscale("log")
    sheet.legend(*failed.get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _window(scene: Scene, rng: np.random.Generator) -> Window:
    rendering = render_frames(scene, FRAMES, rng)
    return Window(rendering.frames, scene.camera.frame_period_s, scene.camera.exposure_s)


def _cell(entry: Score) -> str:
    median = "-" if np.isnan(entry.median_px) else f"{entry.median_px:.2g}"
    return f"{100 * entry.failed:.0f} / {median}"
