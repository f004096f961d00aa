"""A run as a Rerun recording: estimate, readings, states and pictures on one timeline, to look at, not to keep.

Needs the extra ``viewer`` (rerun-sdk); nothing else of the package does.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.outcome import Health, Verdict
from axialnav.fusion.supervisor import SourceState
from axialnav.models.rig import Camera
from axialnav.replay.axial import along, axial_frame, sigma_along
from axialnav.replay.report.decimate import scatter_rows
from axialnav.replay.report.sections.position import alignment_of

if TYPE_CHECKING:
    from axialnav.replay.alignment import RigidMotion
    from axialnav.replay.run import Run

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
TIMELINE = "flight"
RECORDING = "recording.rrd"
MAX_POSES, MAX_SAMPLES, MAX_PICTURES = 6000, 30_000, 300
SIGMAS = 3.0


def rerun_module() -> Any:
    """The package rerun.

    Raises
    ------
    ConfigError
        It is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise ConfigError("--viewer needs rerun-sdk, which is not installed: pip install 'axialnav[viewer]'") from None
    return rerun


def write_recording(run: Run, path: Path) -> Path:
    """Write the recording and return its path; long series are thinned, of pictures at most 300 are kept.

    Raises
    ------
    ConfigError
        rerun-sdk is not installed, or the file cannot be written.
    """
    rr = rerun_module()
    stream = rr.RecordingStream("axialnav", recording_id=run.metrics["digest"][:16])
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        stream.save(path, default_blueprint=_blueprint(run))
    except (OSError, RuntimeError) as error:
        raise ConfigError(f"--viewer: {path} cannot be written: {error}") from None
    _Recording(rr, stream, run).write()
    stream.disconnect()
    return path


