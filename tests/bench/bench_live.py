"""The node in real time on loopback: latency, processor time, what a bad link costs, hostile bytes, an hour on board.

``python -m tests.bench.bench_live [latency] [link] [bytes] [hour]``, all without a word.  The vehicle runs in a process
of its own.  The pictures are those of a simulated corridor flight, decoded before the clock starts: a camera hands over
pixels, not files.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2

from axialnav.fusion.live.camera_source import settle_opencv
from axialnav.fusion.live.cli import SWITCH_S
from axialnav.fusion.live.node import Node
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.live.warm_up import warm_up
from tests.bench import live_bytes, live_hour
from tests.bench.markdown import machine, number, table
from tests.fusion.live.filmed import Shutter, clean_errors, filmed_course, render, with_camera
from tests.fusion.live.sender_process import SenderProcess, Told
from tests.fusion.live.streamed import (
    SCENE,
    Air,
    Course,
    ahead,
    axial_errors,
    clean_axial_errors,
    rms,
    streamed_flight,
    vehicle_of,
)

SIZES = ((640, 480), (1920, 1080))
FLIGHT_S = 16.0
LATENCY_HEAD = (
    *("camera", "picture to motion p50 / p99 [ms]", "picture to message p50 / p99 / max [ms]"),
    *("inertial to filter p99 [ms]", "processor [% of a core]", "of it motion", "messages a second"),
)
LINK_HEAD = ("seed", "clean replay [m/s]", "good link", "bad link", "lost", "damaged")
BAD = Air(jitter_s=0.002, lost=0.05, reordered=0.05, damaged=0.10)


class Reel(Shutter):
    """The pictures of a flight, in memory."""

    def __init__(self, folder: Path, course: Course) -> None:
        super().__init__(folder, course.config)
        self._pictures = [(int(p.stem), cv2.imread(str(p), cv2.IMREAD_GRAYSCALE)) for p in self._files]

    def _recorded(self) -> Iterator[tuple[int, Any]]:
        yield from self._pictures


class Flown:
    """A course streamed through a node: the node's status at the end, and what the vehicle says."""

    status: dict[str, Any]
    told: Told

    def __init__(
        self, make: partial[Course], air: Air, vehicle_for: Any, *, reel: Reel | None = None, record: bool = False
    ) -> None:
        self.course = make()
        sender = SenderProcess(make, air)
        vehicle = vehicle_for(self.course.config, sender.port, sender.ttys)
        warm_up(vehicle.filter, vehicle.estimator)
        with tempfile.TemporaryDirectory() as folder:
            recording = FlightRecording(Path(folder), True, time.monotonic_ns) if record else None
            node = Node(vehicle, source=reel, recording=recording)
            node.start()
            self.t0_ns = sender.wait_for_start()
            used_s = time.process_time()
            try:
                if reel is not None:
                    reel.release(self.t0_ns)
                time.sleep(self.course.duration_s - (time.monotonic_ns() - self.t0_ns) * 1e-9)
                self.processor = (time.process_time() - used_s) / self.course.duration_s
                self.status = node.status()
            finally:
                node.close()
                self.told = sender.finish()

    @property
    def from_s(self) -> float:
        """Where the filter began, in flight time; a replay that begins there sees the same samples."""
        return float(self.status["filter"]["began_ns"] - self.t0_ns) * 1e-9 - 1e-3

    def rate_hz(self) -> float:
        """Mean rate of the messages from the first to the last."""
        stamps = self.told.odometry[:, 0]
        return float((len(stamps) - 1) / (stamps[-1] - stamps[0]))

    def rmse_m_s(self, start_s: float) -> float:
        """Axial velocity of the messages against the truth."""
        return rms(axial_errors(self.course, self.told.odometry, start_s, self.course.duration_s - 0.2))


def latency_row(folder: Path, width: int, height: int, *, record: bool = False) -> list[str]:
    """Latencies and processor time with inertial samples at 200 Hz, UWB 50, two range finders at 50 and a camera."""
    render(folder, seed=3, duration_s=FLIGHT_S, width_px=width, height_px=height)
    make = partial(filmed_course, folder)
    flown = Flown(
        make,
        Air(),
        lambda *given: with_camera(vehicle_of(*given)),
        reel=Reel(folder, make()),
        record=record,
    )
    used, late = flown.status["processor_s"], flown.status["latency"]
    if "-v" in sys.argv:
        sys.stdout.write(f"{flown.status}\n")

    def both(name: str, *more: str) -> str:
        return " / ".join(number(late[name][f"{key}_ms"], 1) for key in ("p50", "p99", *more))

    return [
        f"{width}x{height}" + (", recorded" if record else ""),
        both("camera"),
        both("frame_to_message", "max"),
        number(late["queue"]["p99_ms"], 1),
        number(100.0 * flown.processor, 0),
        number(100.0 * used["motion"] / flown.course.duration_s, 0),
        number(flown.rate_hz(), 1),
    ]


