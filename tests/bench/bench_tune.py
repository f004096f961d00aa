"""What tuning finds, and what it is worth: ``python -m tests.bench.bench_tune``.

Known noise of simulated flights from starts four times off, found by ``axialnav tune`` and by two rivals; then settings
tuned on two real flights, judged on the others.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.tuning.parameters import apply, read
from axialnav.replay.tuning.tune import Score, tune
from axialnav.replay.tuning.tune_table import error_words
from tests.bench.flights import BOLT, FLIGHTS, METAL, OBSTACLES, SICK, SICK_FAST
from tests.bench.markdown import machine, number, table
from tests.bench.tune_rivals import TRIALS, nis_matching, sampled_likelihood
from tests.replay.made_recordings import flown

NAMES = ("imu.accel_noise_scale", "imu.accel_walk_scale", "sensor.uwb0.sigma_m", "sensor.flow0.sigma_px")
START = (4.0, 0.25, 4.0, 0.25)
LIMITS = (0.10, 0.35, 0.10, 0.10)
TIME_S = 10.0
SEEDS = (3, 5, 8)
DURATION_S = 120.0
REFLECTED = 0.08
OURS = "likelihood, scoring (axialnav tune)"
FOUND_HEAD = (
    "reflections", "method", "replays", "time [s]", "accelerometer", "its walk", "UWB", "image motion", "verdict",
)  # fmt: skip
TUNED_HEAD = ("setting", "before", "after", "standard error")
SCORE_HEAD = (
    "flight", "role", "log-likelihood", "a reading", "axial RMSE [m/s]", "3-D RMSE [m]", "NEES", "verdict",
)  # fmt: skip
TUNED_ON = (OBSTACLES, "util_nlos_tdoa2_circle_wood")
HELD_OUT = (BOLT, "util_base_tdoa2_circle_noobs", METAL, SICK, SICK_FAST)
SHARED = ("uwb.sigma_m", "uwb.bias_sigma_m", "flow.sigma_rad", "range.sigma_m", "imu.accel_noise_scale")
SAME = 1.05  # an RMSE that grows by less is called the same


@dataclass(frozen=True)
class Found:
    """Estimated over true value of each setting, replays and seconds that it took."""

    ratios: tuple[float, ...]
    replays: int
    seconds: float


def recover(flight: Flight, trials: int = TRIALS) -> dict[str, Found]:
    """The noise of one simulated flight, by every method, all from the same start."""
    true = {name: read(flight.config, name) for name in NAMES}
    start = apply(flight.config, {name: true[name] * off for name, off in zip(NAMES, START, strict=True)})
    tuning = tune([flight], start, free=NAMES, workers=2)
    found = {t.parameter.name: t.value for t in tuning.tuned}
    results = {OURS: (found, tuning.evaluations, tuning.search_s)}
    results["likelihood, TPE"] = sampled_likelihood(flight, start, NAMES, trials)
    results["mean NIS, TPE"] = nis_matching(flight, start, NAMES, trials)
    return {
        method: Found(tuple(values[name] / true[name] for name in NAMES), replays, seconds)
        for method, (values, replays, seconds) in results.items()
    }


def found_rows(
    seeds: Sequence[int] = SEEDS, duration_s: float = DURATION_S, trials: int = TRIALS
) -> Iterator[list[str]]:
    """Range over the seeds of what was found, in units of the truth."""
    for share in (0.0, REFLECTED):
        flights = [recover(flown(seed, duration_s, outlier_share=share), trials) for seed in seeds]
        for method in flights[0]:
            runs = [found[method] for found in flights]
            ratios = np.array([run.ratios for run in runs])
            spans = [f"{low:.2f}..{high:.2f}" for low, high in zip(ratios.min(axis=0), ratios.max(axis=0), strict=True)]
            slowest = max(run.seconds for run in runs)
            off = np.abs(ratios - 1.0).max(axis=0)
            missed = [name for name, x, limit in zip(FOUND_HEAD[4:], off, LIMITS, strict=False) if x > limit]
            missed += ["time"] * (slowest > TIME_S)
            replays = max(run.replays for run in runs)
            yield [f"{share:.0%}", method, str(replays), f"{slowest:.1f}", *spans, _verdict(missed)]


def score_rows(scores: Sequence[Score]) -> Iterator[list[str]]:
    """What the tuned settings do to every flight, and on average to those that they were not tuned on."""
    for score in scores:
        worse = [n for n, (old, new) in zip(("velocity", "position"), _rmse(score), strict=True) if new > SAME * old]
        worse += ["likelihood"] * (score.gain_nats < 0.0)
        role = "held out" if score.held_out else "tuned on"
        per = score.gain_nats / max(score.readings, 1.0)
        nees = [number(m["nees_velocity"], 1) for m in (score.before, score.after)]
        pairs = [f"{number(old)} -> {number(new)}" for old, new in _rmse(score)]
        yield [score.flight, role, f"{score.gain_nats:+.0f}", f"{per:+.3f}", *pairs, " -> ".join(nees), _verdict(worse)]
    held = [_rmse(score) for score in scores if score.held_out]
    means = [[statistics.fmean(pairs[k][i] for pairs in held) for i in (0, 1)] for k in (0, 1)]
    cells = [f"{number(old)} -> {number(new)}" for old, new in means]
    yield ["mean of those held out", "", "", "", *cells, "", ""]


def _rmse(score: Score) -> list[tuple[float, float]]:
    """Axial velocity and position, before and after."""
    axial = [m["axial_velocity_m_s"]["rmse"] for m in (score.before, score.after)]
    place = [m["position_rmse_3d_m"] for m in (score.before, score.after)]
    return [(axial[0], axial[1]), (place[0], place[1])]


def _verdict(missed: Sequence[str]) -> str:
    return f"SHORT: {', '.join(missed)}" if missed else "ok"


def flown_tables(folder: Path = FLIGHTS) -> str:
    """Both tables of the real flights."""
    missing = [name for name in (*TUNED_ON, *HELD_OUT) if not (folder / name / "mav0").is_dir()]
    if missing:
        return f"skipped: {', '.join(missing)} not in {folder}"
    tuned_on, held = ([load_flight(folder / name) for name in names] for names in (TUNED_ON, HELD_OUT))
    tuning = tune(tuned_on, free=SHARED, hold_out=held, workers=2)
    settings = [
        [f"`{t.parameter.name}`", f"{t.parameter.start:.4g}", f"{t.value:.4g}", error_words(t)] for t in tuning.tuned
    ]
    effort = f"{tuning.evaluations} replays, {tuning.search_s:.0f} s"
    return f"{table(TUNED_HEAD, settings)}\n\n{effort}\n\n{table(SCORE_HEAD, score_rows(tuning.scores))}"


def main() -> None:
    """Print the tables."""
    what = f"{DURATION_S:g} s at 200 Hz, seeds {', '.join(map(str, SEEDS))}, starts 4 times off"
    sys.stdout.write(f"{machine()}; {what}\n\n{table(FOUND_HEAD, found_rows())}\n\n{flown_tables()}\n")


if __name__ == "__main__":
    main()
