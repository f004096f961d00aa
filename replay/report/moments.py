"""Frames of a few telling moments of a flight, read from where they were recorded."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import Camera
from axialnav.replay.axial import along, axial_frame
from axialnav.replay.image_velocity import wall_distance
from axialnav.replay.motion import pictures
from axialnav.replay.run import Run

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Moment:
    """A window of neighbouring frames.

    ``title`` says why it was chosen, ``seconds`` is its middle after the first IMU sample, ``speed_m_s`` the fused
    axial velocity then, ``displacement_px`` what that means per frame period on the image, NaN where the camera sees
    no wall; ``frames`` are (h, w) each, grey, 8 bit.
    """

    title: str
    seconds: float
    speed_m_s: float
    displacement_px: float
    frames: list[Picture]


def moments(run: Run, camera: str, spec: Camera) -> list[Moment]:
    """The fastest window, the one of median speed and the slowest, in order of time; fewer in short recordings."""
    stamps, size = run.flight.tables[camera].t_ns, run.config.camera.frames
    middles = stamps[: stamps.size - size + 1] // 2 + stamps[size - 1 :] // 2
    starts = np.flatnonzero((middles >= run.track.t_ns[0]) & (middles <= run.track.t_ns[-1]))
    if starts.size == 0:
        return []
    rows = np.searchsorted(run.track.t_ns, middles[starts], side="right") - 1
    speed = along(axial_frame(run.config.corridor, run.track.position_m[rows]).axis, run.track.velocity_m_s[rows])
    order = np.argsort(np.abs(speed))
    chosen = {int(order[-1]): "fastest", int(order[order.size // 2]): "median speed", int(order[0]): "slowest"}
    period_s = float(np.median(np.diff(stamps))) * 1e-9
    shift = np.abs(speed) * period_s * spec.focal_px[0] / wall_distance(run, spec, rows)
    return [
        Moment(
            chosen[k],
            float(middles[starts[k]] - run.track.t_ns[0]) * 1e-9,
            float(speed[k]),
            float(shift[k]),
            [_grey(frame) for frame in islice(pictures(run.flight, camera, int(starts[k])), size)],
        )
        for k in sorted(chosen)
    ]


def _grey(frame: NDArray[np.generic]) -> Picture:
    """8-bit grey of a frame as recorded: colours averaged, 16 bits cut to the upper eight."""
    grey = frame.mean(axis=2) if frame.ndim == 3 else frame
    if frame.dtype == np.uint16:
        grey = grey // 256
    return np.asarray(grey, dtype=np.uint8)
