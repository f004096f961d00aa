"""Configuration: typed, strict, with the unit in every name.

A configuration is one TOML file.  Noise and gate settings have defaults that serve every vehicle; ``[sensor.NAME]``,
``[surface.NAME]``, ``[corridor]`` and ``[initial]`` describe this vehicle and this flight and usually come from the
flight folder (:meth:`Config.with_defaults_from`).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.strict_toml import decode, dump, parse, read_text, set_by_path
from axialnav.models.rig import AnySensor, NonNegative, Positive, Surface, Vector3

Probability = Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all configuration tables: frozen and strict."""


class Section(_Table, frozen=True, kw_only=True):
    """One stretch of a corridor between two points [m]."""

    kind: Literal["straight", "stairs", "corner"]
    start: Vector3
    end: Vector3
    width: Positive | None = None
    height: Positive | None = None


class Corridor(_Table, frozen=True, kw_only=True):
    """Where the corridor runs; ``axis`` points the way that is meant by "axial" (any length)."""

    axis: Vector3 = (1.0, 0.0, 0.0)
    section: tuple[Section, ...] = ()

    def __post_init__(self) -> None:
        if not 1e-6 < math.hypot(*self.axis) < 1e6:
            raise ValueError(f"corridor axis must point somewhere, got {self.axis}; the default is (1, 0, 0)")


class Initial(_Table, frozen=True, kw_only=True):
    """First state.

    Absent: level from gravity, standing still; where UWB says and with unknown yaw, or at the origin with yaw 0.
    """

    position_m: Vector3
    velocity_m_s: Vector3 = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    sigma_position_m: Positive = 0.1
    sigma_velocity_m_s: Positive = 0.1
    sigma_yaw_rad: Positive = 0.05


class Gate(_Table, frozen=True, kw_only=True):
    """Acceptance of a reading by its normalised innovation squared.

    ``probability`` is the share of honest readings that pass.  Inside the gate the weight of a reading falls from 1 at
    the centre to 1/4 at ``soft_sigma`` (Geman-McClure).
    """

    probability: Probability = 0.999
    soft_sigma: Positive = 2.0


class ImuTuning(_Table, frozen=True, kw_only=True):
    """How far the inertial unit is trusted beyond its data sheet.

    Vibration and sampling make the noise in flight larger than at rest: ``accel_noise_scale`` and
    ``gyro_noise_scale`` multiply the sensor's densities, ``accel_walk_scale`` and ``gyro_walk_scale`` the walks of its
    biases.  Of the accelerometer's margin as much is used as the aids show to be needed, within about
    ``margin_time_s``; 0 uses all of it.

    Specific force that is farther than ``jolt_m_s2`` from its mean over a tenth of a second is wrong by as much as it
    is farther, alike over ``jolt_time_s``.  Where it strays by more than ``shaken_m_s2`` as a root mean square over a
    second, the accelerometer is doubted for a while and its bias may walk along the axes that stray: ``shaken_walk``
    [s^-3/2] times the stray.
    """

    accel_noise_scale: Positive = 2.0
    gyro_noise_scale: Positive = 1.5
    accel_walk_scale: Positive = 1.0
    gyro_walk_scale: Positive = 1.0
    margin_time_s: NonNegative = 10.0
    jolt_m_s2: Positive = 3.0
    jolt_time_s: NonNegative = 0.15
    shaken_m_s2: Positive = 1.4
    shaken_walk: NonNegative = 0.8


class StartTuning(_Table, frozen=True, kw_only=True):
    """How the first state is found and how far it is trusted.

    Roll, pitch and the gyro bias come from the first ``window_s``; while the vehicle stands still (rates and specific
    force vary by less than ``still_gyro_rad_s`` and ``still_accel_m_s2``) the mean rate is the bias.
    """

    window_s: Positive = 1.0
    still_gyro_rad_s: Positive = 0.03
    still_accel_m_s2: Positive = 0.15
    sigma_tilt_still_rad: Positive = 0.03
    sigma_tilt_moving_rad: Positive = 0.08
    sigma_gyro_bias_rad_s: Positive = 0.01
    sigma_accel_bias_m_s2: Positive = 0.3
    sigma_position_m: Positive = 0.5
    sigma_velocity_m_s: Positive = 0.1
    sigma_yaw_unknown_rad: Positive = 1.8


