"""UWB that goes wrong in six ways, supervised and not: ``python -m tests.bench.bench_faults``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.batch import run_batch
from axialnav.fusion.outcome import Health
from tests.bench.markdown import machine, table
from tests.fusion.made_corridor import FAULTS, WINDOWS_S, Corridor, fly
from tests.fusion.made_flights import MadeFlight

SEEDS = 40
ASKED_M_S, ASKED_CLEAN_M_S, ASKED_LOST, ASKED_SUSPECT = 0.09, 0.06, 0.01, 0.01
LOST_M, LAST_S = 0.6, 20.0
ON: dict[str, str] = {}
OFF = {"supervisor.enabled": "false"}
HEAD = (
    "UWB as", "fault", "asked [m/s]", "velocity on", "worst flight", "off", "position on [m]", "off", "lost on", "off",
    "suspect", "resets", "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Score:
    """One flight: squared errors in the event window, and shares of time."""

    velocity_m_s: float
    position_m: float
    lost: float
    suspect: float
    resets: int


def score(corridor: Corridor, flight: MadeFlight, params: dict[str, str]) -> Score:
    """Run the filter and compare its axial estimate with the truth."""
    track = run_batch(flight.config.with_params(params), flight.tables).track
    t = flight.t_s
    start, end = WINDOWS_S[corridor.fault]
    window, last = (t >= start) & (t < end), t > corridor.duration_s - LAST_S
    velocity = (track.velocity_m_s - flight.truth.velocity_m_s)[:, 0]
    position = (track.position_m - flight.truth.position_m)[:, 0]
    return Score(
        rms(velocity[window]),
        rms(position[window]),
        float((np.abs(position[last]) > LOST_M).mean()),
        float(((track.flags & Health.UWB_SUSPECT) > 0).mean()),
        int(track.resets[-1]),
    )


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def rows(kinds: tuple[str, ...] = ("fix", "range", "tdoa"), seeds: int = SEEDS) -> Iterator[list[str]]:
    """One line per kind of UWB and fault."""
    for uwb in kinds:
        for fault in FAULTS:
            corridors = [Corridor(seed=seed, uwb=uwb, fault=fault) for seed in range(seeds)]
            pairs = []
            for corridor in corridors:
                flight = fly(corridor)
                pairs.append([score(corridor, flight, params) for params in (ON, OFF)])
            yield _line(uwb, fault, [p[0] for p in pairs], [p[1] for p in pairs])


def _line(uwb: str, fault: str, on: list[Score], off: list[Score]) -> list[str]:
    asked = ASKED_CLEAN_M_S if fault == "clean" else ASKED_M_S
    velocity, unsupervised = (rms(np.array([s.velocity_m_s for s in scores])) for scores in (on, off))
    position, drawn = (rms(np.array([s.position_m for s in scores])) for scores in (on, off))
    lost, lost_off = (float(np.mean([s.lost for s in scores])) for scores in (on, off))
    suspect = float(np.mean([s.suspect for s in on]))
    fine = velocity <= asked and lost <= ASKED_LOST and (fault != "clean" or suspect <= ASKED_SUSPECT)
    return [
        uwb, fault, f"<= {asked}", f"{velocity:.3f}", f"{max(s.velocity_m_s for s in on):.3f}", f"{unsupervised:.3f}",
        f"{position:.2f}", f"{drawn:.2f}", f"{lost:.3f}", f"{lost_off:.3f}", f"{suspect:.3f}",
        f"{np.mean([s.resets for s in on]):.2f}", "ok" if fine else "SHORT",
    ]  # fmt: skip


def main() -> None:
    """Print the table; names of UWB kinds and a number of seeds may be given."""
    kinds = tuple(word for word in sys.argv[1:] if not word.isdigit()) or ("fix", "range", "tdoa")
    seeds = next((int(word) for word in sys.argv[1:] if word.isdigit()), SEEDS)
    sys.stdout.write(f"{machine()}; {seeds} flights each\n\n{table(HEAD, rows(kinds, seeds))}\n")


if __name__ == "__main__":
    main()
