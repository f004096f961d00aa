"""Run the image methods over rendered conditions and sum up their errors."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import estimate_motion
from axialnav.replay.simulate.render import Rendering
from tests.bench.motion_bound import displacement_bound
from tests.bench.motion_scenes import EXPOSURE_S, PERIOD_S, WALLS, Condition, draw

Array = NDArray[np.float64]
GROSS_PX, GROSS_SHARE = 1.0, 0.2
DROP_SHARE = 0.05


@dataclass(frozen=True)
class Trials:
    """All trials of one condition and method; errors of accepted ones only."""

    condition: Condition
    asked: int
    error: Array
    sigma: Array
    bound: Array
    truth: Array
    reasons: Counter[str]

    @property
    def rms(self) -> float:
        """Root mean square error [px per frame]."""
        return float(np.sqrt(np.mean(self.error**2))) if len(self.error) else float("nan")

    @property
    def median(self) -> float:
        """Median absolute error [px per frame]."""
        return float(np.median(np.abs(self.error))) if len(self.error) else float("nan")

    @property
    def over_bound(self) -> float:
        """Root mean square of error over the bound of its own trial [-]."""
        return float(np.sqrt(np.mean((self.error / self.bound) ** 2))) if len(self.error) else float("nan")

    @property
    def z(self) -> float:
        """Root mean square of error over sigma [-]."""
        return float(np.sqrt(np.mean((self.error / self.sigma) ** 2))) if len(self.error) else float("nan")

    @property
    def covered(self) -> float:
        """Share of errors within 1.96 sigma [-]."""
        return float(np.mean(np.abs(self.error) < 1.96 * self.sigma)) if len(self.error) else float("nan")

    @property
    def gross(self) -> int:
        """Accepted results wrong by more than max(1 px, 20 %); in scenes without a wall: all accepted ones."""
        if not self.condition.moving:
            return len(self.error)
        return int(np.sum(np.abs(self.error) > np.maximum(GROSS_PX, GROSS_SHARE * np.abs(self.truth))))

    @property
    def over_five_percent(self) -> int:
        """Accepted results wrong by more than 5 %."""
        return int(np.sum(np.abs(self.error) > DROP_SHARE * np.abs(self.truth)))


def per_period(picture: Rendering) -> float:
    """True displacement per period [px]; with a frame dropped or repeated that is not the mean over the frames."""
    trajectory = picture.scene.trajectory
    return picture.displacement_px if trajectory.frame_times is None else trajectory.displacement_px


def run_trials(
    condition: Condition, count: int, method: str = "joint", first: int = 0, width: int = 960, height: int = 540
) -> Trials:
    """Render and measure ``count`` trials, starting with number ``first``."""
    rows, reasons = [], Counter[str]()
    for trial in range(first, first + count):
        picture = draw(condition, trial, width=width, height=height)
        frames = picture.frames[2:3] if method == "single" else picture.frames
        estimate = estimate_motion(frames, method=method, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
        reasons[str(estimate.reason)] += 1
        if estimate.accepted:
            truth = per_period(picture) if estimate.signed else abs(per_period(picture))
            bound = displacement_bound(picture.scene, trial % WALLS, 5) if condition.contrast else float("nan")
            rows.append((estimate.displacement_px - truth, estimate.sigma_px, bound, truth))
    columns = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return Trials(condition, count, columns[0], columns[1], columns[2], columns[3], reasons)
