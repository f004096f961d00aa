"""Recorded camera frames as readings: pixel motion tables for the kernel, frames one by one for the streaming door."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from axialnav.fusion.camera_feed import rotation_sigma_px
from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.fusion.readings import CameraFrame
from axialnav.models.rig import Camera
from axialnav.replay.flight import Flight, SensorTable


def with_pixel_motion(flight: Flight, config: Config, tables: Mapping[str, SensorTable]) -> dict[str, SensorTable]:
    """Copy of ``tables`` in which cameras that look at a surface carry pixel motion instead of file names.

    Cameras of a recording made on board do already: what was fused in flight was measured there.
    """
    out = dict(tables)
    for name, spec in config.sensor.items():
        used = isinstance(spec, Camera) and spec.surface is not None and name in out and name not in config.disabled
        if used and not out[name].is_motion:
            out[name] = motion_table(flight, name, config)
    return out


def motion_table(flight: Flight, camera: str, config: Config) -> SensorTable:
    """Pixel motion of every window of frames, stamped at its middle; NaN where the images gave nothing to believe.

    Raises
    ------
    FlightError
        A picture is missing or cannot be used, or there are too few.

    Notes
    -----
    The same estimates as :class:`~axialnav.fusion.camera_feed.CameraFeed` makes of the frames in flight.
    """
    from axialnav.estimators.errors import FrameError
    from axialnav.replay.motion import run_motion

    frames = config.camera.frames
    try:
        run = run_motion(flight, camera=camera, method=config.camera.method, frames=frames, undistort=True)
    except FrameError as error:
        raise FlightError(f"flight {flight.name}, {camera}: {error}") from None
    estimates = [e for e in run.estimates if e.t_ns is not None]
    window = np.array([e.window_s / (frames - 1) for e in estimates])
    along, across = (
        np.array([rotation_sigma_px(config, camera, period, axis) for period in window.tolist()]) for axis in range(2)
    )
    return SensorTable(
        t_ns=np.array([e.t_ns for e in estimates], dtype=np.int64),
        columns={
            "window_s": window,
            "dx_px": np.array([e.displacement_px if e.accepted else np.nan for e in estimates]),
            "dy_px": np.array([e.cross_px for e in estimates]),
            "sigma_px": np.hypot([e.sigma_px for e in estimates], along),
            "sigma_dy_px": np.hypot([e.cross_sigma_px for e in estimates], across),
            "coherence_px": np.array([e.coherence_px for e in estimates]),
        },
    )


def camera_frames(flight: Flight, camera: str) -> Iterator[CameraFrame]:
    """Frames of a camera as readings, in the order of the file; each picture is read when it is asked for."""
    from axialnav.replay.motion import pictures

    table = flight.tables[camera]
    exposures = table.columns.get("exposure_s", np.full(len(table), np.nan))
    for t_ns, exposure, picture in zip(table.t_ns.tolist(), exposures.tolist(), pictures(flight, camera), strict=False):
        yield CameraFrame(
            t_ns=t_ns, sensor=camera, image=picture, exposure_s=exposure if np.isfinite(exposure) else None
        )
