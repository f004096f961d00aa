"""The printed summary of ``axialnav motion``."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.motion import MotionRun

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionScore:
    """Errors of the accepted windows that have a truth, one unit.

    Parameters
    ----------
    unit
        ``px`` per frame period, or ``m/s``.
    rmse, mean_error, sigma, mean_truth
        Root mean square and mean of the errors, root mean square of the estimates' sigma, mean of the truth.
    z
        Root mean square of error over sigma [-].
    used
        Number of windows.
    """

    unit: str
    rmse: float
    mean_error: float
    sigma: float
    mean_truth: float
    z: float
    used: int


def score(run: MotionRun, unit: str) -> MotionScore | None:
    """Score in ``px`` or ``m/s``; None where there is no truth or nothing was accepted."""
    if run.truth is None:
        return None
    signed = np.array([e.signed for e in run.estimates], dtype=np.bool_)
    to_unit = np.ones_like(run.period_s) if unit == "px" else -run.truth.metres_per_px / run.period_s
    rotation = run.truth.rotation_px if unit != "px" else 0.0
    value = (run.values("displacement_px") - rotation) * to_unit
    truth = run.truth.displacement_px if unit == "px" else run.truth.speed_m_s
    value, truth = np.where(signed, value, np.abs(value)), np.where(signed, truth, np.abs(truth))
    sigma = run.values("sigma_px") * np.abs(to_unit)
    use = run.accepted() & np.isfinite(value) & np.isfinite(truth)
    if not use.any():
        return None
    error = (value - truth)[use]
    return MotionScore(
        unit,
        _rms(error),
        float(error.mean()),
        _rms(sigma[use]),
        float(truth[use].mean()),
        _rms(error / sigma[use]),
        int(use.sum()),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def motion_summary(run: MotionRun) -> str:
    """Coverage, the estimates themselves, their score, and why windows were refused; one line a topic."""
    accepted = run.accepted()
    windows = len(run.estimates)
    lens = "lens undistorted" if run.undistorted else "pixels as recorded"
    lines = [
        f"motion     {run.flight} {run.camera}   method {run.method}   {run.frames} frames per window   "
        f"{run.available} frames   {lens}",
        f"accepted   {int(accepted.sum())} of {windows} windows"
        + (f" ({100 * accepted.mean():.0f} %)" if windows else ""),
    ]
    if accepted.any():
        value, sigma = run.values("displacement_px")[accepted], run.values("sigma_px")[accepted]
        lines.append(
            f"measured   mean {value.mean():+.4f} px per frame   spread {value.std():.4f}   sigma {_rms(sigma):.4f}   "
            f"min {value.min():+.3f}   max {value.max():+.3f}"
        )
    lines += _scores(run, windows)
    refused = Counter(e.reason for e in run.estimates if not e.accepted)
    lines += [f"refused    {count} x {reason}" for reason, count in refused.most_common()]
    notes = Counter(e.note for e in run.estimates if e.note)
    lines += [f"note       {note}" for note in notes]
    return "\n".join(lines)


def _scores(run: MotionRun, windows: int) -> list[str]:
    if run.truth is None:
        why = "no ground truth, or the distance of the wall is unknown: give it with --distance-m"
        return [f"score      NOT_EVALUATED ({why})   used 0/{windows}"]
    lines = []
    for unit in ("px", "m/s"):
        result = score(run, unit)
        if result is None:
            return [f"score      NOT_EVALUATED (no accepted window with a truth)   used 0/{windows}"]
        share = 100.0 * result.mean_error / result.mean_truth if result.mean_truth else float("nan")
        lines.append(
            f"score      [{unit}] RMSE {result.rmse:.4f}   mean error {result.mean_error:+.4f} ({share:+.2f} %)   "
            f"truth {result.mean_truth:+.4f}   sigma {result.sigma:.4f}   z {result.z:.2f}   "
            f"used {result.used}/{windows} ({100 * result.used / windows:.0f} %)"
        )
    return lines
