"""The node in real time on loopback: latency, processor time, and what a bad link costs.

``python -m tests.bench.bench_live``; vehicle and node share one process, only the node's threads are counted.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.live.camera_source import Picture
from axialnav.fusion.live.cli import SWITCH_S
from axialnav.fusion.live.node import Node
from axialnav.fusion.live.vehicle import CameraInput, Vehicle
from axialnav.fusion.live.warm_up import warm_up
from tests.bench.markdown import machine, number, table
from tests.fusion.live.streamed import (
    SCENE,
    Air,
    StreamedVehicle,
    ahead,
    clean_axial_errors,
    rms,
    streamed_flight,
    vehicle_of,
)
from tests.fusion.made_flights import MadeFlight, Scene

RATE_HZ = 30.0
LEFT_BS = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
LATENCY_HEAD = (
    *("camera", "picture to motion p50 / p99 [ms]", "picture to message p50 / p99 [ms]", "inertial to filter p99 [ms]"),
    *("filter p99 [ms]", "processor [% of a core]", "of it motion", "messages a second"),
)
LINK_HEAD = ("seed", "clean replay [m/s]", "good link", "bad link", "lost", "damaged")
BAD = Air(jitter_s=0.002, lost=0.05, reordered=0.05, damaged=0.10)


class StillCamera:
    """Pictures of a wall that stands still, each with its own noise, at a steady rate."""

    def __init__(self, width: int, height: int) -> None:
        rng = np.random.default_rng(1)
        texture = cv2.GaussianBlur(rng.random((height, width)), (0, 0), 2.0)
        grey = (texture - texture.min()) / np.ptp(texture) * 235.0 + 10.0
        self.images = [(grey + rng.normal(0.0, 2.0, grey.shape)).astype(np.uint8) for _ in range(16)]
        self.settings: list[Any] = []
        self.stamps_by_arrival = 0

    def pictures(self) -> Iterator[Picture | None]:
        """A picture every 33 ms, stamped when it is handed over."""
        began, number_ = time.monotonic_ns(), 0
        while True:
            due = began + round(number_ * 1e9 / RATE_HZ)
            time.sleep(max((due - time.monotonic_ns()) * 1e-9, 0.0))
            yield Picture(due, time.monotonic_ns(), self.images[number_ % 16], 0.005)
            number_ += 1

    def close(self) -> None:
        """Nothing is open."""


def with_camera(config: Config, width: int, height: int) -> Config:
    """The configuration with a camera that looks at a wall on the left."""
    data = config.to_dict()
    data["surface"]["wall"] = {"normal": [0.0, -1.0, 0.0], "offset_m": -1.5}
    data["sensor"]["cam0"] = {
        "kind": "camera",
        "rate_hz": RATE_HZ,
        "resolution": [width, height],
        "intrinsics": [600.0, 600.0, width / 2.0, height / 2.0],
        "surface": "wall",
        "T_BS": list(LEFT_BS),
    }
    return Config.from_dict(data)


def fly(vehicle: Vehicle, streamed: StreamedVehicle, source: Any = None) -> dict[str, Any]:
    """Stream a flight through a node; the status at its end."""
    warm_up(vehicle.filter, vehicle.estimator)
    node = Node(vehicle, source=source)
    node.start()
    streamed.start()
    try:
        while streamed.now_s() < streamed.scene.duration_s:
            time.sleep(0.05)
        return node.status() | {"seconds": streamed.now_s()}
    finally:
        node.close()
        streamed.close()


def latency_row(width: int, height: int, seconds: float = 20.0) -> list[str]:
    """Latencies and processor time with inertial samples at 200 Hz, UWB 50, range 30, flow 50 and a camera."""
    scene = Scene(
        seed=1, duration_s=seconds, still_s=seconds, yaw_rate_rad_s=0.0, sensors=("range0", "uwb0"), uwb_rate_hz=50.0
    )
    flight = streamed_flight(scene)
    streamed = StreamedVehicle(flight, scene)
    vehicle = vehicle_of(with_camera(flight.config, width, height), streamed.port, streamed.ttys)
    camera = CameraInput(source="memory", sensor="cam0")
    vehicle = Vehicle(**{name: getattr(vehicle, name) for name in vehicle.__struct_fields__} | {"camera": camera})
    status = fly(vehicle, streamed, StillCamera(width, height))
    seconds, used, late = status["seconds"], status["processor_s"], status["latency"]

    def both(name: str) -> str:
        return f"{number(late[name]['p50_ms'], 1)} / {number(late[name]['p99_ms'], 1)}"

    return [
        f"{width}x{height}",
        both("camera"),
        both("frame_to_message"),
        number(late["queue"]["p99_ms"], 1),
        number(late["filter"]["p99_ms"], 2),
        number(100.0 * sum(used.values()) / seconds, 0),
        number(100.0 * used["motion"] / seconds, 0),
        number(status["output"]["sent"] / seconds, 1),
    ]


def link_rows(seeds: tuple[int, ...], seconds: float = 12.0) -> Iterator[list[str]]:
    """Axial RMSE of the messages against that of a clean replay that starts with the node; the last row pools all."""
    squares = []
    for seed in seeds:
        scene = replace(SCENE, seed=seed, duration_s=seconds, still_s=3.0)
        flight = streamed_flight(scene)
        (good, by_good, _), (bad, by_bad, status) = (
            streamed_rms(flight, scene, air) for air in (Air(), replace(BAD, seed=seed))
        )
        clean = 0.5 * (by_good + by_bad)
        squares.append(np.square([clean, good, bad]))
        counts = status["link"]["counts"]
        lost = status["link"]["lost"]["1/1"]
        yield [str(seed), *(number(v, 4) for v in (clean, good, bad)), str(lost), str(counts["damaged"])]
    pooled = np.sqrt(np.mean(squares, axis=0))
    yield ["all", *(number(float(v), 4) for v in pooled), *(["-"] * 2)]
    yield ["ratio", "1", *(number(float(v / pooled[0]), 2) for v in pooled[1:]), *(["-"] * 2)]


def streamed_rms(flight: MadeFlight, scene: Scene, air: Air) -> tuple[float, float, dict[str, Any]]:
    """Axial RMSE [m/s] of the messages of a streamed flight, that of a clean replay from the same sample on, status."""
    streamed = StreamedVehicle(flight, scene, air)
    status = fly(vehicle_of(ahead(flight.config), streamed.port, streamed.ttys), streamed)
    from_s = (status["filter"]["began_ns"] - streamed.t0_ns) * 1e-9 - 1e-3
    clean = rms(clean_axial_errors(flight, scene, from_s, 3.5, scene.duration_s - 0.2))
    return rms(streamed.axial_errors(3.5, scene.duration_s - 0.2)), clean, status


def main() -> None:
    """Print both tables."""
    sys.setswitchinterval(SWITCH_S)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    sys.stdout.write(f"{machine()}; load of the machine {load}\n\n")
    sys.stdout.write(table(LATENCY_HEAD, [latency_row(640, 480), latency_row(1920, 1080)]) + "\n\n")
    sys.stdout.write(
        "Axial velocity RMSE of the messages, bad link: 2 ms jitter, 5 % lost, 5 % late, 10 % damaged:\n\n"
    )
    sys.stdout.write(table(LINK_HEAD, link_rows((1, 2, 3, 4, 5, 6))) + "\n")


if __name__ == "__main__":
    main()
