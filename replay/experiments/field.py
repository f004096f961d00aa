"""The paper's field flights: its Table 1 and Fig. 11, flown in the simulator through the whole chain from frames.

Six flights: straight, stairs and corner, each once with UWB in the filter ("UWB-referenced") and once without
("blur-referenced").  Beside the fused velocity stands what the paper does: the length of the composite's stripes times
the wall distance, no inertial unit, no gate.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.replay.experiments.figures import COLOURS, INK, draw
from axialnav.replay.experiments.result import ExperimentResult
from axialnav.replay.experiments.tables import Cell, Table
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.motion import run_motion
from axialnav.replay.run import Run, replay
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.mission import CameraPlan, Mission
from axialnav.replay.simulate.mission_checks import check_mission
from axialnav.replay.simulate.scenarios import BUILT_IN

Array = NDArray[np.float64]
SECTIONS = ("straight", "stairs", "corner")
FLIGHT_S = 20
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 320, 240, 240.0
STRIPES = "stripes, no gate"
COLUMNS = ("flight", "estimate", "mean [m/s]", "RMSE [m/s]", "max [m/s]", "min [m/s]", "in 3 sigma", "answers")
PAPER: tuple[tuple[Cell, ...], ...] = (
    ("straight", "the paper", 0.039, 0.1964, 0.4812, math.nan, math.nan, math.nan),
    ("corner", "the paper, UWB", math.nan, math.nan, 0.6034, math.nan, math.nan, math.nan),
    ("all", "the paper", 0.065, 0.3, math.nan, math.nan, math.nan, math.nan),
)


@dataclass(frozen=True)
class Curve:
    """A speed along the corridor over time, for the figure."""

    t_s: NDArray[np.floating]
    speed_m_s: NDArray[np.floating]


@dataclass(frozen=True)
class FieldFlight:
    """One flight: its row in the table and its curves."""

    title: str
    rows: tuple[tuple[Cell, ...], ...]
    truth: Curve
    fused: Curve
    stripes: Curve


def run(out: Path, seed: int = 1, trials: int | None = None) -> ExperimentResult:
    """Fly, replay and score; ``trials`` is the length of a flight in seconds."""
    seconds = float(FLIGHT_S if trials is None else max(trials, 10))
    flights = []
    for number, section in enumerate(SECTIONS):
        for reference in ("UWB", "blur"):
            with tempfile.TemporaryDirectory() as folder:
                mission = field_mission(section, seconds, reference)
                simulate(mission, Path(folder) / "flight", seed=seed + 2 * number + (reference == "blur"))
                flights.append(_fly(load_flight(Path(folder) / "flight"), f"{section}, {reference}-referenced"))
    rows = tuple(row for flight in flights for row in flight.rows)
    table = Table(COLUMNS, (*rows, *PAPER))
    files = table.write(out / "field.csv"), draw(out / "field.svg", (9.0, 7.5), lambda figure: _paint(figure, flights))
    return ExperimentResult("field", table.text(), files)


def field_mission(section: str, seconds: float, reference: str) -> Mission:
    """The mission of one flight: the paper's changing speeds, small pictures, reflections by the geometry."""
    base = BUILT_IN[section][0](seconds)
    mission = msgspec.structs.replace(
        base,
        duration_s=seconds,
        vehicle=msgspec.structs.replace(base.vehicle, profile="paper"),
        camera=CameraPlan(width_px=WIDTH_PX, height_px=HEIGHT_PX, focal_px=FOCAL_PX),
        uwb=msgspec.structs.replace(base.uwb, condition="corner" if reference == "UWB" else "none"),
    )
    check_mission(mission)
    return mission


def _fly(flight: Flight, title: str) -> FieldFlight:
    fused = replay(flight)
    rows = [_fused_row(title, "fused", fused)]
    if "uwb0" in flight.tables:
        rows.append(_fused_row(title, "UWB and IMU alone", replay(flight, without=("cam0",))))
    stripes, error, windows = paper_speed(flight)
    rows.append(_stripes_row(title, error, windows))
    truth = flight.truth
    assert truth is not None
    start = int(truth.t_ns[0])
    t = (fused.track.t_ns - start) * 1e-9
    speed = np.linalg.norm(truth.velocity_m_s, axis=1)
    estimate = np.linalg.norm(fused.track.velocity_m_s, axis=1)
    return FieldFlight(title, tuple(rows), Curve((truth.t_ns - start) * 1e-9, speed), Curve(t, estimate), stripes)


def _fused_row(title: str, name: str, run: Run) -> tuple[Cell, ...]:
    scores = run.metrics["axial_velocity_m_s"]
    keys = ("mean_error", "rmse", "max_abs_error", "min_abs_error", "in_3_sigma")
    return (title, name, *(float(scores[key]) for key in keys), 1.0)


def paper_speed(flight: Flight) -> tuple[Curve, Array, int]:
    """Speed by the paper's method from the true wall distance, its error [m/s], and the number of windows."""
    try:
        run = run_motion(flight, method="stripes", frames=5, undistort=False)
    except FrameError:
        return Curve(np.empty(0), np.empty(0)), np.empty(0), 0
    truth = run.truth
    assert truth is not None
    assert flight.truth is not None
    t = np.array([e.t_ns for e in run.estimates], dtype=np.int64)
    speed = np.abs(run.values("displacement_px")) * truth.metres_per_px / run.period_s
    error = speed - np.abs(truth.speed_m_s)
    good = np.isfinite(error)
    return Curve((t[good] - int(flight.truth.t_ns[0])) * 1e-9, speed[good]), error[good], len(t)


def _stripes_row(title: str, error: Array, windows: int) -> tuple[Cell, ...]:
    if not error.size:
        return (title, STRIPES, *([math.nan] * 5), 0.0)
    size = np.abs(error)
    rmse = float(np.sqrt((error**2).mean()))
    share = len(error) / windows
    return (title, STRIPES, float(error.mean()), rmse, float(size.max()), float(size.min()), math.nan, share)


def _paint(figure: Any, flights: list[FieldFlight]) -> None:
    """Fig. 11: speed over time, one panel a flight."""
    grid = figure.subplots(len(SECTIONS), 2, sharex=True, sharey=True, squeeze=False)
    for axes, flight in zip(grid.ravel(), flights, strict=True):
        stripes = flight.stripes
        axes.plot(stripes.t_s, stripes.speed_m_s, ".", ms=2, color=COLOURS[1], label=STRIPES, rasterized=True)
        axes.plot(flight.truth.t_s[::10], flight.truth.speed_m_s[::10], color=INK, lw=2.0, label="truth")
        axes.plot(flight.fused.t_s[::10], flight.fused.speed_m_s[::10], color=COLOURS[0], lw=1.0, label="fused")
        axes.set(title=flight.title, ylim=(0.0, 2.0))
    for axes in grid[:, 0]:
        axes.set_ylabel("speed [m/s]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    grid[0, 0].legend(loc="upper left", ncols=3)