class _Recording:
    """Sends the parts of one run to a stream; times are seconds after the first IMU sample."""

    def __init__(self, rr: Any, stream: Any, run: Run) -> None:
        self._rr, self._stream, self._run = rr, stream, run

    def write(self) -> None:
        """Write the whole run."""
        motion = alignment_of(self._run)
        self._path(motion)
        self._velocity(motion)
        self._innovations()
        self._states()
        self._events()
        self._pictures()

    def _send(self, entity: str, t_ns: Ints, columns: Any) -> None:
        seconds = (t_ns - self._run.track.t_ns[0]) * 1e-9
        self._stream.send_columns(entity, [self._rr.TimeColumn(TIMELINE, duration=seconds)], columns)

    def _path(self, motion: RigidMotion) -> None:
        rr, track, truth = self._rr, self._run.track, self._run.flight.truth
        rows = _every(len(track.t_ns), MAX_POSES)
        place, turn = motion.points(track.position_m[rows]), track.quaternion_WB[rows][:, [1, 2, 3, 0]]
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._stream.log("world/fused", rr.LineStrips3D([place], colors=[(59, 130, 214)]), static=True)
        self._stream.log("world/vehicle", rr.TransformAxes3D(0.5), static=True)
        self._send("world/vehicle", track.t_ns[rows], rr.Transform3D.columns(translation=place, quaternion=turn))
        if truth is not None:
            kept = truth.position_m[_every(len(truth.t_ns), MAX_POSES)]
            self._stream.log("world/truth", rr.LineStrips3D([kept], colors=[(224, 133, 27)]), static=True)

    def _velocity(self, motion: RigidMotion) -> None:
        run, track, truth = self._run, self._run.track, self._run.flight.truth
        rows = _every(len(track.t_ns), MAX_SAMPLES)
        axis = axial_frame(run.config.corridor, motion.points(track.position_m[rows])).axis
        fused = along(axis, motion.vectors(track.velocity_m_s[rows]))
        sigma = sigma_along(axis, motion.covariances(track.velocity_covariance[rows]))
        series = {"fused": fused, "3_sigma_above": fused + SIGMAS * sigma, "3_sigma_below": fused - SIGMAS * sigma}
        for name, values in series.items():
            self._scalars(f"axial_velocity/{name}", track.t_ns[rows], values)
        if truth is not None:
            rows = _every(len(truth.t_ns), MAX_SAMPLES)
            axis = axial_frame(run.config.corridor, truth.position_m[rows]).axis
            self._scalars("axial_velocity/truth", truth.t_ns[rows], along(axis, truth.velocity_m_s[rows]))

    def _innovations(self) -> None:
        """First axis of each innovation in predicted sigmas, as points, with the verdict in the name."""
        log = self._run.log
        with np.errstate(invalid="ignore", divide="ignore"):
            scaled = log.innovation[:, 0] / np.sqrt(log.variance[:, 0])
        for source, sensor in enumerate(log.sensors):
            for verdict in (Verdict.FUSED, Verdict.GATED):
                rows = np.flatnonzero((log.source == source) & (log.verdict == verdict) & np.isfinite(scaled))
                rows = rows[scatter_rows(scaled[rows], MAX_SAMPLES)]
                if rows.size:
                    entity = f"innovations/{sensor}/{verdict.name.lower()}"
                    self._stream.log(entity, self._rr.SeriesPoints(), static=True)
                    self._scalars(entity, log.t_ns[rows], scaled[rows])

    def _scalars(self, entity: str, t_ns: Ints, values: Array) -> None:
        good = np.isfinite(values)
        self._send(entity, t_ns[good], self._rr.Scalars.columns(scalars=values[good]))

    def _states(self) -> None:
        """What the supervisor makes of each source, where it changes."""
        track = self._run.track
        for source in range(track.source_states.shape[1]):
            states = track.source_states[:, source]
            rows = np.concatenate(([0], np.flatnonzero(np.diff(states)) + 1))
            names = [SourceState(state).name.lower() for state in states[rows].tolist()]
            entity = f"supervisor/{self._run.log.sensors[source]}"
            self._send(entity, track.t_ns[rows], self._rr.StateChange.columns(state=names))

    def _events(self) -> None:
        """Conditions of the estimate, and position resets, as lines of text."""
        track = self._run.track
        lines = [(int(track.t_ns[row]), text) for row, text in _conditions(track.flags)]
        lines += [(int(track.t_ns[row + 1]), "position reset") for row in np.flatnonzero(np.diff(track.resets) > 0)]
        if lines:
            t_ns, texts = zip(*sorted(lines), strict=True)
            self._send("events", np.array(t_ns), self._rr.TextLog.columns(text=list(texts)))

    def _pictures(self) -> None:
        from axialnav.replay.frames import camera_frames

        flight = self._run.flight
        for name, spec in self._run.config.sensor.items():
            table = flight.tables.get(name)
            if not (isinstance(spec, Camera) and spec.surface is not None) or table is None or table.is_motion:
                continue
            step = max(1, -(-len(table) // MAX_PICTURES))
            for number, frame in enumerate(camera_frames(flight, name)):
                if number % step == 0:
                    seconds = (frame.t_ns - int(self._run.track.t_ns[0])) * 1e-9
                    self._stream.set_time(TIMELINE, duration=seconds)
                    picture = self._rr.Image(np.asarray(frame.image), color_model="L")
                    self._stream.log(f"camera/{name}", picture.compress(jpeg_quality=85))


def _conditions(flags: Ints) -> Iterator[tuple[int, str]]:
    """Row and words wherever a condition begins or ends."""
    for flag in Health:
        if flag:
            hit = np.concatenate(([False], (flags & int(flag)) != 0))
            for row in np.flatnonzero(np.diff(hit)).tolist():
                yield row, f"{str(flag.name).replace('_', ' ').lower()} {'begins' if hit[row + 1] else 'ends'}"


def _every(count: int, most: int) -> Ints:
    """Evenly spaced rows, at most so many."""
    return np.arange(0, count, max(1, -(-count // most)))


def _blueprint(run: Run) -> Any:
    """What the viewer shows at first: velocity, innovations and states over time, beside the path and the pictures."""
    import rerun.blueprint as rrb

    over_time = [
        rrb.TimeSeriesView(origin="axial_velocity", name="axial velocity [m/s]"),
        rrb.TimeSeriesView(origin="innovations", name="innovations [predicted sigma]"),
        rrb.StateTimelineView(origin="supervisor", name="supervisor"),
    ]
    beside = [rrb.Spatial3DView(origin="world", name="path")]
    cameras = [
        name for name, spec in run.config.sensor.items() if isinstance(spec, Camera) and spec.surface is not None
    ]
    beside += [rrb.Spatial2DView(origin=f"camera/{name}", name=name) for name in cameras]
    beside.append(rrb.TextLogView(origin="events", name="events"))
    layout = rrb.Horizontal(rrb.Vertical(*over_time), rrb.Vertical(*beside), column_shares=[3, 2])
    return rrb.Blueprint(layout, rrb.TimePanel(state="collapsed"))
