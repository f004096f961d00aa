"""Image motion on real frames: a camera on a linear slider, past a flat picture at a constant speed."""

from __future__ import annotations

from pathlib import Path

from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.motion import run_motion
from axialnav.replay.motion_table import score
from tests.bench.markdown import number, table

SLIDER = "davis_slider_far"
DISTANCE_M = 0.603
ASKED_SHARE = 0.01
HONEST_Z = (0.5, 2.0)  # error over sigma, root mean square: 1 for an honest sigma
HEAD = (
    "flight", "windows", "speed asked", "speed by slider [m/s]", "measured [m/s]", "error", "RMSE [m/s]",
    "sigma [m/s]", "error / sigma", "verdict",
)  # fmt: skip


def slider_table(folder: Path) -> str:
    """Table of the slider run, or the line that says it is not there."""
    if not (folder / SLIDER / "mav0").is_dir():
        return f"skipped: {SLIDER} is not in {folder}"
    return "Image motion on real frames:\n\n" + table(HEAD, [slider_row(load_flight(folder / SLIDER))])


def slider_row(flight: Flight) -> list[str]:
    """Speed of the camera along the slider from its frames, against the slider's own record."""
    run = run_motion(flight, distance_m=DISTANCE_M)
    result = score(run, "m/s")
    if result is None:
        return [flight.name, f"0/{len(run.estimates)}", *["-"] * 7, "SHORT: no window accepted"]
    share = result.mean_error / result.mean_truth
    honest = HONEST_Z[0] <= result.z <= HONEST_Z[1]
    missed = [*(["speed"] if abs(share) > ASKED_SHARE else []), *([] if honest else ["sigma"])]
    return [
        flight.name,
        f"{result.used}/{len(run.estimates)}",
        f"within {100 * ASKED_SHARE:.0f} %",
        number(result.mean_truth, 4),
        number(result.mean_truth + result.mean_error, 4),
        f"{100 * share:+.2f} %",
        number(result.rmse, 4),
        number(result.sigma, 4),
        number(result.z, 1),
        f"SHORT: {', '.join(missed)}" if missed else "ok",
    ]
