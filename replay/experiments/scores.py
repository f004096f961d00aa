"""Errors of many trials in one line: how often a method fails, and how good it is when it does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FAILURE_SHARE = 0.2  # of the true displacement: an error beyond it is a failure, as is no answer


@dataclass(frozen=True)
class Score:
    """Errors of one method under one condition.

    Parameters
    ----------
    trials
        How many windows were measured.
    failed
        Share without an answer or with an error above 20 % of the truth [-].
    median_px
        Median absolute error of all answers [px per frame]; NaN without answers.
    rms_px
        Root mean square error of the trials that did not fail [px per frame]; NaN if all failed.
    """

    trials: int
    failed: float
    median_px: float
    rms_px: float


def score(answers: Sequence[tuple[float, ...]], truths: Sequence[float]) -> Score:
    """Score answers [px per frame] against truths; of several candidates the nearest to the truth counts.

    Raises
    ------
    ValueError
        If there are no trials, or not as many truths as answers.
    """
    if not answers or len(answers) != len(truths):
        raise ValueError(f"got {len(answers)} answers for {len(truths)} truths; every trial needs both")
    errors = np.array([_nearest(a, t) for a, t in zip(answers, truths, strict=True)])
    good = np.abs(errors) <= FAILURE_SHARE * np.abs(np.array(truths))  # NaN compares false
    answered = np.abs(errors[np.isfinite(errors)])
    return Score(
        len(errors),
        1.0 - float(good.mean()),
        float(np.median(answered)) if answered.size else math.nan,
        float(np.sqrt(np.mean(errors[good] ** 2))) if good.any() else math.nan,
    )


def _nearest(answer: tuple[float, ...], truth: float) -> float:
    errors = [value - truth for value in answer if math.isfinite(value)]
    return min(errors, key=abs) if errors else math.nan