class ImuFault(_Table, frozen=True, kw_only=True):
    """When the accelerometer stops being believed, and how it is treated then.

    The aids' corrections of velocity are watched.  Where they ask for more than ``doubt_m_s2`` on average over
    ``doubt_time_s``, and for ``doubt_sigmas`` times what noise would ask for, a rival filter with ``noise_scale`` times
    the accelerometer noise and the bias walk ``bias_walk`` [m s^-3 Hz^-1/2] runs beside for ``trial_s`` on the same
    readings; it is given up early when they speak against it.  It takes over when the readings are
    exp(``evidence``) times as likely under it; it hands back after ``trials_to_clear`` trials in a row in which the
    healthy filter explains them nearly as well (less than exp(``evidence_to_clear``) times worse).
    """

    enabled: bool = True
    noise_scale: Positive = 5.0
    bias_walk: Positive = 1.0
    doubt_m_s2: Positive = 0.3
    doubt_sigmas: NonNegative = 4.0
    doubt_time_s: Positive = 0.5
    trial_s: Positive = 2.0
    evidence: Positive = 50.0
    evidence_to_clear: NonNegative = 1.5
    trials_to_clear: Annotated[int, msgspec.Meta(ge=1)] = 5


class UwbTuning(_Table, frozen=True, kw_only=True):
    """Noise of UWB readings.

    A difference errs by white noise of ``sigma_m`` and by the biases of its paths (anchors), of ``bias_sigma_m``, alike
    over ``bias_time_s`` and over ``bias_length_m`` of way.  Two-way ranges need no common clock: their noise is
    ``range_sigma_m`` and ``range_bias_sigma_m``, alike over ``range_bias_time_s`` (which counts where there are no
    differences beside them).  Fixes that a receiver computed itself have ``fix_sigma_m`` and ``fix_bias_sigma_m`` per
    axis: they are as good as its geometry, which we cannot see.

    Where biases are not estimated (0, or more paths than the filter has states), errors of neighbouring readings are
    taken as alike over ``correlation_time_s``: the variance of one that comes every dt is multiplied by
    ``coth(dt / 2 correlation_time_s)``.
    """

    sigma_m: Positive = 0.09
    range_sigma_m: Positive = 0.05
    fix_sigma_m: Positive = 1.0
    bias_sigma_m: NonNegative = 0.14
    range_bias_sigma_m: NonNegative = 0.11
    fix_bias_sigma_m: NonNegative = 0.0
    bias_time_s: Positive = 0.6
    range_bias_time_s: Positive = 0.25
    bias_length_m: Positive = 0.4
    correlation_time_s: NonNegative = 0.014
    nlos_db: float = 6.0
    nlos_scale_db: Positive = 2.5
    gate: Gate = Gate(soft_sigma=2.2)


class FlowTuning(_Table, frozen=True, kw_only=True):
    """Noise of image motion.

    A sensor that states no ``sigma_px`` of its own has ``sigma_rad`` times its focal length.
    """

    sigma_rad: Positive = 0.0043
    scale_sigma: Positive = 0.03
    scale_walk: NonNegative = 1e-4  # s^-1/2
    min_quality: NonNegative = 1.0
    gate: Gate = Gate(soft_sigma=3.0)


class CameraTuning(_Table, frozen=True, kw_only=True):
    """How camera frames become pixel motion: ``frames`` neighbours at a time, by the named method.

    ``scale_sigma`` is how well a calibrated camera's focal length and clock are known; it replaces
    ``flow.scale_sigma`` where cameras are all that sees motion.
    """

    frames: Annotated[int, msgspec.Meta(ge=2, le=32)] = 5
    method: str = "joint"
    scale_sigma: Positive = 0.003


