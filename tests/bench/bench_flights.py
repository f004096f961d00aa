"""Accuracy on real flights: ``python -m tests.bench.bench_flights`` (``make bench``).

Every flight is replayed with the one default configuration, then with single features switched off and with all of
them off (a plain filter with a 4 sigma gate), so that the tables show what each buys.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.reference import match
from axialnav.replay.run import Run, replay
from tests.bench.flights import CASES, CHANGES, FLIGHTS, VARIANTS, Case
from tests.bench.handheld import floor_table
from tests.bench.markdown import machine, number, table
from tests.bench.slider import slider_table
from tests.bench.wrong_uwb import wrong_uwb_tables

HEAD = (
    "flight", "axial velocity asked", "measured [m/s]", "position asked [m]", "x y z [m]", "3-D [m]", "farthest [m]",
    "in 3 sigma", "sigma / RMSE", "NEES (95 % band)", "accelerometer fault", "resets", "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Result:
    """Scores of one replay; None where the flight has no such reference."""

    case: Case
    metrics: Mapping[str, Any]
    farthest_m: float | None

    @property
    def axial_m_s(self) -> float | None:
        """RMSE of the axial velocity."""
        value: float | None = self.metrics["axial_velocity_m_s"]["rmse"]
        return value

    @property
    def worst_axis_m(self) -> float | None:
        """RMSE of position on its worst axis."""
        axes = self.metrics["position_rmse_m"]
        return max(axes) if axes else None

    def short(self) -> list[str]:
        """What is asked and not reached."""
        case, metrics = self.case, self.metrics
        band = metrics["nees_velocity_band"]
        checks = {
            "axial velocity": _misses(self.axial_m_s, case.axial_m_s),
            "position": _misses(self.worst_axis_m, case.axis_m),
            "3-D position": _misses(metrics["position_rmse_3d_m"], case.position_m),
            "speed": _misses(metrics["horizontal_speed_rmse_m_s"], case.speed_m_s),
            "lost": _misses(self.farthest_m, case.farthest_m),
            "NEES": case.consistent and not (band and band[0] <= metrics["nees_velocity"] <= band[1]),
        }
        return [name for name, missed in checks.items() if missed]


def _misses(value: float | None, limit: float | None) -> bool:
    return limit is not None and not (value is not None and value <= limit)


def measure(flight: Flight, case: Case, params: Mapping[str, str]) -> Result:
    """Replay one case with some settings changed."""
    run = replay(flight, without=case.without, params=params)
    return Result(case, run.metrics, _farthest(run))


def _farthest(run: Run) -> float | None:
    truth = run.flight.truth
    if truth is None:
        return None
    matched = match(run.track, truth, run.flight.evaluation, align=run.config.initial is None)
    off = np.linalg.norm(matched.position_m - matched.truth_position_m, axis=1)
    return float(off.max()) if off.size else None


def result_row(result: Result) -> list[str]:
    """One row of the main table."""
    case, metrics = result.case, result.metrics
    speed = metrics["horizontal_speed_rmse_m_s"]
    axes, missed = metrics["position_rmse_m"], result.short()
    asked = f"<= {case.axial_m_s}" if case.axial_m_s else f"<= {case.speed_m_s} (speed)" if case.speed_m_s else "-"
    where = f"<= {case.axis_m} per axis" if case.axis_m else f"<= {case.position_m} 3-D" if case.position_m else "-"
    return [
        case.label,
        asked,
        number(result.axial_m_s) if speed is None else f"{number(speed)} (speed)",
        where,
        " ".join(number(a) for a in axes) if axes else "-",
        number(metrics["position_rmse_3d_m"]),
        number(result.farthest_m),
        *_coverage(metrics["axial_velocity_m_s"]),
        _nees(metrics),
        f"{100 * metrics['health'].get('accelerometer_fault', 0.0):.0f} %",
        str(metrics["resets"]),
        f"SHORT: {', '.join(missed)}" if missed else "ok",
    ]


def _coverage(axial: Mapping[str, Any]) -> tuple[str, str]:
    """Share of the axial velocity inside three sigma, and the mean sigma beside the error."""
    if axial["rmse"] is None:
        return "-", "-"
    return f"{100 * axial['in_3_sigma']:.1f} %", f"{axial['mean_sigma'] / axial['rmse']:.2f}"


def _nees(metrics: Mapping[str, Any]) -> str:
    band = metrics["nees_velocity_band"]
    return f"{metrics['nees_velocity']:.1f} ({band[0]:.1f}..{band[1]:.1f})" if band else "-"


def variant_rows(results: Sequence[Mapping[str, Result]], names: Sequence[str]) -> Iterator[list[str]]:
    """Velocity error and, behind a slash, position error of each flight under each variant."""
    for by_name in results:
        yield [next(iter(by_name.values())).case.label, *(_both(by_name[name]) for name in names)]


def _both(result: Result) -> str:
    speed = result.metrics["horizontal_speed_rmse_m_s"]
    if speed is not None:
        return number(speed)
    return f"{number(result.axial_m_s)} / {number(result.metrics['position_rmse_3d_m'])}"


def tables(cases: Sequence[Case], folder: Path, variants: Mapping[str, Mapping[str, str]] = VARIANTS) -> str:
    """All tables of the flights that are there; the others are named."""
    results: list[dict[str, Result]] = []
    absent: list[str] = []
    loaded: dict[str, Flight] = {}
    for case in cases:
        if not (folder / case.flight / "mav0").is_dir():
            absent.append(case.flight)
            continue
        loaded[case.flight] = loaded.get(case.flight) or load_flight(folder / case.flight)
        flight = loaded[case.flight]
        by_name = {name: measure(flight, case, params) for name, params in variants.items()}
        results.append(by_name | {name: measure(change(flight), case, {}) for name, change in CHANGES.items()})
    lines = [f"skipped: {name} is not in {folder}" for name in dict.fromkeys(absent)]
    if results:
        first = next(iter(variants))
        lines += ["One configuration for all flights:", "", table(HEAD, (result_row(r[first]) for r in results)), ""]
        lines += ["What each feature buys, as axial velocity RMSE [m/s] / 3-D position RMSE [m] (speed RMSE for GPS):"]
        lines += ["", table(("flight", *results[0]), variant_rows(results, tuple(results[0])))]
    return "\n".join(lines)


def main() -> None:
    """Print all tables."""
    parts = (
        machine(),
        tables(CASES, FLIGHTS),
        wrong_uwb_tables(FLIGHTS),
        slider_table(FLIGHTS),
        floor_table(FLIGHTS.parent),
    )
    sys.stdout.write("\n\n".join(parts) + "\n")


if __name__ == "__main__":
    main()
