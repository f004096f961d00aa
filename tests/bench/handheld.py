"""Image motion on real frames: a hand-held camera over a painted floor, fast frames averaged into long exposures."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import MotionEstimate, estimate_motion
from tests.bench.markdown import number, table

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
FOLDER = "frames_240fps"
RATE_HZ, STEP = 240.0, 8  # of the fast frames, and those from one slow frame to the next
EXPOSURES = (3, 8)  # fast frames in one exposure: 12.5 and 33 ms
ASKED_PX = 0.1
LK_WINDOW, SMOOTH_PX, MANY, QUALITY, APART_PX, FAR_PX = (41, 41), 1.2, 400, 0.005, 6, 1.0
HEAD = (
    "exposure", "pairs", "accepted", "from shifts: median [px]", "largest [px]", "from Lucas-Kanade: median [px]",
    "largest [px]", "error / sigma", "between these two: median [px]", "largest [px]", "asked", "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Floor:
    """Fast frames and how far they move in ``STEP`` frames along the rows [px] by two registrations.

    Parameters
    ----------
    frames
        Shape (n, h, w).
    step_px
        Speed from frame to frame by the recording's table, shape (m,).
    shifts_px
        By the table (phase correlation and ECC), shape (m,).
    tracked_px
        By Lucas-Kanade, mean over corners, shape (m,).
    """

    frames: NDArray[np.uint8]
    step_px: Array
    shifts_px: Array
    tracked_px: Array


def read_floor(folder: Path) -> Floor:
    """Read the frames and their table, and register them once more."""
    with (folder / "shifts.csv").open() as file:
        rows = list(csv.DictReader(file))
    pictures = [np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for path in sorted(folder.glob("f*.png"))]
    frames = np.stack(pictures).astype(np.uint8)
    shift = np.array([[float(row["dx8"]), float(row["dy8"])] for row in rows])
    smooth = [_stretched(frame) for frame in frames]
    tracked = [_tracked(a, b, s) for a, b, s in zip(smooth, smooth[STEP:], shift, strict=False)]
    return Floor(frames, np.array([float(row["dx1"]) for row in rows]), shift[:, 0], np.array(tracked))


def _stretched(frame: Picture) -> Picture:
    """The faint floor over all grey levels, noise smoothed."""
    smooth = cv2.GaussianBlur(frame.astype(np.float32), (0, 0), SMOOTH_PX)
    return np.asarray(np.clip(128.0 + 10.0 * (smooth - float(np.median(smooth))), 0, 255), dtype=np.uint8)


def _tracked(first: Picture, second: Picture, guess: Array) -> float:
    corners = cv2.goodFeaturesToTrack(first, MANY, QUALITY, APART_PX)
    start = (corners + guess.astype(np.float32)).astype(np.float32)
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        first, second, corners, start.copy(), winSize=LK_WINDOW, maxLevel=0, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    back, again, _ = cv2.calcOpticalFlowPyrLK(
        second, first, found, corners.copy(), winSize=LK_WINDOW, maxLevel=0, flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    motion = (found - corners).reshape(-1, 2)[:, 0]
    good = (status & again).ravel().astype(bool) & (np.abs(back - corners).reshape(-1, 2).max(axis=1) < FAR_PX)
    middle = float(np.median(motion[good]))
    return float(motion[good & (np.abs(motion - middle) < 2 * FAR_PX)].mean())


def exposed(frames: NDArray[np.uint8], first: int, count: int) -> Picture:
    """One exposure over ``count`` of the fast frames (n, h, w)."""
    return np.asarray(np.rint(frames[first : first + count].mean(axis=0)), dtype=np.uint8)


@dataclass(frozen=True)
class Pairs:
    """Pairs of one exposure: accepted estimates beside both registrations, all in px per slow frame, shape (n,)."""

    pairs: int
    value: Array
    sigma: Array
    shifts: Array
    tracked: Array
    unevenness: Array

    @property
    def gross(self) -> int:
        """Estimates off by more than 1 px and more than 20 %."""
        off = np.abs(self.value - self.shifts)
        return int(np.sum(off > np.maximum(1.0, 0.2 * np.abs(self.shifts))))


def measure_pairs(floor: Floor, count: int) -> Pairs:
    """Estimates of all pairs of exposures over ``count`` fast frames, one slow frame apart."""
    last = len(floor.shifts_px) - count + 1
    rows = []
    for first in range(last):
        pictures = [exposed(floor.frames, start, count) for start in (first, first + STEP)]
        estimate = estimate_motion(pictures, frame_period_s=STEP / RATE_HZ, exposure_s=count / RATE_HZ)
        if estimate.accepted:
            rows.append(_row(floor, first, count, estimate))
    columns = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    return Pairs(last, *columns)


def _row(floor: Floor, first: int, count: int, estimate: MotionEstimate) -> tuple[float, ...]:
    """One line of :class:`Pairs`; the motion of an exposure is the mean of the fast frames'."""
    during = slice(first, first + count)
    speeds = np.concatenate([floor.step_px[during], floor.step_px[first + STEP : first + STEP + count]])
    means = (float(floor.shifts_px[during].mean()), float(floor.tracked_px[during].mean()))
    return (estimate.displacement_px, estimate.sigma_px, *means, float(np.ptp(speeds)))


def floor_table(folder: Path) -> str:
    """Table of the hand-held run, or the line that says it is not there."""
    if not (folder / FOLDER / "shifts.csv").is_file():
        return f"skipped: {FOLDER} is not in {folder}"
    floor = read_floor(folder / FOLDER)
    return "Hand-held camera over a floor:\n\n" + table(HEAD, [floor_row(floor, count) for count in EXPOSURES])


def floor_row(floor: Floor, count: int) -> Sequence[str]:
    """One exposure: estimates against both registrations, and these against one another."""
    seen = measure_pairs(floor, count)
    off, z = np.abs(seen.value - seen.shifts), (seen.value - seen.tracked) / seen.sigma
    apart = [np.abs(seen.value - seen.tracked), np.abs(seen.shifts - seen.tracked)]
    verdict = "ok" if len(off) and off.max() <= ASKED_PX else "SHORT"
    return (
        f"{1e3 * count / RATE_HZ:.1f} ms", str(seen.pairs), str(len(off)), *_both(off), *_both(apart[0]),
        number(float(np.sqrt(np.mean(z**2))), 1), *_both(apart[1]), f"{ASKED_PX} px", verdict,
    )  # fmt: skip


def _both(values: Array) -> tuple[str, str]:
    return number(float(np.median(values)), 2), number(float(values.max()), 2)
