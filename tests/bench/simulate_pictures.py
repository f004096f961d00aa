"""Pictures of docs/simulate.md: frames of the demo's mission, its map, and what its sensors read.

``python -m tests.bench.simulate_pictures [FOLDER]``; the same bytes each time.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from axialnav.replay.experiments.figures import COLOURS, INK, MUTED, draw
from axialnav.replay.simulate.demo import demo_mission
from axialnav.replay.simulate.flight import Flown, fly_mission, sensed
from axialnav.replay.simulate.mission import CameraPlan
from axialnav.replay.simulate.rays import sees
from axialnav.replay.simulate.rig import anchors_of
from axialnav.replay.simulate.sensors.camera import CameraOnBoard

PLACES_M = {"doorway": 2.9, "stairs": 6.4, "in the corner": 12.2, "end of the turn": 14.2}
START_NS = 1_000_000_000


def frames(flown: Flown, path: Path) -> Path:
    """Four frames side by side, as PNG."""
    board = CameraOnBoard(flown.mission, flown.world, flown.trajectory, flown.streams)
    t = np.arange(0.0, flown.trajectory.duration_s, 0.02)
    at = flown.trajectory.at(t)
    flown_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at.position_m, axis=0), axis=1))])
    strips = []
    for name, place in PLACES_M.items():
        picture = board.picture(float(np.interp(place, flown_m, t)))
        cv2.putText(picture, name, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, 255, 1, cv2.LINE_AA)
        strips.append(picture)
    cv2.imwrite(str(path), np.vstack([np.hstack(strips[:2]), np.hstack(strips[2:])]))
    return path


def draw_map(flown: Flown, path: Path) -> Path:
    """Plan and side view of the corridor with the way flown and the anchors."""
    motion = flown.trajectory.at(np.arange(0.0, flown.trajectory.duration_s, 0.05))
    anchors = anchors_of(flown.mission)
    places = np.array(list(anchors.values()))
    hidden = ~np.stack([sees(flown.world, motion.position_m, place) for place in places]).any(axis=0)

    def paint(figure: Any) -> None:
        plan, side = figure.subplots(2, 1, height_ratios=(3, 2))
        for facet in flown.world.facets:
            ring = np.vstack([facet.corners, facet.corners[:1]])
            if facet.surface in ("left", "right", "end", "niche"):
                plan.plot(ring[:, 0], ring[:, 1], color=MUTED, lw=1.0)
            if facet.surface in ("floor", "ceiling") and abs(facet.normal[0]) + abs(facet.normal[2]) > 0.9:
                side.plot(ring[:, 0], ring[:, 2], color=MUTED, lw=1.0)
        for axes, column in ((plan, 1), (side, 2)):
            position = motion.position_m
            axes.plot(position[:, 0], position[:, column], color=INK, lw=1.5, label="flown")
            axes.plot(
                position[hidden, 0], position[hidden, column], ".", ms=3, color=COLOURS[1], label="no anchor in sight"
            )
            axes.plot(places[:, 0], places[:, column], "^", color=COLOURS[0], label="UWB anchors")
            axes.set_aspect("equal")
        plan.set(title="plan", ylabel="y [m]")
        side.set(title="from the side", xlabel="x [m]", ylabel="z [m]")
        plan.legend(loc="lower left")

    return draw(path, (8.0, 6.0), paint)


def draw_readings(flown: Flown, path: Path) -> Path:
    """Speed, wall and floor ranges, and the errors of UWB over time."""
    flight = sensed(flown, Path(), frames=False)
    truth = flight.truth
    assert truth is not None

    def seconds(t_ns: Any) -> Any:
        return (t_ns - START_NS) * 1e-9

    table = flight.tables["uwb0"]
    at = flown.trajectory.at(seconds(table.t_ns))
    antenna = at.position_m + at.rotation_WB.apply([0.0, 0.0, 0.1])
    places = np.array(list(anchors_of(flown.mission).values()))[table.columns["anchor"]]
    error = table.columns["range_m"] - np.linalg.norm(antenna - places, axis=1)

    def paint(figure: Any) -> None:
        speed, ranges, radio = figure.subplots(3, 1, sharex=True)
        speed.plot(seconds(truth.t_ns), np.linalg.norm(truth.velocity_m_s, axis=1), color=INK, lw=1.2)
        speed.set(ylabel="speed [m/s]")
        for name, colour, label in (("tof0", COLOURS[0], "wall"), ("tof1", COLOURS[2], "floor")):
            tof = flight.tables[name]
            ranges.plot(
                seconds(tof.t_ns), tof.columns["range_m"], ".", ms=2, color=colour, label=label, rasterized=True
            )
        ranges.set(ylabel="range [m]", ylim=(0.0, 4.0))
        ranges.legend(loc="upper left", ncols=2)
        for anchor in range(4):
            own = table.columns["anchor"] == anchor
            radio.plot(seconds(table.t_ns)[own], error[own], ".", ms=2, color=COLOURS[anchor], rasterized=True)
        radio.set(ylabel="UWB range error [m]", xlabel="time [s]")

    return draw(path, (8.0, 5.5), paint)


def main(folder: Path) -> None:
    """Make all pictures."""
    big = msgspec.structs.replace(demo_mission(), camera=CameraPlan(width_px=400, height_px=300, focal_px=200.0))
    flown = fly_mission(big, seed=0)
    print(draw_map(flown, folder / "simulate-map.svg"))
    print(draw_readings(flown, folder / "simulate-readings.svg"))
    print(frames(flown, folder / "simulate-frames.png"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/figures"))
