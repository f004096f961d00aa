"""How often something wrong is accepted, over everything that can go wrong with the frames.

Rendering costs more than estimating, so a rendering of nine frames is used for the five windows of five frames in it.
Where the motion is not the same in every window (faults of single frames, jitter, acceleration, drift, roll) each
rendering has five frames, and there are three of them instead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import MotionEstimate, MotionEstimator
from axialnav.replay.simulate.render import Rendering
from tests.bench.markdown import table
from tests.bench.motion_scenes import EVERYTHING, EXPOSURE_S, PERIOD_S, Condition, draw
from tests.bench.motion_trials import DROP_SHARE, GROSS_PX, GROSS_SHARE, per_period

FIRST = 100_000
WINDOW, LONG, SHORT_REPEATS = 5, 9, 3
UNEVEN = ("frame", "jitter", "drift")


def integrity(rounds: int) -> str:
    """Table over all conditions; a round is one rendering of each (three where only one window fits)."""
    rows, sums, renderings = [], Counter[str](), 0
    for condition in EVERYTHING:
        counts, reasons = Counter[str](), Counter[str]()
        for picture in _renderings(condition, rounds):
            renderings += 1
            for estimate in _windows(picture.frames):
                counts.update(_verdicts(condition, picture, estimate))
                reasons[str(estimate.reason)] += 1
        why = "; ".join(f"{n} x {text.split(':')[0]}" for text, n in reasons.most_common(3) if text != "accepted")
        dropped = str(counts["five"]) if "dropped" in condition.name else "-"
        rows.append((condition.name, f"{counts['accepted']}/{counts['asked']}", str(counts["gross"]), dropped, why))
        sums.update(counts)
    rows.append((f"all ({renderings} renderings)", f"{sums['accepted']}/{sums['asked']}", str(sums["gross"]), "-", ""))
    head = ("condition", "accepted windows", "wrong by > max(1 px, 20 %)", "wrong by > 5 %", "refused because")
    return table(head, rows)


def _renderings(condition: Condition, rounds: int) -> Iterator[Rendering]:
    if any(word in condition.name for word in UNEVEN):
        yield from (draw(condition, SHORT_REPEATS * FIRST + k) for k in range(SHORT_REPEATS * rounds))
    else:
        yield from (draw(condition, FIRST + k, frames=LONG) for k in range(rounds))


def _windows(frames: NDArray[np.uint8]) -> Iterator[MotionEstimate]:
    estimator = MotionEstimator(frames=WINDOW)
    for k, frame in enumerate(frames):
        estimate = estimator.push(round(k * PERIOD_S * 1e9), frame, EXPOSURE_S)
        if estimate is not None:
            yield estimate


def _verdicts(condition: Condition, picture: Rendering, estimate: MotionEstimate) -> Iterator[str]:
    yield "asked"
    if not estimate.accepted:
        return
    yield "accepted"
    truth = per_period(picture)
    error = abs(estimate.displacement_px - truth)
    if not condition.moving or error > max(GROSS_PX, GROSS_SHARE * abs(truth)):
        yield "gross"
    if error > DROP_SHARE * abs(truth):
        yield "five"
