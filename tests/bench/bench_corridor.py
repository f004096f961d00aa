"""The whole chain from frames on simulated corridors.

``python -m tests.bench.bench_corridor [SEEDS] [SECONDS] [SECTION ...] [workers=N]``

Each seed flies one section after another past walls from strong to nearly blank; every number is over all seeds.  The
score of every flight is kept in ``runs/bench-corridor``, so that a bench that was interrupted goes on where it was;
scores of another version of the source are not taken.  ``workers`` flights are flown at a time.
"""

from __future__ import annotations

import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

import axialnav
from axialnav.models.jit import source_stamp
from axialnav.replay.experiments.field import paper_speed
from axialnav.replay.flight import Truth, load_flight
from axialnav.replay.frames import with_pixel_motion
from axialnav.replay.run import Run, replay
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.mission import CameraPlan, Mission, WallLook
from axialnav.replay.simulate.mission_checks import check_mission
from axialnav.replay.simulate.scenarios import BUILT_IN
from tests.bench.markdown import machine, number, table

KEPT = Path("runs/bench-corridor")
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
ESTIMATES = ("fused, with UWB", "fused, without UWB", "stripes, no gate")
HEAD = (
    "section", "estimate", "flights", "axial RMSE [m/s]", "worst flight", "asked", "max [m/s]", "in 3 sigma",
    "drift [%]", "answers", "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Score:
    """One estimate of one flight: the named section of it (stripes: all of it), and the drift of its distance."""

    rmse_m_s: float
    max_m_s: float
    in_3_sigma: float
    drift: float
    answers: float = 1.0


def mission_of(section: str, seed: int, seconds: float) -> Mission:
    """A built-in corridor with the wall of the seed."""
    base = BUILT_IN[section][0](seconds)
    wall = WALLS[seed % len(WALLS)]
    plans = tuple(msgspec.structs.replace(plan, left=wall) for plan in base.section)
    mission = msgspec.structs.replace(base, duration_s=seconds, camera=CAMERA, section=plans)
    check_mission(mission)
    return mission


def fly(section: str, seed: int, seconds: float) -> list[Score]:
    """Scores of one flight, in the order of ``ESTIMATES``."""
    with tempfile.TemporaryDirectory() as folder:
        simulate(mission_of(section, seed, seconds), Path(folder) / "flight", seed=seed)
        flight = load_flight(Path(folder) / "flight")
        assert flight.truth is not None
        seen = replace(flight, tables=with_pixel_motion(flight, flight.config, flight.tables))  # once for both replays
        fused = [score(replay(seen, without=without), section, flight.truth) for without in ((), ("uwb0",))]
        _, error, windows = paper_speed(flight)
    rmse = float(np.sqrt((error**2).mean())) if error.size else np.nan
    worst = float(np.abs(error).max()) if error.size else np.nan
    return [*fused, Score(rmse, worst, np.nan, np.nan, error.size / windows)]


def flown(section: str, seed: int, seconds: float) -> list[Score]:
    """As :func:`fly`, from a kept score where there is one of the same source."""
    stamp = "-".join(str(number) for number in source_stamp(Path(axialnav.__file__).parent))
    path = KEPT / stamp / f"{section}-{seconds:g}-{seed}.json"
    if path.is_file():
        return [Score(**values) for values in json.loads(path.read_text(encoding="utf-8"))]
    scores = fly(section, seed, seconds)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([asdict(one) for one in scores]), encoding="utf-8")
    return scores


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


def row(section: str, estimate: str, scores: list[Score]) -> list[str]:
    """One line of the table."""
    rmse: NDArray[np.float64] = np.array([s.rmse_m_s for s in scores])
    total, worst = float(np.sqrt(np.nanmean(rmse**2))), float(np.nanmax([s.max_m_s for s in scores]))
    covered, drifted = float(np.mean([s.in_3_sigma for s in scores])), float(np.mean([s.drift for s in scores]))
    short = [] if total <= ASKED_M_S[section] else ["RMSE"]
    if section == "corner" and worst > ASKED_CORNER_MAX_M_S:
        short.append("max")
    if covered < ASKED_COVERAGE:
        short.append("3 sigma")
    if estimate == ESTIMATES[1] and drifted > ASKED_DRIFT:
        short.append("drift")
    ours = estimate != ESTIMATES[2]
    return [
        section, estimate, str(len(scores)), number(total, 4), number(float(np.nanmax(rmse)), 4),
        f"<= {ASKED_M_S[section]}", number(worst), f"{100 * covered:.1f} %" if ours else "-",
        f"{100 * drifted:.2f}" if ours else "-", f"{100 * np.mean([s.answers for s in scores]):.0f} %",
        "-" if not ours else f"SHORT: {', '.join(short)}" if short else "ok",
    ]  # fmt: skip


def fly_ahead(seeds: int, seconds: float, sections: tuple[str, ...], workers: int) -> None:
    """Have the scores of all flights kept, ``workers`` flights at a time."""
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        waiting = [pool.submit(flown, section, seed, seconds) for section in sections for seed in range(seeds)]
        for one in waiting:
            one.result()


def main(seeds: int, seconds: float, sections: tuple[str, ...] = tuple(ASKED_M_S), workers: int = 1) -> str:
    """Fly everything; the table in Markdown."""
    if workers > 1:
        fly_ahead(seeds, seconds, sections, workers)
    rows = []
    for section in sections:
        flights = [flown(section, seed, seconds) for seed in range(seeds)]
        rows += [row(section, name, [f[k] for f in flights]) for k, name in enumerate(ESTIMATES)]
    size = f"{CAMERA.width_px}x{CAMERA.height_px} px at {CAMERA.rate_hz:g} Hz"
    return f"{machine()}; {seeds} flights of {seconds:g} s per section, frames of {size}\n\n{table(HEAD, rows)}"


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if not word.startswith("workers=")]
    print(
        main(
            int(words[0]) if words else SEEDS,
            float(words[1]) if len(words) > 1 else SECONDS,
            tuple(words[2:]) or tuple(ASKED_M_S),
            next((int(word.removeprefix("workers=")) for word in sys.argv[1:] if word.startswith("workers=")), 1),
        )
    )
