"""The whole chain from frames on simulated corridors: ``python -m tests.bench.bench_corridor [SEEDS] [SECONDS]``.

Each seed flies one section after another past walls from strong to nearly blank; every number is over all seeds.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.replay.flight import Truth, load_flight
from axialnav.replay.run import Run, replay
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.mission import CameraPlan, Mission, WallLook
from axialnav.replay.simulate.mission_checks import check_mission
from axialnav.replay.simulate.scenarios import BUILT_IN
from tests.bench.markdown import machine, number, table

SEEDS, SECONDS = 20, 20.0
CAMERA = CameraPlan(width_px=320, height_px=240, focal_px=240.0)
WALLS = (
    WallLook(texture="rock", contrast=0.2),
    WallLook(texture="mixed", contrast=0.1),
    WallLook(texture="plaster", contrast=0.05),
    WallLook(texture="near_blank", contrast=0.02),
)
ASKED_M_S = {"straight": 0.02, "stairs": 0.03, "corner": 0.05}
ASKED_CORNER_MAX_M_S, ASKED_DRIFT, ASKED_COVERAGE = 0.15, 0.003, 0.99
HEAD = (
    "section", "UWB", "flights", "axial RMSE [m/s]", "worst flight", "asked", "max [m/s]", "in 3 sigma",
    "drift [%]", "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Score:
    """One section of one flight."""

    rmse_m_s: float
    max_m_s: float
    in_3_sigma: float
    drift: float


def mission_of(section: str, seed: int, seconds: float) -> Mission:
    """A built-in corridor with the wall of the seed."""
    base = BUILT_IN[section][0](seconds)
    wall = WALLS[seed % len(WALLS)]
    plans = tuple(msgspec.structs.replace(plan, left=wall) for plan in base.section)
    mission = msgspec.structs.replace(base, duration_s=seconds, camera=CAMERA, section=plans)
    check_mission(mission)
    return mission


def fly(section: str, seed: int, seconds: float) -> Iterator[Score]:
    """Scores of one flight with UWB and without."""
    with tempfile.TemporaryDirectory() as folder:
        simulate(mission_of(section, seed, seconds), Path(folder) / "flight", seed=seed)
        flight = load_flight(Path(folder) / "flight")
        assert flight.truth is not None
        for without in ((), ("uwb0",)):
            yield score(replay(flight, without=without), section, flight.truth)


def score(run: Run, section: str, truth: Truth) -> Score:
    """What the metrics say of the named kind of section, and the drift of the distance flown."""
    axial = next(value for name, value in run.metrics["sections"].items() if name.startswith(section))
    return Score(axial["rmse"], axial["max_abs_error"], axial["in_3_sigma"], drift(run, truth))


def drift(run: Run, truth: Truth) -> float:
    """Error of the distance flown along the true direction, as a share of it [-]."""
    t = run.track.t_ns
    inside = (t >= truth.t_ns[0]) & (t <= truth.t_ns[-1])
    speed = np.array([np.interp(t[inside], truth.t_ns, c) for c in truth.velocity_m_s.T]).T
    size = np.linalg.norm(speed, axis=1)
    moving = size > 0.05
    along = (run.track.velocity_m_s[inside][moving] * speed[moving]).sum(axis=1) / size[moving]
    return float(abs((along - size[moving]).sum()) / size[moving].sum())


def row(section: str, uwb: str, scores: list[Score]) -> list[str]:
    """One line of the table."""
    rmse: NDArray[np.float64] = np.array([s.rmse_m_s for s in scores])
    total, worst = float(np.sqrt((rmse**2).mean())), max(s.max_m_s for s in scores)
    covered, drifted = float(np.mean([s.in_3_sigma for s in scores])), float(np.mean([s.drift for s in scores]))
    short = [] if total <= ASKED_M_S[section] else ["RMSE"]
    if section == "corner" and worst > ASKED_CORNER_MAX_M_S:
        short.append("max")
    if covered < ASKED_COVERAGE:
        short.append("3 sigma")
    if uwb == "off" and drifted > ASKED_DRIFT:
        short.append("drift")
    verdict = f"SHORT: {', '.join(short)}" if short else "ok"
    return [
        section, uwb, str(len(scores)), number(total, 4), number(float(rmse.max()), 4), f"<= {ASKED_M_S[section]}",
        number(worst), f"{100 * covered:.1f} %", f"{100 * drifted:.2f}", verdict,
    ]  # fmt: skip


def main(seeds: int, seconds: float, sections: tuple[str, ...] = tuple(ASKED_M_S)) -> str:
    """Fly everything; the table in Markdown."""
    rows = []
    for section in sections:
        flights = [list(fly(section, seed, seconds)) for seed in range(seeds)]
        for which, uwb in enumerate(("on", "off")):
            rows.append(row(section, uwb, [scores[which] for scores in flights]))
    size = f"{CAMERA.width_px}x{CAMERA.height_px} px at {CAMERA.rate_hz:g} Hz"
    return f"{machine()}; {seeds} flights of {seconds:g} s per section, frames of {size}\n\n{table(HEAD, rows)}"


if __name__ == "__main__":
    print(
        main(
            int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS,
            float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS,
            tuple(sys.argv[3:]) or tuple(ASKED_M_S),
        )
    )
