r"""The axial estimator: four states along the corridor, for logs with the autopilot's attitude but without raw IMU.

Axial position s, velocity v, acceleration bias b and blur scale k follow

.. math::
    \dot s = v, \qquad \dot v = a - b + w_a, \qquad \dot b = -b / \tau + w_b, \qquad \dot k = w_k

on filterpy's ExtendedKalmanFilter.  The acceleration a along the axis comes from the accelerometer turned by the
attitude, or, where there are no inertial samples, from the attitude alone: a vehicle that neither climbs nor sinks
accelerates with :math:`g\,(n \cdot R e_z) / (e_z \cdot R e_z)` along the horizontal n.  b stands for gravity leaking
in through a wrong tilt.  What is across the axis is held (:mod:`axialnav.fusion.axial_held`).
"""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import Level, initial_from_uwb
from axialnav.fusion.axial_held import Held
from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.events import Events
from axialnav.fusion.kernels.measure import measure
from axialnav.fusion.kernels.propagate import rotate_sample
from axialnav.fusion.kernels.run import conclude, receive
from axialnav.fusion.kernels.shadow import carry_shadow, note_velocity
from axialnav.fusion.kernels.shaking import note_shaking
from axialnav.fusion.kernels.supervise import end_block
from axialnav.fusion.kernels.update import MIN_WEIGHT, redescend
from axialnav.fusion.kernels.window import note_motion
from axialnav.fusion.memory import (
    LOG_CODE,
    LOG_GATE,
    LOG_INNOVATION,
    LOG_NIS,
    LOG_REASON,
    LOG_VARIANCE,
    LOG_WEIGHT,
    Memory,
    Records,
    build_settings,
    new_memory,
    new_scratch,
    whole_covariance,
)
from axialnav.fusion.outcome import Reason
from axialnav.fusion.sources import Kind, build_sources
from axialnav.models.imu import strapdown
from axialnav.models.rig import AttitudeSource, Imu
from axialnav.models.rotations import quaternion_from_euler, rotation_matrix
from axialnav.models.state import ACCEL_BIAS, E_POS, GYRO_BIAS, POS, QUAT, VEL
from axialnav.models.tangent import rotation_between

Array = NDArray[np.float64]
DOUBT_TIME_S = 2.0
DRAG_S = 1.0  # drag and climbs, which tilt does not see, last for so long
RELIEF = 0.5  # an accelerometer in doubt is believed again below this share of the limit
MAX_TILT_COSINE = 0.2  # steeper than 78 degrees, tilt says nothing of the acceleration


