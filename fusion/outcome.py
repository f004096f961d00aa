"""What the filter says: a verdict with a reason for every reading, and the state with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.supervisor import SourceState

Array = NDArray[np.float64]


class Verdict(IntEnum):
    """What happened to a reading."""

    FUSED = 0
    GATED = 1
    LATE = 2
    BLIND = 3
    SUSPECT = 4
    INVALID = 5


class Reason(IntEnum):
    """Why it happened; members are sentences in :data:`REASONS`."""

    NONE = 0
    INNOVATION = 1
    OUT_OF_RANGE = 2
    TOO_OLD = 3
    WEAK_SIGNAL = 4
    NO_GEOMETRY = 5
    SIGN_UNCERTAIN = 6
    TOO_SHORT = 7
    SUPERVISOR = 8
    NOT_ALIGNED = 9
    UNKNOWN_ANCHOR = 10
    ALIGNING = 11
    DISABLED = 12
    NO_MOTION = 13
    NOT_FINITE = 14
    JUMP = 15
    STUCK = 16
    COPY = 17


REASONS: dict[Reason, str] = {
    Reason.NONE: "fused with the filter",
    Reason.INNOVATION: "the innovation is outside the gate",
    Reason.OUT_OF_RANGE: "the value is outside the sensor's range",
    Reason.TOO_OLD: "the stamp is older than the filter can reach back",
    Reason.WEAK_SIGNAL: "the sensor reports a quality below the limit",
    Reason.NO_GEOMETRY: "the beam or optical axis does not meet the surface from here",
    Reason.SIGN_UNCERTAIN: "an unsigned length while the direction of motion is not known",
    Reason.TOO_SHORT: "the blur is too short to inform",
    Reason.SUPERVISOR: "the supervisor holds the source suspect",
    Reason.NOT_ALIGNED: "the filter has no attitude yet",
    Reason.UNKNOWN_ANCHOR: "the anchor is not in the sensor's list",
    Reason.ALIGNING: "held until the first state is known, then processed",
    Reason.DISABLED: "the source is switched off",
    Reason.NOT_FINITE: "the value, or what the filter expects of it, is not a finite number",
    Reason.JUMP: "the value jumps away from what its anchor has been saying",
    Reason.STUCK: "the value stands still while the vehicle moves",
    Reason.COPY: "the receiver sent its last reading of this anchor once more",
    Reason.NO_MOTION: "the frames so far give no displacement that can be believed",
}


class Health(IntFlag):
    """Condition of the estimate, one bit each; the ``flags`` column of ``fused.csv``."""

    GOOD = 0
    ALIGNING = 1
    DEAD_RECKONING = 2
    VELOCITY_INVALID = 4
    ACCELEROMETER_FAULT = 8
    UWB_SUSPECT = 16
    POSITION_RESET = 32
    SOURCE_TIMEOUT = 64
    MOTION_SUSPECT = 128
    DISAGREE = 256


class Outcome(msgspec.Struct, frozen=True, gc=False):
    """Record of one reading.

    Attributes
    ----------
    t_ns
        Stamp of the reading.
    sensor
        Name of the source.
    verdict, reason
        What happened and why.
    innovation, variance
        Reading minus prediction and its predicted variance S, per axis, in the sensor's own unit.
    nis
        Normalised innovation squared of all axes together.
    gate
        Threshold on ``nis`` at the configured probability.
    weight
        1 for a full update, towards 0 where the redescending weight has taken effect.
    """

    t_ns: int
    sensor: str
    verdict: Verdict = Verdict.FUSED
    reason: Reason = Reason.NONE
    innovation: tuple[float, ...] = ()
    variance: tuple[float, ...] = ()
    nis: float = float("nan")
    gate: float = float("nan")
    weight: float = 0.0


@dataclass(frozen=True, slots=True)
class AxialState:
    """The estimate at one instant, corridor frame W (x axial, z up), SI units.

    ``uwb_bias_m`` (8,) are the biases of the UWB paths that have a state, 0 where none is;
    ``velocity_covariance`` is 3x3; ``resets`` counts position re-anchorings and ``last_reset_delta_m`` is the jump of
    the latest one.  ``source_states`` tells by name what the supervisor makes of each fused sensor.
    """

    t_ns: int
    axial_position_m: float
    axial_velocity_m_s: float
    sigma_axial_position_m: float
    sigma_axial_velocity_m_s: float
    position_m: Array
    velocity_m_s: Array
    quaternion_WB: Array
    gyro_bias_rad_s: Array
    accel_bias_m_s2: Array
    blur_scale: float
    uwb_bias_m: Array
    wall_offset_m: float
    covariance: Array
    flags: Health
    resets: int
    last_reset_delta_m: Array
    source_states: Mapping[str, SourceState] = field(default_factory=dict)

    @property
    def velocity_valid(self) -> bool:
        """Whether the velocity may be used for control."""
        return not self.flags & (Health.VELOCITY_INVALID | Health.ALIGNING)

    @property
    def dead_reckoning(self) -> bool:
        """Whether no axial aid has been fused for longer than the limit."""
        return bool(self.flags & Health.DEAD_RECKONING)


@dataclass(frozen=True, slots=True)
class Track:
    """The estimate at every IMU sample; arrays over n samples, corridor frame, SI units.

    ``position_covariance`` and ``velocity_covariance`` are (n, 3, 3), ``quaternion_WB`` (n, 4) scalar first,
    ``uwb_bias_m`` (n, 8), ``sigma_error`` (n, 25) the standard deviation of every error state in the order of
    :mod:`axialnav.models.state`, ``flags`` (n,) of :class:`Health`, ``resets`` (n,) running count,
    ``source_states`` (n, S) of :class:`~axialnav.fusion.supervisor.SourceState`, one column per fused sensor.
    """

    t_ns: NDArray[np.int64]
    position_m: Array
    velocity_m_s: Array
    quaternion_WB: Array
    gyro_bias_rad_s: Array
    accel_bias_m_s2: Array
    blur_scale: Array
    uwb_bias_m: Array
    wall_offset_m: Array
    position_covariance: Array
    velocity_covariance: Array
    sigma_error: Array
    flags: NDArray[np.int64]
    resets: NDArray[np.int64]
    source_states: NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class InnovationLog:
    """One row per reading that is not an IMU sample, in the order of processing.

    ``source`` indexes ``sensors``; ``dof`` is the number of axes used; ``innovation`` and ``variance`` are (n, 3) with
    NaN beyond ``dof``; ``verdict`` and ``reason`` hold the enums' values.
    """

    sensors: tuple[str, ...]
    t_ns: NDArray[np.int64]
    source: NDArray[np.int64]
    verdict: NDArray[np.int64]
    reason: NDArray[np.int64]
    dof: NDArray[np.int64]
    innovation: Array
    variance: Array
    nis: Array
    gate: Array
    weight: Array


BLIND = frozenset(
    {Reason.NO_GEOMETRY, Reason.SIGN_UNCERTAIN, Reason.TOO_SHORT, Reason.ALIGNING, Reason.NO_MOTION, Reason.COPY}
)


def verdict_of(reason: Reason) -> Verdict:
    """Verdict that goes with a reason."""
    if reason is Reason.NONE:
        return Verdict.FUSED
    if reason in {Reason.INNOVATION, Reason.JUMP, Reason.STUCK}:
        return Verdict.GATED
    if reason is Reason.TOO_OLD:
        return Verdict.LATE
    if reason in BLIND:
        return Verdict.BLIND
    if reason is Reason.SUPERVISOR:
        return Verdict.SUSPECT
    return Verdict.INVALID
