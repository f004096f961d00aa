"""Image motion on real frames: a camera on a linear slider, past posters, at a constant speed by its motor's record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import estimate_motion
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.motion import MotionRun, pictures, run_motion
from axialnav.replay.motion_table import score
from tests.bench.markdown import number, table
from tests.bench.slider_scene import SLOPE, fit_scene, motion_field, point_motion, ripple, twin

Array = NDArray[np.float64]

SLIDER = "davis_slider_far"
DISTANCE_M = 0.603
ASKED_SHARE = 0.005
HONEST_Z = (0.5, 2.0)  # error over sigma, root mean square: 1 for an honest sigma
HEAD = (
    "flight", "windows", "speed asked", "speed by slider [m/s]", "measured [m/s]", "error", "RMSE [m/s]",
    "sigma [m/s]", "verdict",
)  # fmt: skip
FRAMES, LAG = 5, 4  # frames in a window, and between the pictures from which the posters' shape is taken
STEADY = 2e-3  # how far the record may be from its median where the speed is called constant
AGAINST = ("the motor's record, one distance", "what a wall of this shape gives", "the same, with the slider's ripple")
SCENE_HEAD = ("compared with", "windows", "mean error [px]", "scatter [px]", "error / sigma", "in 95 %", "verdict")


def slider_table(folder: Path) -> str:
    """Table of the slider run, or the line that says it is not there."""
    if not (folder / SLIDER / "mav0").is_dir():
        return f"skipped: {SLIDER} is not in {folder}"
    flight = load_flight(folder / SLIDER)
    run = run_motion(flight, frames=FRAMES, distance_m=DISTANCE_M)
    seen = compare(flight, run)
    parts = (
        "Image motion on real frames:",
        table(HEAD, [slider_row(flight, run)]),
        table(SCENE_HEAD, scene_rows(seen)),
    )
    told = f"other turns tell {100 * seen.repeats:.0f} % of the variance of the carriage's steps in each turn."
    return "\n\n".join((*parts, f"The ripple comes once in {seen.period:.2f} frames; {told}"))


def slider_row(flight: Flight, run: MotionRun) -> list[str]:
    """Speed of the camera along the slider from its frames, against the slider's own record."""
    result = score(run, "m/s")
    if result is None:
        return [flight.name, f"0/{len(run.estimates)}", *["-"] * 6, "SHORT: no window accepted"]
    share = result.mean_error / result.mean_truth
    return [
        flight.name,
        f"{result.used}/{len(run.estimates)}",
        f"within {100 * ASKED_SHARE:.1f} %",
        number(result.mean_truth, 4),
        number(result.mean_truth + result.mean_error, 4),
        f"{100 * share:+.2f} %",
        number(result.rmse, 4),
        number(result.sigma, 4),
        "SHORT: speed" if abs(share) > ASKED_SHARE else "ok",
    ]


@dataclass(frozen=True)
class Compared:
    """Windows of the slider and what they should have said, from less to more knowledge.

    Parameters
    ----------
    value, sigma
        The estimates [px per frame], shape (n,).
    expected
        Motor's record; what the estimator makes of a wall of this shape; that and the slider's ripple, shape (3, n).
    period
        Of the ripple [frames].
    repeats
        Share of the variance of the carriage's steps that other turns tell.
    """

    value: Array
    sigma: Array
    expected: Array
    period: float
    repeats: float


def compare(flight: Flight, run: MotionRun, every: int = 1) -> Compared:
    """Every so many of the windows in which the record is constant, against what can be known of them otherwise.

    Nothing that is expected of a window comes from its own frames but the texture: the shape of the wall is that of
    pairs without them, the ripple that of other turns, and both are Lucas-Kanade's.
    """
    assert run.truth is not None
    record = run.truth.displacement_px
    steady = np.flatnonzero(np.abs(record / np.median(record) - 1.0) < STEADY)
    first, last = int(steady[0]), int(steady[-1]) + FRAMES
    frames = [np.asarray(f, dtype=np.uint8) for f in list(pictures(flight, run.camera))[first:last]]
    speed = float(np.median(record))
    far, near = point_motion(frames, LAG, speed), point_motion(frames, 1, speed)
    across, width = float(np.average(far.across, weights=far.weight)), frames[0].shape[1]
    carriage = fit_scene(near, width).carriage
    period, told = ripple(carriage)
    rng, rows = np.random.default_rng(1), []
    for index in steady[run.accepted()[steady]][::every]:
        k, estimate = int(index) - first, run.estimates[index]
        field = motion_field(fit_scene(far, width, k), frames[0].shape, k + FRAMES // 2)
        same = estimate_motion(
            twin(frames[k : k + FRAMES], field, across, rng), frame_period_s=float(run.period_s[index])
        )
        if same.accepted:
            wall = same.displacement_px
            expected = (record[index], wall, wall + float(SLOPE @ told[k : k + FRAMES - 1]))
            rows.append((estimate.displacement_px, estimate.sigma_px, *expected))
    columns = np.array(rows).T
    return Compared(
        columns[0], columns[1], columns[2:], period, float(1.0 - np.var(carriage - told) / np.var(carriage))
    )


def scene_rows(seen: Compared) -> list[list[str]]:
    """How far the windows are from what was expected of them, against their sigma; judged by the last row."""
    rows = []
    for name, expected in zip(AGAINST, seen.expected, strict=True):
        error = seen.value - expected
        z = error / seen.sigma
        size, inside = float(np.sqrt(np.mean(z**2))), float(np.mean(np.abs(z) < 1.96))
        rows.append([name, str(len(z)), number(error.mean(), 4), number(error.std(), 4), number(size, 2)])
        rows[-1] += [f"{100 * inside:.0f} %", "-"]
    rows[-1][-1] = "ok" if HONEST_Z[0] <= size <= HONEST_Z[1] else "SHORT: sigma"
    return rows