class AxialFilter:
    """The filter itself, one event at a time, on the memory of the 25-state filter.

    Parameters
    ----------
    config
        As for the corridor estimator; at least one attitude source is needed, inertial units are optional.

    Raises
    ------
    ConfigError
        No attitude source, or several inertial units.
    """

    def __init__(self, config: Config) -> None:
        from filterpy.kalman import ExtendedKalmanFilter  # brings scipy.stats: half a second that others can spare

        self.config = config
        self.sources = build_sources(config)
        self.settings = axial_settings(config)
        self.held = Held.from_config(config)
        self.driver = _driver(config)
        self._ekf: Any = ExtendedKalmanFilter(dim_x=4, dim_z=1)
        self._scratch = new_scratch()
        leak = config.gravity_m_s2 * config.axial.sigma_tilt_rad
        felt = config.start.sigma_accel_bias_m_s2 if self.driver is Kind.IMU else 0.0
        self._bias_variance = leak**2 + felt**2
        self._heading_rad = 0.0
        self._row, self._F, self._R = np.empty(6), np.empty((9, 3)), np.empty((3, 3))

    def span_s(self, events: Events) -> float | None:
        """How long the samples that drive the filter last [s]; None where it cannot start yet: no attitude."""
        kinds = self.sources["kind"][events.source]
        drivers = events.t_ns[kinds == int(self.driver)]
        if not len(drivers) or not (kinds == int(Kind.ATTITUDE)).any():
            return None
        return float(drivers[-1] - drivers[0]) * 1e-9

    def start(self, events: Events) -> Memory:
        """First state from the events of the first ``start.window_s``.

        Raises
        ------
        FlightError
            Nothing that drives the filter, or no attitude.
        """
        kinds = self.sources["kind"][events.source]
        drivers, attitudes = kinds == int(self.driver), kinds == int(Kind.ATTITUDE)
        if not (drivers.any() and attitudes.any()):
            raise FlightError("the axial estimator needs the autopilot's attitude; there is no usable row of it")
        t0 = int(events.t_ns[drivers][0])
        window = events.t_ns <= t0 + round(self.config.start.window_s * 1e9)
        roll, pitch, yaw = events.values[attitudes][0, :3]
        level = Level(roll, -pitch, np.zeros(3), 0.0)
        initial = self.config.initial or initial_from_uwb(self.config, self.sources, events, window, level)
        given = self.config.axial.heading_rad
        self._heading_rad = initial.yaw_rad + yaw if given is None else given
        memory = new_memory(len(self.sources))
        memory.core["path_heard"] = np.iinfo(np.int64).max  # no place for biases of UWB paths among four states
        core = memory.core[0]
        x = core["x"][0]
        x[POS : POS + 3], x[VEL : VEL + 3] = initial.position_m, initial.velocity_m_s
        x[QUAT : QUAT + 4] = self._attitude(roll, pitch, yaw)
        tune, held = self.config, self.held
        bias = self._bias_variance
        axial = [initial.sigma_position_m**2, initial.sigma_velocity_m_s**2, bias, tune.flow.scale_sigma**2]
        core["P"][0] = held.first(initial.sigma_position_m**2, tune.range.offset_sigma_m**2)
        core["P"][0] += held.E @ np.diag(axial) @ held.E.T
        core["t_aid"] = core["t_flow"] = t0
        memory.sources["t_trusted"] = t0
        return memory

    def step(self, t_ns: int, source: int, values: Array, memory: Memory, log: Array) -> None:
        """Process one event; ``log`` (11,) receives its record in the layout of :mod:`axialnav.fusion.memory`."""
        core, kind = memory.core[0], int(self.sources["kind"][source])
        log[:] = 0.0
        if kind == int(self.driver) or (kind == int(Kind.ATTITUDE) and core["started"]):
            note_velocity(core, self._scratch[0])
            dt = self._drive(t_ns, source, values, core, kind == int(self.driver))
            if kind == int(self.driver):
                self._supervise(t_ns, dt, memory)
            log[LOG_NIS], log[LOG_GATE], log[LOG_WEIGHT] = math.nan, math.nan, 1.0
            memory.sources[source]["t_seen"] = memory.sources[source]["t_fused"] = t_ns
        elif not core["started"]:
            log[LOG_CODE] = -int(Reason.NOT_ALIGNED)
        elif kind != int(Kind.IMU):
            self._aid(t_ns, source, values, memory, log)

    def coast(self, memory: Memory, ahead_s: float) -> None:
        """Carry the state forward with the last sample."""
        core = memory.core[0]
        if self.driver is Kind.IMU:
            self._inertial(core, core["imu"], ahead_s)
        else:
            self._predict(core, ahead_s, self._tilt_acceleration(core["x"][0]), self.config.axial.thrust_noise)

    def _attitude(self, roll: float, pitch: float, yaw: float) -> Array:
        """Body-to-world quaternion of the autopilot's angles (FRD to NED): pitch and yaw turn the other way in FLU."""
        return quaternion_from_euler(roll, -pitch, self._heading_rad - yaw)

    def _drive(self, t_ns: int, source: int, values: Array, core: Any, drives: bool) -> float:
        """A sample that moves the filter on, or an attitude beside inertial samples; the time it was moved by [s]."""
        x, dt = core["x"][0], (t_ns - int(core["t_imu"])) * 1e-9
        first = not core["started"]
        if drives and (first or dt > 0.0):
            core["started"], core["t_imu"] = 1, t_ns
        step_s = 0.0 if first or not drives else max(dt, 0.0)
        if int(self.sources["kind"][source]) == int(Kind.IMU):
            rotate_sample(values, self.sources["R_BS"][source], self._row)
            mean = 0.5 * (core["imu"] + self._row)
            if step_s > 0.0:
                self._inertial(core, mean, dt)
            if first:
                core["force"] = self._row[3:]
            if first or dt > 0.0:
                core["imu"] = self._row
            return step_s
        before = x[QUAT : QUAT + 4].copy()
        x[QUAT : QUAT + 4] = self._attitude(values[0], values[1], values[2])
        if step_s > 0.0:
            turn = np.empty(3)
            rotation_between(before, x[QUAT : QUAT + 4], turn)
            core["imu"][:3] = turn / dt
            self._predict(core, dt, self._tilt_acceleration(x), self.config.axial.thrust_noise)
        return step_s

    def _supervise(self, t_ns: int, dt: float, memory: Memory) -> None:
        """Shadow and supervisor after a step: those of the 25-state filter."""
        core, w = memory.core[0], self._scratch[0]
        if dt > 0.0:
            self.held.drift_shadow(core["x"][0], core["shadow_v"], core["shadow_V"], w["v_before"], dt)
        carry_shadow(t_ns, dt, core, w)
        if dt > 0.0:
            resets = int(core["resets"])
            end_block(t_ns, self.sources, memory.sources, core, w, self.settings[0])
            core["P"][0] = whole_covariance(core["P"][0])
            if core["resets"] > resets:
                self._part_position(core)

    def _inertial(self, core: Any, sample: Array, dt: float) -> None:
        """Predict with rate and specific force (6,) in body axes."""
        x = core["x"][0]
        moved = x.copy()
        moved[VEL : VEL + 3] = moved[GYRO_BIAS : GYRO_BIAS + 3] = moved[ACCEL_BIAS : ACCEL_BIAS + 3] = 0.0
        strapdown(moved, sample[:3], sample[3:], dt, self.config.gravity_m_s2, self._R, self._F)
        x[QUAT : QUAT + 4] = moved[QUAT : QUAT + 4]
        felt, seen = float(self.held.axis @ moved[VEL : VEL + 3]) / dt, self._tilt_acceleration(x)
        note_shaking(dt, sample[3:], self._scratch[0]["y"], core, self.settings[0])
        if self._is_ill(core, felt - seen, dt):
            self._predict(core, dt, seen, self.config.axial.thrust_noise)
        else:
            self._predict(core, dt, felt, math.hypot(self.config.axial.accel_noise, math.sqrt(core["jolt"].sum())))

    def _is_ill(self, core: Any, difference: float, dt: float) -> bool:
        """Whether the accelerometer contradicts the tilt for longer than drag or a climb could explain."""
        fault = self.config.imu_fault
        mean = core["correction_rate"]
        mean[0] += min(dt / DOUBT_TIME_S, 1.0) * (difference - mean[0])
        limit = self.config.axial.doubt_m_s2 * (RELIEF if core["imu_fault"] else 1.0)
        core["imu_fault"] = int(fault.enabled and abs(float(mean[0])) > limit)
        return bool(core["imu_fault"])

    def _tilt_acceleration(self, x: Array) -> float:
        up = rotation_matrix(x[QUAT : QUAT + 4])[:, 2]
        return float(self.config.gravity_m_s2 * (self.held.axis[:2] @ up[:2]) / max(up[2], MAX_TILT_COSINE))

    def _predict(self, core: Any, dt: float, accel_m_s2: float, noise: float) -> None:
        """All states over ``dt``, the four of them by filterpy."""
        x, tune, ekf = core["x"][0], self.config.axial, self._ekf
        note_motion(int(core["t_imu"]), core["imu"][:3], dt, accel_m_s2 * dt * self.held.axis, core)
        ekf.x = self.held.states(x)
        ekf.P, S = self.held.split(core["P"][0])
        keep = math.exp(-dt / tune.tilt_time_s)
        ekf.F = np.array([[1, dt, -0.5 * dt * dt, 0], [0, 1, -dt, 0], [0, 0, keep, 0], [0, 0, 0, 1]])
        ekf.B = np.array([0.5 * dt * dt, dt, 0.0, 0.0])
        bias = self._bias_variance * (1.0 - keep * keep)
        q = noise * noise
        ekf.Q = np.diag([q * dt**3 / 3, q * dt, bias, self.config.flow.scale_walk**2 * dt])
        ekf.Q[0, 1] = ekf.Q[1, 0] = q * dt * dt / 2
        ekf.predict(u=accel_m_s2)
        S = self.held.drift(x, S, dt)
        self._put(core, S)

    def _put(self, core: Any, S: Array) -> None:
        """Store filterpy's states beside the held covariance."""
        self.held.put_states(core["x"][0], self._ekf.x)
        core["P"][0] = S + self.held.E @ self._ekf.P @ self.held.E.T

    def _aid(self, t_ns: int, source: int, values: Array, memory: Memory, log: Array) -> None:
        """One reading: what the supervisor says, gate, update, what it learns; as in the 25-state filter."""
        core, s, seen, w = memory.core[0], self.sources[source], memory.sources[source], self._scratch[0]
        gap_s = receive(t_ns, s, seen, values, core, w, self.settings[0])
        x = core["x"][0]
        w["p"] = x[POS : POS + 3] + (t_ns - int(core["t_imu"])) * 1e-9 * x[VEL : VEL + 3]
        w["R"] = rotation_matrix(x[QUAT : QUAT + 4])
        axes = measure(t_ns, s, seen, values, x, core["P"][0], core, w, self.settings[0])
        w["row"], w["would"] = 0.0, 0.0
        w["row"][LOG_CODE] = axes
        if axes > 0:
            self._fuse(axes, s, core, w)
        log[:] = w["row"]
        conclude(t_ns, gap_s, s, seen, core, w)

    def _fuse(self, axes: int, s: Any, core: Any, w: Any) -> None:
        """Gate a reading and correct both parts of the state with it; its record goes to ``w.row``."""
        P, H, row = core["P"][0], w["H"][:axes].copy(), w["row"]
        y, variance = (w["z"] - w["h"])[:axes], w["variance"][:axes]
        S = H @ P @ H.T + np.diag(variance)
        nis = float(y @ np.linalg.solve(S, y)) if np.isfinite(S).all() else math.nan
        if not math.isfinite(nis):
            row[LOG_CODE] = -int(Reason.NOT_FINITE)
            return
        gate = float(s["gate"][axes - 1])
        w["would"] = redescend(nis / axes, float(s["soft_nis"])) if nis <= gate else 0.0
        weight = 0.0 if w["refused"] else float(w["would"])
        row[LOG_INNOVATION : LOG_INNOVATION + axes], row[LOG_VARIANCE : LOG_VARIANCE + axes] = y, np.diag(S)
        row[LOG_NIS], row[LOG_GATE], row[LOG_WEIGHT], row[LOG_REASON] = nis, gate, weight, w["refused"]
        if weight > MIN_WEIGHT:
            self._correct(H, y, np.diag(variance * float(w["repeated"]) / weight), core, w)

    def _correct(self, H: Array, y: Array, R: Array, core: Any, w: Any) -> None:
        """Update the four states by filterpy, and what is held by its own rule."""
        x, ekf, axes = core["x"][0], self._ekf, len(y)
        ekf.x = self.held.states(x)
        ekf.P, held = self.held.split(core["P"][0])
        H4 = H @ self.held.E
        held_after = self.held.correct(x, held, H, y, R + H4 @ ekf.P @ H4.T)
        z, h = w["z"][:axes].copy(), w["h"][:axes].copy()
        ekf.update(z, lambda _: H4, lambda _: h, R=R + H @ held @ H.T)
        self._put(core, held_after)

    def _part_position(self, core: Any) -> None:
        """Part a position that was moved along and across again."""
        across, along, P = self.held.across, np.outer(self.held.axis, self.held.axis), core["P"][0]
        block = P[E_POS : E_POS + 3, E_POS : E_POS + 3]
        block[:] = along * (self.held.axis @ block @ self.held.axis) + across @ block @ across


def axial_settings(config: Config) -> Records:
    """Numbers for the shared kernels; where no inertial unit is mounted, those of a standard one (they go unused).

    The shadow is carried by what drives this filter, so it has the noise of that.
    """
    units = [n for n, spec in config.sensor.items() if isinstance(spec, Imu) and n not in config.disabled]
    if not units:
        config = msgspec.structs.replace(config, sensor={**config.sensor, "": Imu()})
    settings = build_settings(config)
    noise = config.axial.accel_noise if units else config.axial.thrust_noise
    settings["shadow_m_s2"] = np.hypot(settings["shadow_m_s2"], noise)
    settings["shadow_alike_s"] = 0.0 if units else DRAG_S
    return settings


def _driver(config: Config) -> Kind:
    """What moves the filter on: inertial samples where they are, else attitudes."""
    enabled = [spec for name, spec in config.sensor.items() if name not in config.disabled]
    if not any(isinstance(spec, AttitudeSource) for spec in enabled):
        raise ConfigError(
            "the axial estimator needs the autopilot's attitude, got no such source; add [sensor.att0] or use the "
            "corridor estimator, which needs inertial samples only"
        )
    return Kind.IMU if any(isinstance(spec, Imu) for spec in enabled) else Kind.ATTITUDE