class RangeTuning(_Table, frozen=True, kw_only=True):
    """Noise of wall and floor ranges.

    Where the sensor states none, ``sigma_m`` is the error of a reading, of which ``white_m`` is new with each; the rest
    (offset, tilt, what the beam hits) stays for many readings: it opens the gate and tells nothing of the motion.
    """

    sigma_m: Positive = 0.015
    white_m: Positive = 0.006
    offset_sigma_m: Positive = 1.0
    offset_walk_m: NonNegative = 1e-3  # m s^-1/2
    gate: Gate = Gate(soft_sigma=3.0)


class HeightTuning(_Table, frozen=True, kw_only=True):
    """Noise of barometric height; wide, because indoors air pressure follows doors and propellers, not height.

    Errors are alike over ``correlation_time_s``: many readings within it count as one.
    """

    sigma_m: Positive = 2.0
    correlation_time_s: NonNegative = 10.0
    gate: Gate = Gate()


class AttitudeTuning(_Table, frozen=True, kw_only=True):
    """Noise of the autopilot's attitude.

    It is the output of a filter of its own: errors are alike over ``correlation_time_s``, many readings within it count
    as one.
    """

    sigma_rad: Positive = 0.05
    correlation_time_s: NonNegative = 0.5
    gate: Gate = Gate()


class AxialTuning(_Table, frozen=True, kw_only=True):
    """The axial estimator: how well tilt tells acceleration, and how the vehicle moves across the corridor.

    ``heading_rad`` is the autopilot's yaw when the vehicle looks along the world's x axis; without it the first
    attitude is taken to look where ``[initial]`` says.  The error of the axial acceleration is the tilt's error
    ``sigma_tilt_rad`` times gravity (and the accelerometer's bias, ``start.sigma_accel_bias_m_s2``), alike over
    ``tilt_time_s``; on top comes white noise of ``accel_noise`` (accelerometer) or ``thrust_noise`` (tilt alone: drag
    and climbing are not seen) [m s^-2 Hz^-1/2].  Across the
    corridor the vehicle is expected to move with ``lateral_speed_m_s``, in stretches of ``lateral_time_s``.  An
    accelerometer that differs from the tilt by more than ``doubt_m_s2``, as a mean over two seconds, is flagged and
    not used.
    """

    heading_rad: float | None = None
    sigma_tilt_rad: Positive = 0.012
    tilt_time_s: Positive = 15.0
    sigma_yaw_rad: Positive = 0.05
    accel_noise: Positive = 0.05
    thrust_noise: Positive = 0.5
    lateral_speed_m_s: Positive = 0.5
    lateral_time_s: Positive = 1.0
    doubt_m_s2: Positive = 1.5


class DelayTuning(_Table, frozen=True, kw_only=True):
    """How late a reading may come and still be fused at its own stamp, and stamps that are wrong.

    ``late_s`` names sensors whose stamps are later than the instant they measured, and by how much; what they read is
    taken as of that much earlier.
    """

    buffer_s: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 1.0
    late_s: dict[str, Annotated[float, msgspec.Meta(ge=-10.0, le=10.0)]] = {}


class SupervisorTuning(_Table, frozen=True, kw_only=True):
    """When a source is held suspect, re-anchored or reported silent.

    UWB is compared with a shadow that knows inertia and pixel motion only, whose acceleration is wrong by
    ``shadow_m_s2`` [m s^-2 Hz^-1/2] at least.  Over one and three seconds their ways may differ by ``kinematic_m`` plus
    ``kinematic_sigmas``.  A source is believed again when they have agreed for ``agree_s`` and its place is within
    ``fit_m`` plus two sigma of the filter's; an anchor when its path is within ``anchor_m``.

    A UWB reading farther than ``jump_m`` and ``jump_sigmas`` from what that anchor has been saying is a jump.  A value
    that comes ``stuck_count`` times more while its expectation moves by ``stuck_m`` (UWB) or three sigma (others) is
    stuck.
    """

    enabled: bool = True
    shadow_m_s2: Positive = 0.1
    kinematic_m: Positive = 0.4
    kinematic_sigmas: Positive = 3.0
    agree_s: Positive = 1.5
    fit_m: Positive = 0.5
    anchor_m: Positive = 1.0
    jump_m: Positive = 0.6
    jump_sigmas: Positive = 6.0
    stuck_count: Annotated[int, msgspec.Meta(ge=1)] = 4
    stuck_m: Positive = 0.2
    timeout_s: Positive = 1.0
    dead_reckoning_s: Positive = 1.0
    invalid_s: Positive = 5.0
    reanchor_aided_s: Positive = 15.0
    reanchor_alone_s: Positive = 2.0


