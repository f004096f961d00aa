"""The streaming estimator: readings in at one door, in any order; the state out at any time."""

from __future__ import annotations

import struct
from collections import Counter

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.camera_feed import CameraFeed
from axialnav.fusion.config import Config
from axialnav.fusion.errors import AxialnavError, ConfigError
from axialnav.fusion.events import Events, half_window_ns, late_ns
from axialnav.fusion.kernels.propagate import propagate_filter
from axialnav.fusion.kernels.run import health
from axialnav.fusion.kernels.update import MIN_WEIGHT
from axialnav.fusion.memory import LOG_WIDTH, Memory, build_settings, new_memory, new_scratch, whole_covariance
from axialnav.fusion.outcome import AxialState, Health, Outcome, Reason, Verdict, verdict_of
from axialnav.fusion.packing import Packer
from axialnav.fusion.readings import BlurLength, CameraFrame, ImuSample, PixelMotion, Reading
from axialnav.fusion.sources import Kind, Records, build_sources, fused_sensors
from axialnav.fusion.stream import HELD, TOO_OLD, CompiledStream, Stream
from axialnav.fusion.supervisor import SourceState
from axialnav.models.state import (
    ACCEL_BIAS,
    BLUR_SCALE,
    E_POS,
    E_VEL,
    GYRO_BIAS,
    POS,
    QUAT,
    UWB_BIAS,
    VEL,
    WALL_OFFSET,
)

Array = NDArray[np.float64]
LOG_ROW = struct.Struct(f"{LOG_WIDTH}d")  # all of a row at once: quicker than its numbers one by one
HELD_S = 60.0  # how long readings wait for a first state
FUSED = (Verdict.FUSED, Reason.NONE)
# by the reason that the supervisor gave; where it gave none, the gate refused
REFUSED = tuple((verdict_of(r), r) for r in (Reason(code or Reason.INNOVATION) for code in range(len(Reason))))


class NotStartedError(AxialnavError):
    """The state was asked for before the filter had seen enough to start."""


class PastStateError(AxialnavError):
    """The state was asked for at a time before the newest inertial sample."""


