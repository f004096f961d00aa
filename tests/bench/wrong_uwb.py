"""Wrong UWB on real flights: which readings behind metal are refused, and a reflection added to two of five anchors."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from axialnav.fusion.outcome import Verdict
from axialnav.models.rig import Uwb
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.run import Run, replay
from tests.bench.changed import reflected
from tests.bench.flights import DEFAULT, METAL, NO_SUPERVISOR
from tests.bench.markdown import table

WALK = "isas_walk1"
START_S, LASTS_S, LONGER_M = 20.0, 12.0, (1.5, 1.0)
ASKED_M = 0.30
WRONG_M, RIGHT_M, ASKED_REFUSED, ASKED_ACCEPTED = 1.0, 0.3, 0.80, 0.90
REFUSAL_HEAD = ("flight", "readings", "error", "share", "asked", "measured", "verdict")
REFLECTION_HEAD = ("flight", "supervisor", "clean 3-D [m]", "asked [m]", "mean", "median", "worst", "within", "verdict")


def errors_of_differences(flight: Flight, sensor: str) -> NDArray[np.float64]:
    """Reading minus what the truth says of every range difference [m]; NaN outside the truth."""
    spec, told, truth = flight.config.sensor[sensor], flight.tables[sensor], flight.truth
    assert isinstance(spec, Uwb)
    assert truth is not None
    inside = (told.t_ns > truth.t_ns[0]) & (told.t_ns < truth.t_ns[-1])
    position = np.stack([np.interp(told.t_ns, truth.t_ns, truth.position_m[:, i]) for i in range(3)], axis=1)
    nearest = np.clip(np.searchsorted(truth.t_ns, told.t_ns), 0, len(truth.t_ns) - 1)
    attitude = Rotation.from_quat(truth.quaternion_WB[nearest], scalar_first=True)
    antenna, places = position + attitude.apply(np.array(spec.lever_arm_m)), np.array(list(spec.anchors.values()))
    far, near = (np.linalg.norm(antenna - places[told.columns[c]], axis=1) for c in ("anchor_b", "anchor_a"))
    return np.where(inside, told.columns["difference_m"] - (far - near), np.nan)


def accepted(run: Run, sensor: str) -> NDArray[np.bool_]:
    """Whether each reading of a sensor was fused, in the order of its table."""
    mine = run.log.source == run.log.sensors.index(sensor)
    fused: NDArray[np.bool_] = run.log.verdict[mine] == Verdict.FUSED
    return fused


def refusals(flight: Flight) -> Iterator[list[str]]:
    """How many wrong readings are refused and how many right ones accepted, after the first three seconds."""
    run = replay(flight)
    size, fused = np.abs(errors_of_differences(flight, "uwb0")), accepted(run, "uwb0")
    settled = (flight.tables["uwb0"].t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9 > 3.0
    for name, chosen, right, asked in (
        (f"> {WRONG_M} m refused", size > WRONG_M, ~fused, ASKED_REFUSED),
        (f"< {RIGHT_M} m accepted", size < RIGHT_M, fused, ASKED_ACCEPTED),
    ):
        chosen &= settled
        share = float(right[chosen].mean())
        of_all = f"{100 * chosen.sum() / settled.sum():.0f} %"
        verdict = "ok" if share > asked else "SHORT"
        yield [flight.name, str(chosen.sum()), name, of_all, f"> {asked:.0%}", f"{100 * share:.1f} %", verdict]


def reflections(flight: Flight) -> Iterator[list[str]]:
    """Every ordered pair of anchors behind a reflection once; position error in space of the whole flight."""
    pairs = list(itertools.permutations(range(5), 2))
    for name, params in (("on", DEFAULT), ("off", NO_SUPERVISOR)):
        clean = replay(flight, params=params).metrics["position_rmse_3d_m"]
        errors = np.array([one_reflection(flight, pair, params) for pair in pairs])
        within = f"{(errors <= ASKED_M).sum()}/{len(pairs)}"
        verdict = "ok" if errors.max() <= ASKED_M else "mean ok" if errors.mean() <= ASKED_M else "SHORT"
        figures = (f"{value:.3f}" for value in (errors.mean(), np.median(errors), errors.max()))
        yield [flight.name, name, f"{clean:.3f}", f"<= {ASKED_M}", *figures, within, verdict]


def one_reflection(flight: Flight, pair: tuple[int, int], params: dict[str, str]) -> float:
    """Position error in space [m] with 12 s of 1.5 m and 1.0 m added to two anchors."""
    longer = dict(zip(pair, LONGER_M, strict=True))
    changed = reflected(flight, "uwb0", longer, START_S, START_S + LASTS_S)
    return float(replay(changed, params=params).metrics["position_rmse_3d_m"])


def wrong_uwb_tables(folder: Path) -> str:
    """Both tables, or the names of the flights that are not there."""
    lines: list[str] = []
    for name, head, rows, title in (
        (METAL, REFUSAL_HEAD, refusals, "Readings behind metal, by their error against the motion capture:"),
        (WALK, REFLECTION_HEAD, reflections, "A reflection of 12 s on two of five anchors, +1.5 m and +1.0 m:"),
    ):
        there = (folder / name / "mav0").is_dir()
        lines += [title, "", table(head, rows(load_flight(folder / name))) if there else f"skipped: {name}", ""]
    return "\n".join(lines)
