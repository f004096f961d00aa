"""Frames of a flight to displacements, and their score against the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.estimate import MotionEstimate, MotionEstimator
from axialnav.estimators.pictures import read_picture, read_video
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Camera
from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.motion_truth import TrueMotion, knows_distance, true_motion

Array = NDArray[np.float64]
CSV_HEAD = "#timestamp [ns],window [s],displacement [px],sigma [px],cross [px],accepted,signed,kappa,reason"


@dataclass(frozen=True)
class MotionRun:
    """Estimates of one camera, window by window.

    Parameters
    ----------
    flight
        Name of the flight.
    camera
        Name of the camera.
    method
        Name of the method.
    frames
        Frames per window.
    available
        Frames in the recording.
    undistorted
        Whether the lens' distortion was removed.
    estimates
        One per window, stamped at the middles.
    period_s
        Frame period of every window [s], shape (n,).
    truth
        True motion of the same windows, None where it is not known.
    """

    flight: str
    camera: str
    method: str
    frames: int
    available: int
    undistorted: bool
    estimates: tuple[MotionEstimate, ...]
    period_s: Array
    truth: TrueMotion | None

    def accepted(self) -> NDArray[np.bool_]:
        """Which windows gave a number, shape (n,)."""
        return np.array([estimate.accepted for estimate in self.estimates], dtype=np.bool_)

    def values(self, name: str) -> Array:
        """One numeric field of all estimates, shape (n,)."""
        return np.array([getattr(estimate, name) for estimate in self.estimates], dtype=np.float64)

    def to_csv(self) -> str:
        """One line per window, refused ones included."""
        lines = [CSV_HEAD]
        for e in self.estimates:
            numbers = f"{e.window_s:.6f},{e.displacement_px:.6f},{e.sigma_px:.6f},{e.cross_px:.4f}"
            reason = e.reason.replace(",", ";")
            lines.append(f"{e.t_ns},{numbers},{int(e.accepted)},{int(e.signed)},{e.kappa:.4f},{reason}")
        return "\n".join(lines) + "\n"


def run_motion(
    flight: Flight,
    *,
    camera: str = "cam0",
    method: str = "joint",
    frames: int = 5,
    axis: str = "x",
    distance_m: float | None = None,
    undistort: bool | None = None,
    progress: Callable[[float], None] | None = None,
) -> MotionRun:
    """Estimate every window of ``frames`` neighbouring frames.

    Parameters
    ----------
    flight
        Flight with a camera.
    camera
        Its name.
    method, frames, axis
        As in :class:`~axialnav.estimators.estimate.MotionEstimator`.
    distance_m
        Distance of the wall for the score [m]; None: from the surface that the camera names.
    undistort
        Whether to remove the lens' distortion; None: if the camera names a surface, for then the pinhole law is meant
        to hold; without one the result is in the pixels as recorded.
    progress
        Called with the share done.

    Raises
    ------
    FlightError
        If the flight has no such camera or too few frames.
    """
    spec, table = _camera(flight, camera, frames)
    straight = spec.surface is not None if undistort is None else undistort
    knows_distance(flight, spec, distance_m)
    estimator = MotionEstimator(spec, frames, method, axis=axis, undistort=straight)
    exposures = table.columns.get("exposure_s", np.full(len(table), np.nan))
    estimates = []
    for k, picture in enumerate(pictures(flight, camera)):
        exposure = float(exposures[k])
        estimate = estimator.push(int(table.t_ns[k]), picture, None if math.isnan(exposure) else exposure)
        if estimate is not None:
            estimates.append(estimate)
        if progress is not None:
            progress((k + 1) / len(table))
    period_s = _periods(table.t_ns, estimates, frames)
    middle = np.array([e.t_ns for e in estimates], dtype=np.int64)
    window_s = np.maximum((frames - 1) * period_s, 0.0)
    truth = true_motion(flight, camera, middle, window_s, period_s, distance_m, axis)
    return MotionRun(flight.name, camera, method, frames, len(table), straight, tuple(estimates), period_s, truth)


def _camera(flight: Flight, camera: str, frames: int) -> tuple[Camera, SensorTable]:
    """Description and table of a camera that has enough pictures."""
    spec = flight.config.sensor.get(camera)
    table = flight.tables.get(camera)
    if not isinstance(spec, Camera) or table is None:
        raise FlightError(
            f"flight {flight.name} has no camera {camera!r}; it has {', '.join(flight.tables) or 'nothing'}"
        )
    if table.is_motion:
        raise FlightError(f"{camera} of flight {flight.name} holds motion measured on board, not pictures")
    if len(table) < frames:
        raise FlightError(f"{camera} of flight {flight.name} holds {len(table)} frames, {frames} are needed")
    return spec, table


def pictures(flight: Flight, camera: str, start: int = 0) -> Iterator[NDArray[np.generic]]:
    """Pictures of a camera in the order of its table from row ``start`` on, from a log, a video or one file each."""
    if camera in flight.frames:
        yield from islice(flight.frames[camera](), start, None)
        return
    folder, table = flight.path / "mav0" / camera, flight.tables[camera]
    videos = sorted(folder.glob("video.*"))
    if videos:
        yield from islice(read_video(videos[0]), start, None)
        return
    for name in table.columns["filename"][start:].tolist():
        yield read_picture(Path(folder / "data" / str(name)))


def _periods(t_ns: NDArray[np.int64], estimates: list[MotionEstimate], frames: int) -> Array:
    """Frame period of every window, from the stamps around its middle [s]."""
    step = np.diff(t_ns) / 1e9
    nominal = float(np.median(step)) if len(step) else math.nan
    if frames == 1:
        return np.full(len(estimates), nominal)
    return np.array([e.window_s / (frames - 1) for e in estimates])