def link_rows(seeds: tuple[int, ...], seconds: float = 12.0) -> Iterator[list[str]]:
    """Axial RMSE of the messages against that of a clean replay that starts with the node; the last row pools all."""
    squares = []
    for seed in seeds:
        make = partial(streamed_flight, replace(SCENE, seed=seed, duration_s=seconds, still_s=3.0))
        (good, by_good, _), (bad, by_bad, status) = (
            streamed_rms(make, air) for air in (Air(), replace(BAD, seed=seed))
        )
        clean = 0.5 * (by_good + by_bad)
        squares.append((clean**2, good**2, bad**2))
        counts, lost = status["link"]["counts"], status["link"]["lost"]["1/1"]
        yield [str(seed), *(number(v, 4) for v in (clean, good, bad)), str(lost), str(counts["damaged"])]
    yield from pooled(squares)


def filmed_rows(folder: Path, seeds: tuple[int, ...], seconds: float = 16.0) -> Iterator[list[str]]:
    """The same with a camera instead of a flow sensor: corridor flights with their pictures."""
    squares = []
    for seed in seeds:
        path = render(folder / f"filmed{seed}", seed=seed, duration_s=seconds)
        (good, by_good, _), (bad, by_bad, status) = (filmed_rms(path, air) for air in (Air(), replace(BAD, seed=seed)))
        clean = 0.5 * (by_good + by_bad)
        squares.append((clean**2, good**2, bad**2))
        counts, lost = status["link"]["counts"], status["link"]["lost"]["1/1"]
        yield [str(seed), *(number(v, 4) for v in (clean, good, bad)), str(lost), str(counts["damaged"])]
    yield from pooled(squares)


def pooled(squares: list[tuple[float, float, float]]) -> Iterator[list[str]]:
    """Root mean squares over all flights, and their ratios to the clean replay's."""
    total = [(sum(column) / len(squares)) ** 0.5 for column in zip(*squares, strict=True)]
    yield ["all", *(number(v, 4) for v in total), *(["-"] * 2)]
    yield ["ratio", "1", *(number(v / total[0], 2) for v in total[1:]), *(["-"] * 2)]


def streamed_rms(make: partial[Course], air: Air) -> tuple[float, float, dict[str, Any]]:
    """Axial RMSE [m/s] of the messages of a streamed flight, that of a clean replay from the same sample on, status."""
    flown = Flown(make, air, lambda config, *given: vehicle_of(ahead(config), *given))
    clean = rms(clean_axial_errors(flown.course, flown.from_s, 3.5, flown.course.duration_s - 0.2))
    return flown.rmse_m_s(3.5), clean, flown.status


def filmed_rms(folder: Path, air: Air) -> tuple[float, float, dict[str, Any]]:
    """As :func:`streamed_rms` with pictures."""
    make = partial(filmed_course, folder)
    flown = Flown(make, air, lambda *given: with_camera(vehicle_of(*given)), reel=Reel(folder, make()))
    clean = rms(clean_errors(folder, flown.from_s, 2.0, flown.course.duration_s - 0.2))
    return flown.rmse_m_s(2.0), clean, flown.status


def main() -> None:
    """Print the tables that are asked for, all if none is."""
    wanted = [word for word in sys.argv[1:] if not word.startswith("-")] or ["latency", "link", "bytes", "hour"]
    sys.setswitchinterval(SWITCH_S)
    settle_opencv()
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    sys.stdout.write(f"{machine()}; load of the machine {load}\n\n")
    with tempfile.TemporaryDirectory() as made:
        folder = Path(os.environ.get("AXIALNAV_BENCH_FLIGHTS", made))
        if "latency" in wanted:
            rows = [latency_row(folder / f"{w}x{h}", w, h, record=r) for r in (False, True) for w, h in SIZES]
            sys.stdout.write(table(LATENCY_HEAD, rows) + "\n\n")
        if "link" in wanted:
            sys.stdout.write(
                "Axial velocity RMSE of the messages, bad link: 2 ms jitter, 5 % lost, 5 % late, 10 % damaged\n\n"
                "with an image-flow sensor:\n\n"
            )
            sys.stdout.write(table(LINK_HEAD, link_rows((1, 2, 3, 4, 5, 6))) + "\n\nwith a camera:\n\n")
            sys.stdout.write(table(LINK_HEAD, filmed_rows(folder, (1, 2, 3))) + "\n")
    if "bytes" in wanted:
        sys.stdout.write("\n" + table(live_bytes.HEAD, live_bytes.byte_rows()) + "\n")
    if "hour" in wanted:
        sys.stdout.write("\n" + table(live_hour.HEAD, live_hour.hour_rows()) + "\n")


if __name__ == "__main__":
    main()
