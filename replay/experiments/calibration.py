"""The line from composite length to velocity (the paper's Fig. 9)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from axialnav.models.camera import CompositeBlur, composite_law
from axialnav.replay.experiments.figures import COLOURS, INK, RULE, draw
from axialnav.replay.experiments.line import Line, fit_line
from axialnav.replay.experiments.methods import METHODS, Window
from axialnav.replay.experiments.result import ExperimentResult
from axialnav.replay.experiments.tables import Table
from axialnav.replay.simulate.render import (
    BRIGHT,
    CameraModel,
    Scene,
    Trajectory,
    displacement_px,
    photographic_wall,
    render_frames,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "calibration"
FRAMES, CONTRAST, TRIALS = 5, 0.1, 60
SLOWEST_M_S, FASTEST_M_S = 0.1, 2.5
PIXEL_M, LENS_M, DISTANCE_M = 3.24e-6, 1.95e-3, 2.026
CAMERA = CameraModel(width=1920, height=1080, focal_px=LENS_M / PIXEL_M)
FITTED = ("stripes, composite", "stripes, composite, oracle", "DCT, composite", "composite fit", "joint")
PAPER = ("the paper, against UWB", 0.0199, 0.0047, 0.0535)
Array = NDArray[np.float64]


def law_m_s_px() -> float:
    """Slope of the composite law ``v = l_c p H / (h N T)`` [m/s per px]; 0.0202 for the paper's camera at 2.026 m."""
    return composite_law(CompositeBlur(1.0, FRAMES, CAMERA.frame_period_s), CAMERA.focal_px, DISTANCE_M)


def run(out: Path, seed: int, trials: int | None) -> ExperimentResult:
    """Fit velocity against composite length for every method; see ``experiment_command``."""
    velocity, lengths = measure(seed, trials or TRIALS)
    lines = {name: fit_line(length, velocity) for name, length in lengths.items()}
    inliers = {name: fit_line(near_the_law(length, velocity), velocity) for name, length in lengths.items()}
    table = Table(
        ("points", "slope [m/s/px]", "+-", "intercept [m/s]", "+-", "residual rms [m/s]", "max [m/s]", "n"),
        tuple(
            [(PAPER[0], PAPER[1], math.nan, PAPER[2], math.nan, PAPER[3], math.nan, "-")]
            + [_row(f"{name}, all answers", line) for name, line in lines.items()]
            + [_row(f"{name}, within 20 %", line) for name, line in inliers.items()]
        ),
    )
    points = Table(
        ("velocity [m/s]", *(f"{name} [px]" for name in FITTED)),
        tuple((float(v), *(float(lengths[n][i]) for n in FITTED)) for i, v in enumerate(velocity)),
    )
    files = (
        table.write(out / f"{NAME}.csv"),
        points.write(out / f"{NAME}-points.csv"),
        figure(out / f"{NAME}.svg", velocity, lengths, lines["joint"]),
    )
    law = f"composite law at {DISTANCE_M} m: {law_m_s_px():.4f} m/s per px; {len(velocity)} windows of {FRAMES} frames"
    return ExperimentResult(NAME, f"{law}\n\n{table.text()}", files)


def measure(seed: int, trials: int) -> tuple[Array, dict[str, Array]]:
    """True velocities [m/s], evenly spread, and each method's composite lengths [px], NaN without answer; (trials,)."""
    wall = photographic_wall(np.random.default_rng(seed))
    velocity = np.linspace(SLOWEST_M_S, FASTEST_M_S, trials)
    lengths = {name: np.full(trials, np.nan) for name in FITTED}
    for i, speed in enumerate(velocity):
        step = displacement_px(CAMERA.focal_px, float(speed), DISTANCE_M, CAMERA.frame_period_s)
        scene = Scene(wall, CONTRAST, BRIGHT, CAMERA, Trajectory(step))
        frames = render_frames(scene, FRAMES, np.random.default_rng([seed, i])).frames
        window = Window(frames, CAMERA.frame_period_s, CAMERA.exposure_s)
        for name in FITTED:
            answers = [a for a in METHODS[name](window) if math.isfinite(a)]
            if answers:
                lengths[name][i] = FRAMES * min(answers, key=lambda answer: abs(answer - step))
    return velocity, lengths


def near_the_law(length_px: Array, velocity_m_s: Array) -> Array:
    """Lengths with those more than 20 % off the composite law replaced by NaN, shape (n,)."""
    off = np.abs(length_px * law_m_s_px() / velocity_m_s - 1.0)
    return np.where(off <= 0.2, length_px, np.nan)


def figure(path: Path, velocity: Array, lengths: dict[str, Array], line: Line | None) -> Path:
    """Velocity against composite length, and what is left over after the line of the joint estimator."""

    def paint(sheet: Figure) -> None:
        """Line above, residuals below."""
        above, below = sheet.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        longest = 1.1 * FASTEST_M_S / law_m_s_px()
        span = np.array([0.0, longest])
        above.plot(span, law_m_s_px() * span, color=INK, lw=0.8, label=f"composite law, {law_m_s_px():.4f} m/s per px")
        fitted = PAPER[1] * span + PAPER[2]
        above.plot(span, fitted, "--", color=INK, lw=0.8, label=f"the paper's fit, {PAPER[1]} $l_c$ + {PAPER[2]}")
        below.plot(span, fitted - law_m_s_px() * span, "--", color=INK, lw=0.8)
        for colour, name in zip(COLOURS, FITTED, strict=False):
            beyond = int(np.sum(lengths[name] > longest))
            label = f"{name} ({beyond} beyond the axis)" if beyond else name
            above.plot(lengths[name], velocity, "o", ms=3, color=colour, alpha=0.7, label=label)
            below.plot(lengths[name], velocity - law_m_s_px() * lengths[name], "o", ms=3, color=colour, alpha=0.7)
        above.set(xlim=(0.0, longest), ylim=(0.0, 1.05 * FASTEST_M_S), title="velocity [m/s]")
        below.axhspan(-PAPER[3], PAPER[3], color=RULE, alpha=0.6, lw=0)
        title = "velocity less law [m/s]; grey: the paper's residual rms, 0.0535"
        if line is not None:
            title += f", ours {line.residual_rms_m_s:.1g} (joint)"
        below.set(ylim=(-0.08, 0.08), title=title, xlabel="composite length $l_c = N d$ [px]")
        above.legend()

    return draw(path, (7.0, 5.6), paint)


def _row(name: str, line: Line | None) -> tuple[str | float, ...]:
    if line is None:
        return (name, *[math.nan] * 6, 0)
    return (
        name,
        line.slope_m_s_px,
        line.slope_sigma,
        line.intercept_m_s,
        line.intercept_sigma,
        line.residual_rms_m_s,
        line.residual_max_m_s,
        line.points,
    )