class CorridorEstimator:
    """Full error-state filter (25 states) behind one door.

    Parameters
    ----------
    config
        Sensors, surfaces, first state and noise; ``Config()`` alone describes no sensors and takes no readings.

    Raises
    ------
    ConfigError
        No or several inertial units, a surface that is not described, or a left-handed survey.

    Notes
    -----
    Until ``start.window_s`` of inertial samples have come, readings are held; then the first state is found and they
    are processed in order.  Without inertial samples that never comes: what has waited for a minute longer than that is
    dropped and counted.  A reading that comes late is fused at its own stamp as long as it is within
    ``delay.buffer_s`` of the newest; its older fellows are counted in :attr:`late` and dropped.
    """

    def __init__(self, config: Config | None = None) -> None:
        self.config = config or Config()
        if self.config.handedness == "left":
            raise ConfigError(
                'handedness = "left" is for replay; on board, mirror the survey: reverse the sign of every y '
                "(anchors, surfaces, corridor) and of the position that comes out"
            )
        self._packer = Packer(self.config)
        self._cameras = CameraFeed(self.config)
        self._late_ns = late_ns(self.config)
        self._sources, self._names = build_sources(self.config), fused_sensors(self.config)
        # a plain list: indexing records would cost more than the filter itself
        self._enabled: list[bool] = self._sources["enabled"].tolist()
        self._settings = self._build_settings()
        self._scratch = new_scratch()
        self._stream = self._build_stream(round(self.config.delay.buffer_s * 1e9))
        self._aligned = False
        self.late: Counter[str] = Counter()

    def push(self, reading: Reading) -> Outcome:
        """Take one reading and say what became of it.

        Raises
        ------
        ReadingError
            The reading does not belong to a configured sensor.
        FrameError
            A camera frame cannot be used.
        FlightError
            The first samples cannot start a filter.
        """
        kind = type(reading)
        if type(reading) is CameraFrame:
            motion = self._cameras.push(reading)
            return self.push(motion) if motion is not None else self._record(reading, Reason.NO_MOTION)
        if self._late_ns and reading.sensor in self._late_ns:
            reading = msgspec.structs.replace(reading, t_ns=reading.t_ns - self._late_ns[reading.sensor])
        source, values = self._packer.pack(reading)
        if not self._enabled[source]:
            return self._record(reading, Reason.DISABLED)
        t_ns = reading.t_ns
        if kind is PixelMotion or kind is BlurLength:
            t_ns += half_window_ns(values[0])
        code = self._stream.push(t_ns, source, values)
        if code == TOO_OLD:
            self.late[reading.sensor] += 1
            return self._record(reading, Reason.TOO_OLD)
        if code == HELD and not self._start():
            self._drop_stale()
            return self._record(reading, Reason.ALIGNING)
        return Outcome(reading.t_ns, reading.sensor) if kind is ImuSample else self._record_update(reading)

    def state(self, t_ns: int | None = None) -> AxialState:
        """State at ``t_ns`` (default: the newest inertial sample), carried forward with the last sample.

        Raises
        ------
        NotStartedError
            The filter has not been aligned yet.
        PastStateError
            ``t_ns`` lies before the newest inertial sample.
        """
        if not self._aligned:
            raise NotStartedError(
                f"no state yet: the filter starts after {self.config.start.window_s:g} s of inertial samples"
            )
        memory = self._stream.ring.memory.copy()
        core = memory.core[0]
        newest = int(core["t_imu"])
        now = newest if t_ns is None else int(t_ns)
        if now < newest:
            raise PastStateError(
                f"the state at t_ns={now} is {(newest - now) * 1e-6:.1f} ms in the past; ask for {newest} or later, "
                f"or keep the states as they come"
            )
        ahead_s = (now - int(core["t_imu"])) * 1e-9
        if ahead_s > 0.0:
            self._scratch["mean_imu"][0] = core["imu"]
            propagate_filter(0, bool(core["imu_fault"]), ahead_s, memory.core[0], self._scratch[0], self._settings[0])
        flags = health(now, self._sources, memory.sources, memory.core[0], self._settings[0])
        return self._axial_state(now, memory, Health(flags))

    def _build_settings(self) -> Records:
        return build_settings(self.config)

    def _build_stream(self, reach_ns: int) -> Stream:
        return CompiledStream(self._sources, self._settings, reach_ns)

    def _start(self) -> bool:
        """Find the first state, anew if the first window has changed, and run all that is held; whether it is found."""
        found = self._align(self._stream.ring.events)
        self._aligned = found is not None
        if found is None:
            self._stream.hold()
            return False
        self._stream.restart(*found)
        return True

    def _drop_stale(self) -> None:
        """Drop what has waited too long for a first state, so that a stream without one does not fill the memory."""
        ring = self._stream.ring
        limit = int(ring.events.t_ns[-1]) - round((HELD_S + self.config.start.window_s) * 1e9)
        if ring.t_ns[0] < limit:
            self.late.update(self._names[source] for source in ring.drop_before(limit).tolist())

    def _align(self, held: Events) -> tuple[Memory, int] | None:
        """First state and end of the first window, once inertial samples span it."""
        window_ns = round(self.config.start.window_s * 1e9)
        if held.t_ns[-1] <= held.t_ns[0] + window_ns:
            return None
        imu = held.t_ns[self._sources["kind"][held.source] == int(Kind.IMU)]
        if not len(imu) or imu[-1] <= imu[0] + window_ns:
            return None
        memory = new_memory(len(self._sources))
        align(self.config, self._sources, held, memory)
        return memory, int(imu[0]) + window_ns

    def _record(self, reading: Reading, reason: Reason) -> Outcome:
        return Outcome(reading.t_ns, reading.sensor, verdict_of(reason), reason)

    def _record_update(self, reading: Reading) -> Outcome:
        row = self._stream.row
        axes, y0, y1, y2, s0, s1, s2, nis, gate, weight, code = LOG_ROW.unpack_from(row)
        if axes < 0:
            return self._record(reading, Reason(-int(axes)))
        verdict, reason = FUSED if weight > MIN_WEIGHT else REFUSED[int(code)]
        # most readings have one axis, for which two slices take longer than the rest of this
        n = int(axes)
        innovation, variance = ((y0,), (s0,)) if n == 1 else ((y0, y1, y2)[:n], (s0, s1, s2)[:n])
        return Outcome(reading.t_ns, reading.sensor, verdict, reason, innovation, variance, nis, gate, weight)

    def _axial_state(self, t_ns: int, memory: Memory, flags: Health) -> AxialState:
        x, P = memory.core["x"][0, 0], whole_covariance(memory.core["P"][0, 0])
        axis = np.array(self.config.axis)
        position, velocity = x[POS : POS + 3].copy(), x[VEL : VEL + 3].copy()
        position_P, velocity_P = P[E_POS : E_POS + 3, E_POS : E_POS + 3], P[E_VEL : E_VEL + 3, E_VEL : E_VEL + 3]
        return AxialState(
            t_ns=t_ns,
            axial_position_m=float(axis @ position),
            axial_velocity_m_s=float(axis @ velocity),
            sigma_axial_position_m=float(np.sqrt(axis @ position_P @ axis)),
            sigma_axial_velocity_m_s=float(np.sqrt(axis @ velocity_P @ axis)),
            position_m=position,
            velocity_m_s=velocity,
            quaternion_WB=x[QUAT : QUAT + 4].copy(),
            gyro_bias_rad_s=x[GYRO_BIAS : GYRO_BIAS + 3].copy(),
            accel_bias_m_s2=x[ACCEL_BIAS : ACCEL_BIAS + 3].copy(),
            blur_scale=float(x[BLUR_SCALE]),
            uwb_bias_m=x[UWB_BIAS:].copy(),
            wall_offset_m=float(x[WALL_OFFSET]),
            covariance=P,
            flags=flags,
            resets=int(memory.core["resets"][0]),
            last_reset_delta_m=memory.core["last_reset_m"][0].copy(),
            source_states=dict(zip(self._names, map(SourceState, memory.sources["state"].tolist()), strict=True)),
        )