class Config(_Table, frozen=True, kw_only=True):
    """Everything the estimator has to be told.  ``Config()`` is the default for every vehicle.

    ``handedness`` tells whether the frame in which anchors and surfaces were surveyed is right-handed.  "auto" decides
    it in replay where the start is unknown (see :mod:`axialnav.fusion.handedness`) and means "right" elsewhere.
    """

    gravity_m_s2: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = 9.80665
    handedness: Literal["auto", "right", "left"] = "auto"
    corridor: Corridor | None = None
    initial: Initial | None = None
    start: StartTuning = StartTuning()
    imu: ImuTuning = ImuTuning()
    imu_fault: ImuFault = ImuFault()
    uwb: UwbTuning = UwbTuning()
    flow: FlowTuning = FlowTuning()
    camera: CameraTuning = CameraTuning()
    range: RangeTuning = RangeTuning()
    height: HeightTuning = HeightTuning()
    attitude: AttitudeTuning = AttitudeTuning()
    axial: AxialTuning = AxialTuning()
    supervisor: SupervisorTuning = SupervisorTuning()
    delay: DelayTuning = DelayTuning()
    disabled: tuple[str, ...] = ()
    surface: dict[str, Surface] = {}
    sensor: dict[str, AnySensor] = {}

    @property
    def axis(self) -> Vector3:
        """Unit vector along which "axial" is meant, corridor frame."""
        x, y, z = (self.corridor or Corridor()).axis
        length = math.hypot(x, y, z)
        return x / length, y / length, z / length

    @classmethod
    def from_dict(cls, data: dict[str, Any], *, where: str = "configuration") -> Config:
        """Build from plain data (nested dicts); raises :class:`ConfigError` naming the nearest key."""
        return decode(data, cls, where=where)

    @classmethod
    def from_toml(cls, path: str | Path) -> Config:
        """Read a TOML file; raises :class:`ConfigError` with one line for a person."""
        text = read_text(Path(path), "configuration")
        return cls.from_dict(parse(text, where=str(path)), where=str(path))

    def to_dict(self) -> dict[str, Any]:
        """Plain nested data; ``Config.from_dict`` of it is equal to ``self``."""
        plain: dict[str, Any] = msgspec.to_builtins(self)
        return plain

    def to_toml(self) -> str:
        """TOML text that reads back to an equal configuration."""
        return dump(self.to_dict())

    def with_params(self, params: dict[str, str]) -> Config:
        """Copy with single values replaced, e.g. ``{"uwb.sigma_m": "0.4"}``; values are TOML text."""
        data = self.to_dict()
        for path, text in params.items():
            set_by_path(data, path, text)
        return self.from_dict(data, where="--param")

    def without(self, names: tuple[str, ...]) -> Config:
        """Copy in which the named sensors are switched off.

        Raises
        ------
        ConfigError
            A name that no sensor has.
        """
        unknown = [name for name in names if name not in self.sensor]
        if unknown:
            raise ConfigError(f"no sensor named {', '.join(unknown)}; there are {', '.join(self.sensor) or 'none'}")
        return msgspec.structs.replace(self, disabled=tuple(sorted({*self.disabled, *names})))

    def with_defaults_from(self, flight: Config) -> Config:
        """Copy with sensors, surfaces, corridor and first state taken from ``flight`` where this has none."""
        return msgspec.structs.replace(
            self,
            gravity_m_s2=self.gravity_m_s2 if self.gravity_m_s2 != Config().gravity_m_s2 else flight.gravity_m_s2,
            corridor=self.corridor or flight.corridor,
            initial=self.initial or flight.initial,
            surface={**flight.surface, **self.surface},
            sensor={**flight.sensor, **self.sensor},
        )
