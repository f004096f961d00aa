"""Image motion on rendered walls: ``python -m tests.bench.bench_motion [trials [part ...]]`` (``make bench-motion``).

960x540, five frames, 0.5-45 px per frame log-uniform, both signs, te / T = 0.3; every trial renders another piece of
wall.  The bound is the Cramer-Rao bound of the rendered texture and light (``motion_bound``).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import MotionEstimator, estimate_motion
from axialnav.models.rig import Camera
from axialnav.replay.simulate.render import Rendering
from tests.bench.markdown import machine, number, table
from tests.bench.motion_integrity import integrity
from tests.bench.motion_peers import PEERS
from tests.bench.motion_scenes import (
    BASE,
    CLEAN,
    DISTURBED,
    EXPOSURE_S,
    FAINT,
    OCCLUDED,
    PERIOD_S,
    Condition,
    draw,
)
from tests.bench.motion_streams import streams
from tests.bench.motion_trials import Trials, run_trials

Way = Callable[[NDArray[np.uint8]], float]
TRIALS = 200
ASKED = {"10 % bright": 0.0015, "5 % dim": 0.007, "2 % dim": 0.022, FAINT.name: 0.15}
REPEATS = 15
PEER_TRIALS = 12


def main(arguments: Sequence[str]) -> int:
    """Print the tables; the arguments are the number of trials per row and the names of the parts, all by default."""
    cv2.setNumThreads(1)
    count = int(arguments[0]) if arguments else TRIALS
    print(f"{machine()}, {count} trials per row\n")
    parts: dict[str, Callable[[], str]] = {
        "accuracy": lambda: accuracy(count),
        "integrity": lambda: integrity(max(1, count // 2)),
        "streams": lambda: streams(max(1, count // 8)),
        "blur": lambda: blur_methods(max(1, count // 4)),
        "peers": lambda: peers(PEER_TRIALS),
        "speed": speed,
    }
    for name in arguments[1:] or parts:
        print(parts[name]() + "\n", flush=True)
    return 0


def accuracy(count: int) -> str:
    """Errors of the joint estimate beside the bound."""
    head = ("joint, N = 5", "accepted", "RMS [px]", "asked", "median [px]", "RMS / bound", "z", "in 95 %", "gross")
    clean = {c.name: run_trials(c, count) for c in (*CLEAN, FAINT)}
    base = clean[BASE.name].rms
    rows = [_row(trials, ASKED[name]) for name, trials in clean.items()]
    rows += [_row(run_trials(condition, count), 2.0 * base) for condition in (*DISTURBED, *OCCLUDED)]
    return table(head, rows)


def _row(trials: Trials, asked: float) -> tuple[str, ...]:
    verdict = "ok" if trials.rms <= asked else "SHORT"
    return (
        trials.condition.name,
        f"{len(trials.error)}/{trials.asked}",
        number(trials.rms, 5),
        f"{asked:.4f} {verdict}",
        number(trials.median, 5),
        number(trials.over_bound, 2),
        number(trials.z, 2),
        f"{100.0 * trials.covered:.0f} %",
        str(trials.gross),
    )


def blur_methods(count: int) -> str:
    """Composite and single exposure."""
    rows = []
    for method in ("composite", "single"):
        for condition in CLEAN[:2]:
            trials = run_trials(condition, count, method)
            wrong = int(np.sum(np.abs(trials.error) > 0.2 * trials.truth))
            rows.append(
                (
                    method,
                    condition.name,
                    f"{len(trials.error)}/{count}",
                    number(trials.median, 4),
                    str(wrong),
                    number(trials.z, 2),
                )
            )
    return table(("method", "condition", "accepted", "median error [px]", "off by > 20 %", "z"), rows)


def peers(count: int) -> str:
    """Errors and times of OpenCV's methods on the same 1080p frames in the same run."""
    rows = []
    for condition in CLEAN:
        pictures = [draw(condition, trial, width=1920, height=1080) for trial in range(count)]
        ways: dict[str, Way] = {"joint": _joint, **PEERS}
        scores = {name: _scored(way, pictures) for name, way in ways.items()}
        ours, own_ms = scores["joint"]
        for name, (rms, ms) in scores.items():
            cells = (number(rms, 4), number(rms / ours, 1), number(ms, 1), number(ms / own_ms, 1))
            rows.append((condition.name, name, *cells))
    head = ("1080p, N = 5", "method", "RMS [px]", "error over ours", "time [ms]", "time over ours")
    return table(head, rows)


def _scored(way: Way, pictures: list[Rendering]) -> tuple[float, float]:
    """Root mean square error [px] and median processor time [ms]."""
    errors, spent = [], []
    way(pictures[0].frames)
    for picture in pictures:
        start = time.thread_time()
        value = way(picture.frames)
        spent.append(1e3 * (time.thread_time() - start))
        errors.append(value - picture.displacement_px)
    return float(np.sqrt(np.nanmean(np.square(errors)))), float(np.median(spent))


def _joint(frames: NDArray[np.uint8]) -> float:
    return estimate_motion(frames, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S).displacement_px


def speed() -> str:
    """Processor time of streaming at 1080p: median and least of a run of frames."""
    rows = []
    for frames, asked in ((2, "1"), (5, "4, streaming 2")):
        for prior in (False, True):
            spent = list(_streaming(frames, prior))
            name = f"N = {frames}" + (", with prior" if prior else "")
            rows.append((name, number(float(np.median(spent)), 2), number(min(spent), 2), asked))
    pictures, spent = draw(Condition("speed", 0.05), 3, width=1920, height=1080).frames, []
    for _ in range(REPEATS):
        start = time.thread_time()
        estimate_motion(pictures, method="composite", frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
        spent.append(1e3 * (time.thread_time() - start))
    rows.append(("composite of 5", number(float(np.median(spent)), 2), number(min(spent), 2), "5"))
    return table(("1080p, per new frame", "median [ms]", "least [ms]", "asked"), rows)


def _streaming(frames: int, prior: bool) -> Iterator[float]:
    condition = Condition("speed", 0.05)
    picture = draw(condition, 3, frames=REPEATS + frames, width=1920, height=1080)
    camera = Camera(resolution=(1920, 1080), intrinsics=(602.0, 602.0, 960.0, 540.0), rate_hz=1.0 / PERIOD_S)
    estimator = MotionEstimator(camera, frames=frames)
    known = (picture.displacement_px, 0.3) if prior else None
    for k, frame in enumerate(picture.frames):
        start = time.thread_time()
        answer = estimator.push(round(k * PERIOD_S * 1e9), frame, EXPOSURE_S, known)
        if answer is not None and k > frames:
            yield 1e3 * (time.thread_time() - start)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
