"""What the image motion alone says of the axial velocity: each reading turned into metres per second.

A reading of pixel motion is linear in the velocity, so its innovation divided by the model's slope, added to the
velocity the filter had just before, is the velocity that the reading asks for.  Distance, attitude and turn rate are
those of the filter; the scale of the image is the calibrated one, so that a scale state that has swallowed somebody
else's error shows as a difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import InnovationLog, Track, Verdict
from axialnav.models.rig import BlurMeter, Camera, Flow
from axialnav.replay.axial import along, axial_frame
from axialnav.replay.motion_truth import rotation_matrices, surface_depth
from axialnav.replay.run import Run

Array = NDArray[np.float64]
Rows = NDArray[np.int64]
ImageSensor = Camera | Flow | BlurMeter
MIN_SHARE = 0.75  # of the axis that must lie in the image plane, squared
MIN_DISTANCE_M = 0.03


@dataclass(frozen=True, slots=True)
class ImageVelocity:
    """Axial velocities of one image sensor.

    ``t_ns`` (n,), ``velocity_m_s`` (n,) along the axis of the corridor section, ``fused`` (n,) whether the filter
    used the reading; the others were refused by the gate.
    """

    sensor: str
    t_ns: NDArray[np.int64]
    velocity_m_s: Array
    fused: NDArray[np.bool_]


def image_velocities(run: Run) -> Iterator[ImageVelocity]:
    """Axial velocity by every image sensor that looks along the corridor; nothing for left-handed surveys."""
    if run.handedness == "left":  # their attitude is not in the frame of their velocity
        return
    for name in run.log.sensors:
        spec = run.config.sensor[name]
        if isinstance(spec, ImageSensor) and spec.surface is not None:
            found = _of_sensor(run, name, spec)
            if found.t_ns.size:
                yield found


def _of_sensor(run: Run, name: str, spec: ImageSensor) -> ImageVelocity:
    log, track = run.log, run.track
    compared = (log.source == log.sensors.index(name)) & (log.dof > 0) & np.isfinite(log.innovation[:, 0])
    rows = np.flatnonzero(compared & np.isin(log.verdict, (Verdict.FUSED, Verdict.GATED)))
    before = np.maximum(np.searchsorted(track.t_ns, log.t_ns[rows], side="right") - 1, 0)
    axis = axial_frame(run.config.corridor, track.position_m[before]).axis
    delta, share = _asked_for(run, spec, rows, before, _windows_s(run, name, log.t_ns[rows]), axis)
    velocity = along(axis, track.velocity_m_s[before]) + delta
    good = np.isfinite(velocity) & (share > MIN_SHARE)
    rows = rows[good]
    return ImageVelocity(name, log.t_ns[rows], velocity[good], log.verdict[rows] == Verdict.FUSED)


def _asked_for(
    run: Run, spec: ImageSensor, rows: Rows, before: Rows, window_s: Array, axis: Array
) -> tuple[Array, Array]:
    """Change of the axial velocity that each reading asks for [m/s], and how much of the axis the image sees."""
    R_WS = rotation_matrices(run.track.quaternion_WB[before]) @ spec.rotation_BS
    distance = wall_distance(run, spec, before)
    delta, share = np.zeros(rows.size), np.zeros(rows.size)
    velocity, scale = run.track.velocity_m_s[before], run.track.blur_scale[before]
    for image_axis in range(2):
        innovation = _signed(run.log, rows, image_axis, spec, run.track, before, R_WS)
        across = R_WS[:, :, image_axis]
        seen = along(axis, across)
        used = np.isfinite(innovation)
        asked = scale * along(velocity, across) - innovation * distance / (spec.focal_px[image_axis] * window_s)
        delta += np.where(used, asked * seen, 0.0)
        share += np.where(used, seen**2, 0.0)
    return delta, share


def _signed(
    log: InnovationLog, rows: Rows, image_axis: int, spec: ImageSensor, track: Track, before: Rows, R_WS: Array
) -> Array:
    """Innovation [px]; that of an unsigned length takes the direction of motion of the filter."""
    innovation: Array = log.innovation[rows, image_axis]
    if isinstance(spec, BlurMeter) and not spec.signed:
        innovation = innovation * -np.sign(along(track.velocity_m_s[before], R_WS[:, :, 0]))
    return innovation


def wall_distance(run: Run, spec: ImageSensor, rows: Rows) -> Array:
    """Distance of the surface along the optical axis at rows of the track [m], NaN where the axis does not meet it."""
    track, surface = run.track, run.config.surface[spec.surface or ""]
    R_WB = rotation_matrices(track.quaternion_WB[rows])
    offset = track.wall_offset_m[rows] if surface.offset_m == "unknown" else float(surface.offset_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = surface_depth(surface, spec, R_WB, track.position_m[rows], offset)
        return np.where(distance > MIN_DISTANCE_M, distance, np.nan)


def _windows_s(run: Run, name: str, t_ns: NDArray[np.int64]) -> Array:
    """Length of the window of each reading [s]; displacements of a camera are per frame period."""
    table = run.flight.tables[name]
    if "window_s" in table.columns:
        window: Array = np.interp(t_ns, table.t_ns, table.columns["window_s"])
        return window
    return np.full(t_ns.size, float(np.median(np.diff(table.t_ns))) * 1e-9)
