"""Everything the filter remembers, as two structured arrays.

Each is one block of memory with named float64 and int64 fields: kernels receive a single pointer, a copy of the arrays
is a snapshot of the filter, and equal arrays mean equal behaviour from there on.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.models.rig import Imu, Uwb
from axialnav.models.state import N_BIASES, N_CORE, N_ERROR, N_NOMINAL

Array = NDArray[np.float64]
Records = NDArray[np.void]
REMEMBERED: Final = 64  # instants
LONG_AGO: Final = np.iinfo(np.int64).min // 4
MAX_ANCHORS: Final = 64
BLOCKS: Final = 16  # length of the supervisor's rings
BLOCK_S: Final = 0.25
SCATTER_START_M: Final = 0.2
COLUMNS: Final = 9  # of a camera's picture that are looked at, an odd number

MEMORY: Final = np.dtype(
    [
        # row 0 is the estimate, row 1 the rival that runs while the accelerometer is in doubt
        ("x", "f8", (2, N_NOMINAL)),
        ("P", "f8", (2, N_ERROR, N_ERROR)),  # without the block below the core: see whole_covariance
        ("imu", "f8", 6),  # last sample, body axes: rate, specific force
        # how it is shaken (kernels.shaking), per axis: fading mean of the specific force, mean square beside that of a
        # second and its highest of late, what they add to the noise of acceleration [m^2/s^3] and bias [m^2/s^5]
        ("force", "f8", 3),
        ("shaking", "f8", 3),
        ("shaken", "f8", 3),
        ("jolt", "f8", 3),
        ("shaken_walk", "f8", 3),
        ("t_imu", "i8"),
        ("t_aid", "i8"),  # last axial aid of any kind
        ("t_flow", "i8"),  # last pixel motion
        ("started", "i8"),
        ("resets", "i8"),
        ("t_reset", "i8"),
        ("last_reset_m", "f8", 3),
        ("imu_fault", "i8"),
        ("on_trial", "i8"),
        ("t_trial", "i8"),
        ("t_failed", "i8"),  # end of the last trial that did not speak for the rival
        ("good_trials", "i8"),
        ("evidence", "f8"),  # log-likelihood of the rival minus that of the estimate
        # integrals of rate and acceleration since the start, and their values at instants of the past
        ("motion", "f8", 6),
        ("kept_motion", "f8", (REMEMBERED, 6)),
        ("kept_t", "i8", REMEMBERED),
        ("kept", "i8"),
        # UWB paths that have a bias state: which, when last heard, stationary variance [m^2]
        ("path", "i8", N_BIASES),
        ("path_heard", "i8", N_BIASES),
        ("path_variance", "f8", N_BIASES),
        ("correction", "f8", 3),  # sum of velocity corrections since the last inertial step [m/s]
        ("correction_variance", "f8", 3),  # and the variance expected of it
        ("correction_rate", "f8", 3),  # their fading mean [m/s^2]
        ("correction_rate_variance", "f8", 3),
        ("margin", "f8", 3),  # share of the accelerometer's variance that is needed, world axes (kernels.margin)
        # the shadow: the vehicle without UWB (kernels.shadow)
        ("shadow_p", "f8", 3),
        ("shadow_v", "f8", 3),
        ("shadow_V", "f8", (3, 3)),
        ("shadow_q", "f8"),  # noise of its acceleration, white [m^2/s^3]
        ("t_shadow", "i8"),  # last pixel motion that corrected it
        ("flow_j", "f8", 3),  # velocity that pixel motion has added to it [m/s]
        ("flow_k", "f8", 3),  # and the way that came of it [m]
        ("block", "i8"),  # number of the current block, and since when
        ("t_block", "i8"),
        ("ring_j", "f8", (BLOCKS, 3)),
        ("ring_k", "f8", (BLOCKS, 3)),
        ("torn", "i8"),  # blocks in a row in which the filter's velocity contradicts the shadow's
        ("t_motion_blamed", "i8"),  # inertia sided with UWB against pixel motion
        ("t_neither", "i8"),  # inertia contradicted pixel motion while UWB did
    ],
    align=True,
)

SOURCE_MEMORY: Final = np.dtype(
    [
        ("t_seen", "i8"),
        ("t_fused", "i8"),
        ("t_trusted", "i8"),  # last time the mean weight was good, or the source came back from silence
        ("gap_s", "f8"),  # mean time between readings
        ("datum_m", "f8"),  # zero of a height sensor
        ("trust", "f8"),  # mean weight
        # the supervisor's (kernels.tracker, kernels.supervise)
        ("state", "i8"),
        ("held", "i8"),  # whether its readings are refused altogether
        ("t_first", "i8"),
        ("t_fit", "i8"),  # last time its place was the filter's
        ("t_since", "i8"),  # beginning of doubt
        ("t_disagree", "i8"),  # last time its way was not clearly that of the others
        ("t_moved", "i8"),  # last time it was clearly another
        ("scatter", "f8"),  # mean absolute deviation of honest readings from their offsets [m]
        ("gap", "f8", 3),  # from the filter's position to its place [m]
        ("reference", "f8", 3),  # of the path that it is compared with, from the shadow's [m]
        ("latest", "f8"),  # expected value of the last reading, and its sigma
        ("latest_sigma", "f8"),
        ("place", "f8", (BLOCKS, 3)),  # ring: where the source is, beside the shadow [m]
        # per anchor, or per axis of a fix
        ("offset", "f8", MAX_ANCHORS),
        ("ring", "f4", (MAX_ANCHORS, BLOCKS)),
        ("t_heard", "i8", MAX_ANCHORS),
        ("value", "f8", MAX_ANCHORS),
        ("power", "f8", MAX_ANCHORS),  # received power and that of the first path, added [dBm]
        ("expected", "f4", MAX_ANCHORS),
        ("outside", "i4", MAX_ANCHORS),  # jumps in a row
        ("repeats", "i4", MAX_ANCHORS),
        ("anchor_bad", "i4", MAX_ANCHORS),
        ("bad_block", "i4", MAX_ANCHORS),
    ],
    align=True,
)

SCRATCH: Final = np.dtype(
    [
        ("z", "f8", 3), ("h", "f8", 3), ("variance", "f8", 3), ("H", "f8", (3, N_ERROR)), ("S", "f8", (3, 3)),
        ("y", "f8", 3), ("PHt", "f8", N_ERROR), ("gain", "f8", N_ERROR), ("step", "f8", N_ERROR), ("R", "f8", (3, 3)),
        ("F", "f8", (9, 3)), ("Q", "f8", N_ERROR), ("ray", "f8", 11), ("p", "f8", 3), ("mean_imu", "f8", 6),
        ("focal_window", "f8", 2), ("row", "f8", 11), ("repeated", "f8"), ("normal", "f8", 3), ("plane", "f8", 2),
        ("x", "f8", N_NOMINAL), ("rate", "f8", 3), ("gained", "f8", 3), ("first", "f8", 6), ("mid", "f8", 6),
        ("last", "f8", 6), ("look", "f8", 3), ("spread", "f8", 3),
        ("q", "f8", 3), ("fix", "f8", 3), ("move", "f8", 3), ("rhs", "f8", 3), ("prior", "f8", 3), ("common", "f8"),
        ("column", "f8", COLUMNS), ("column_H", "f8", (COLUMNS, N_ERROR)), ("weight", "f8", COLUMNS),
        ("would", "f8"), ("refused", "i8"), ("v_before", "f8", 3), ("ways", "f8", (2, MAX_ANCHORS)),
    ],
    align=True,
)  # fmt: skip

# layout of a track row: nominal state, variances of the error state, off-diagonals of position and velocity, rest
TRACK_STATE, TRACK_VARIANCE, TRACK_POS_CROSS = 0, N_NOMINAL, N_NOMINAL + N_ERROR
TRACK_VEL_CROSS, TRACK_FLAGS, TRACK_RESETS = TRACK_POS_CROSS + 3, TRACK_POS_CROSS + 6, TRACK_POS_CROSS + 7
TRACK_STATES: Final = TRACK_POS_CROSS + 8
TRACK_WIDTH: Final = TRACK_POS_CROSS + 9

# layout of a log row
LOG_CODE, LOG_INNOVATION, LOG_VARIANCE, LOG_NIS, LOG_GATE, LOG_WEIGHT, LOG_REASON = 0, 1, 4, 7, 8, 9, 10
LOG_WIDTH: Final = 11


class Memory(NamedTuple):
    """State of the filter between two events: one record of itself, one per source."""

    core: Records  # (1,) of MEMORY
    sources: Records  # (S,) of SOURCE_MEMORY

    def copy(self) -> Memory:
        """Independent snapshot."""
        return Memory(self.core.copy(), self.sources.copy())


def new_memory(n_sources: int) -> Memory:
    """Memory of a filter that has not started."""
    sources = np.zeros(n_sources, SOURCE_MEMORY)
    for stamp in ("t_seen", "t_fused", "t_trusted", "t_first", "t_fit", "t_since", "t_disagree", "t_moved", "t_heard"):
        sources[stamp] = LONG_AGO
    for unknown in ("gap_s", "datum_m", "value", "power", "place", "ring"):
        sources[unknown] = np.nan
    sources["trust"], sources["scatter"] = 1.0, SCATTER_START_M
    core = np.zeros(1, MEMORY)
    core["path"], core["path_heard"] = -1, LONG_AGO
    core["margin"] = 1.0
    for stamp in ("t_failed", "t_shadow", "t_motion_blamed", "t_neither"):
        core[stamp] = LONG_AGO
    return Memory(core, sources)


def whole_covariance(P: Array) -> Array:
    """Copy of a covariance (25, 25) out of the memory, with the block below its core that kernels leave alone."""
    whole = P.copy()
    whole[N_CORE:, :N_CORE] = P[:N_CORE, N_CORE:].T
    return whole


def new_scratch() -> Records:
    """Working space of the kernels, shape (1,); nothing in it survives an event."""
    return np.zeros(1, SCRATCH)


SETTINGS_FIELDS: Final = (
    "gravity_m_s2", "axial_x", "axial_y", "axial_z", "gyro_variance", "gyro_walk", "accel_variance", "accel_walk",
    "accel_white", "least_margin", "margin_blend", "jolt_m_s2", "jolt_time_s", "shaken_m_s2", "shaken_walk",
    "fault_accel_variance", "fault_accel_walk", "blur_scale_walk", "uwb_bias_time_s", "uwb_bias_length_m",
    "wall_offset_walk", "doubt_m_s2", "doubt_sigmas", "doubt_time_s",
    "trial_s", "evidence", "trials_to_clear", "evidence_to_clear", "dead_reckoning_s", "invalid_s",
    "reanchor_aided_s", "reanchor_alone_s",
    "supervised", "timeout_s", "shadow_m_s2", "shadow_alike_s", "kinematic_m", "kinematic_sigmas", "agree_s", "fit_m",
    "anchor_m", "jump_m", "jump_sigmas", "stuck_count", "stuck_m", "nlos_db", "nlos_scale_db",
)  # fmt: skip
SETTINGS: Final = np.dtype([(name, "f8") for name in SETTINGS_FIELDS])


def the_imu(config: Config) -> Imu:
    """Description of the one inertial unit that drives the filter.

    Raises
    ------
    ConfigError
        Not exactly one enabled inertial unit.
    """
    imus = [s for name, s in config.sensor.items() if isinstance(s, Imu) and name not in config.disabled]
    if len(imus) != 1:
        raise ConfigError(f"the filter needs exactly one inertial unit, got {len(imus)}; add or disable [sensor.imuN]")
    return imus[0]


def _bias_time_s(config: Config) -> float:
    """Over which the biases of UWB paths fade [s]: one time for all, that of differences where there are any."""
    measured = {s.measurement for n, s in config.sensor.items() if isinstance(s, Uwb) and n not in config.disabled}
    ranges_alone = "range" in measured and "tdoa" not in measured
    return config.uwb.range_bias_time_s if ranges_alone else config.uwb.bias_time_s


def build_settings(config: Config) -> Records:
    """Translate ``config`` into the kernels' numbers, shape (1,); variances are per second unless named otherwise.

    Raises
    ------
    ConfigError
        Not exactly one enabled inertial unit.
    """
    imu, tune, fault = the_imu(config), config.imu, config.imu_fault
    accel = (imu.accel_noise_density * tune.accel_noise_scale) ** 2
    values: dict[str, Any] = {
        "shadow_alike_s": 0.0,
        "gravity_m_s2": config.gravity_m_s2,
        **dict(zip(("axial_x", "axial_y", "axial_z"), config.axis, strict=True)),
        "gyro_variance": (imu.gyro_noise_density * tune.gyro_noise_scale) ** 2,
        "gyro_walk": (imu.gyro_bias_walk * tune.gyro_walk_scale) ** 2,
        "accel_variance": accel,
        "accel_walk": (imu.accel_bias_walk * tune.accel_walk_scale) ** 2,
        "accel_white": 2.0 * imu.accel_noise_density**2,  # three axes, means of two samples, and a third for luck
        "least_margin": min(1.0, 1.0 / tune.accel_noise_scale**2),
        "margin_blend": fault.doubt_time_s / tune.margin_time_s if tune.margin_time_s > 0.0 else 0.0,
        "jolt_m_s2": tune.jolt_m_s2,
        "jolt_time_s": tune.jolt_time_s,
        "shaken_m_s2": tune.shaken_m_s2,
        "shaken_walk": tune.shaken_walk**2,
        "fault_accel_variance": accel * fault.noise_scale**2,
        "fault_accel_walk": fault.bias_walk**2,
        "blur_scale_walk": config.flow.scale_walk**2,
        "uwb_bias_time_s": _bias_time_s(config),
        "uwb_bias_length_m": config.uwb.bias_length_m,
        "wall_offset_walk": config.range.offset_walk_m**2,
        "doubt_m_s2": fault.doubt_m_s2 if fault.enabled else np.inf,
        "doubt_sigmas": fault.doubt_sigmas,
        "doubt_time_s": fault.doubt_time_s,
        "trial_s": fault.trial_s,
        "evidence": fault.evidence,
        "trials_to_clear": float(fault.trials_to_clear),
        "evidence_to_clear": fault.evidence_to_clear,
        "dead_reckoning_s": config.supervisor.dead_reckoning_s,
        "invalid_s": config.supervisor.invalid_s,
        "reanchor_aided_s": config.supervisor.reanchor_aided_s,
        "reanchor_alone_s": config.supervisor.reanchor_alone_s,
        "supervised": float(config.supervisor.enabled),
        "timeout_s": config.supervisor.timeout_s,
        "shadow_m_s2": config.supervisor.shadow_m_s2,
        "kinematic_m": config.supervisor.kinematic_m,
        "kinematic_sigmas": config.supervisor.kinematic_sigmas,
        "agree_s": config.supervisor.agree_s,
        "fit_m": config.supervisor.fit_m,
        "anchor_m": config.supervisor.anchor_m,
        "jump_m": config.supervisor.jump_m,
        "jump_sigmas": config.supervisor.jump_sigmas,
        "stuck_count": float(config.supervisor.stuck_count),
        "stuck_m": config.supervisor.stuck_m,
        "nlos_db": config.uwb.nlos_db,
        "nlos_scale_db": config.uwb.nlos_scale_db,
    }
    return np.array([tuple(float(values[name]) for name in SETTINGS_FIELDS)], dtype=SETTINGS)
