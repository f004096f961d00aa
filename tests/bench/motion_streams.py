"""What it costs that windows of a stream are cut once: a stream beside one whose windows are all cut anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import MotionEstimate, MotionEstimator
from axialnav.replay.simulate.render import Scene
from tests.bench.markdown import number, table
from tests.bench.motion_scenes import CLEAN, EXPOSURE_S, PERIOD_S, Condition, draw, signed_log_uniform

Array = NDArray[np.float64]
LONG, WINDOW = 14, 5
RANGES_PX = ((0.5, 5.0), (5.0, 45.0))
HEAD = ("five frames", "motion [px]", "accepted", "RMS [px]", "z", "RMS, cut anew", "z, cut anew", "RMS over it")


def streams(count: int) -> str:
    """Errors of ``count`` streams a row, without the first window, which both cut alike."""
    rows = []
    for condition in CLEAN:
        for low, high in RANGES_PX:
            once, anew = np.empty((2, 0)), np.empty((2, 0))
            for trial in range(count):
                picture = draw(_between(condition, low, high), trial, frames=LONG)
                errors = (_errors(picture.frames, picture.displacement_px, fresh) for fresh in (False, True))
                once, anew = (np.hstack(pair) for pair in zip((once, anew), errors, strict=True))
            (rms, z), (rms_anew, z_anew) = (_score(*errors) for errors in (once, anew))
            name, share = condition.name, f"{once.shape[1]}/{count * (LONG - WINDOW)}"
            figures = (number(rms, 5), number(z, 2), number(rms_anew, 5), number(z_anew, 2), number(rms / rms_anew, 3))
            rows.append((name, f"{low:g} to {high:g}", share, *figures))
    return table(HEAD, rows)


def _between(condition: Condition, low: float, high: float) -> Condition:
    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        return replace(scene, trajectory=replace(scene.trajectory, displacement_px=signed_log_uniform(rng, low, high)))

    return replace(condition, change=change)


def _errors(frames: NDArray[np.uint8], truth_px: float, fresh: bool) -> Array:
    """Errors and sigmas [px] of the accepted windows but the first, shape (2, k)."""
    found = [
        (answer.displacement_px - truth_px, answer.sigma_px)
        for answer in list(_answers(frames, fresh))[1:]
        if answer.accepted
    ]
    return np.array(found, dtype=np.float64).reshape(-1, 2).T


def _answers(frames: NDArray[np.uint8], fresh: bool) -> Iterator[MotionEstimate]:
    """Estimates of a stream, or of a new estimator for every window."""
    estimator = MotionEstimator(frames=WINDOW)
    for k in range(len(frames)):
        if fresh and k >= WINDOW:
            estimator = MotionEstimator(frames=WINDOW)
        for j in range(k - WINDOW + 1 if fresh and k >= WINDOW else k, k + 1):
            answer = estimator.push(round(j * PERIOD_S * 1e9), frames[j], EXPOSURE_S)
        if answer is not None:
            yield answer


def _score(error: Array, sigma: Array) -> tuple[float, float]:
    """RMS of the errors [px], and of the errors over sigma."""
    return float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean((error / sigma) ** 2)))
