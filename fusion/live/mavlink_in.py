"""MAVLink messages to readings: FRD and NED end here, every message that is not used is counted by reason."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable

import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ReadingError
from axialnav.fusion.live.axes import Vector3, euler_of, flipped, local_from_corridor
from axialnav.fusion.live.clock import BootClock
from axialnav.fusion.live.dialect import Message
from axialnav.fusion.live.vehicle import Inputs
from axialnav.fusion.readings import Attitude, ImuSample, PixelMotion, Reading, UwbFix, WallRange
from axialnav.models.rig import Flow, Imu

MILLI_G_M_S2 = 9.80665e-3
MILLI = 1e-3
QUANTISED = ("RAW_IMU", "SCALED_IMU")
IMU_ORDER = ("HIGHRES_IMU", *QUANTISED)
ACCEL_AND_GYRO = 0x3F  # bits of HIGHRES_IMU.fields_updated
FROZEN = 10  # equal samples of a noisy sensor
ANOTHER_AFTER_NS = 1_000_000_000
FUTURE_NS = 20_000_000
PAST_NS = 1_000_000_000
UNKNOWN_VARIANCE_CM2 = 255
US, MS = 1_000, 1_000_000  # ns


class MavlinkInput:
    """Turns messages of the autopilot into readings of the configured sensors.

    Attributes
    ----------
    refused
        Reason -> how many messages gave no reading.
    config
        Configuration of the filter as it was given.
    imu_source
        Message that the inertial samples come from at present; empty before the first.
    attitude
        Latest attitude of the autopilot: stamp [ns], quaternion FRD to NED; None before the first.
    """

    def __init__(self, inputs: Inputs, config: Config, clock: BootClock, heading_rad: float = 0.0) -> None:
        self.refused: Counter[str] = Counter()
        self.imu_source = ""
        self.attitude: tuple[int, tuple[float, float, float, float]] | None = None
        self._inputs, self.config, self._clock = inputs, config, clock
        self._corridor_from_local = local_from_corridor(heading_rad).T
        self._imu_seen_ns = -ANOTHER_AFTER_NS
        self._last_imu: tuple[Vector3, Vector3] | None = None
        self._equal = 0
        self._stamps: deque[int] = deque(maxlen=64)
        self._flow_ns: int | None = None
        self._takers: dict[str, Callable[[Message, int], Reading | None]] = {
            "HIGHRES_IMU": self._highres_imu,
            "RAW_IMU": self._scaled_imu,
            "SCALED_IMU": self._scaled_imu,
            "ATTITUDE_QUATERNION": self._attitude,
            "DISTANCE_SENSOR": self._distance,
            "OPTICAL_FLOW": self._flow,
            "OPTICAL_FLOW_RAD": self._flow_rad,
            "VISION_POSITION_ESTIMATE": self._vision,
        }

    @property
    def takes(self) -> tuple[str, ...]:
        """Names of the messages that may become readings."""
        return tuple(self._takers)

    def reading(self, message: Message, arrival_ns: int) -> Reading | None:
        """Reading of one message, or None with the reason counted."""
        name = message.get_type()
        taker = self._takers.get(name)
        if taker is None:
            return None
        remote_ns = _boot_ns(message)
        self._clock.notice(remote_ns, arrival_ns)
        t_ns = self._clock.to_companion_ns(remote_ns)
        if t_ns is None:
            self.refused["clock not known yet"] += 1
            return None
        if not arrival_ns - PAST_NS <= t_ns <= arrival_ns + FUTURE_NS:
            self.refused["stamp far from arrival"] += 1
            return None
        try:
            return taker(message, t_ns)
        except ReadingError:
            self.refused[f"{name} not usable"] += 1
            return None

    def filter_config(self) -> Config:
        """The configuration with the rounding of the present inertial source added to the sensor's noise."""
        imu = self.config.sensor[self._inputs.imu]
        if self.imu_source not in QUANTISED or not isinstance(imu, Imu):
            return self.config
        return with_rounding(self.config, self._inputs.imu, self._inputs.imu_rate_hz)

    def _highres_imu(self, m: Message, t_ns: int) -> Reading | None:
        if m.fields_updated & ACCEL_AND_GYRO != ACCEL_AND_GYRO:
            self.refused["HIGHRES_IMU without new rates and forces"] += 1
            return None
        if m.id != 0:
            self.refused["HIGHRES_IMU of another unit"] += 1
            return None
        return self._imu(m, t_ns, flipped(m.xgyro, m.ygyro, m.zgyro), flipped(m.xacc, m.yacc, m.zacc))

    def _scaled_imu(self, m: Message, t_ns: int) -> Reading | None:
        """RAW_IMU and SCALED_IMU carry milli-g and mrad/s, rounded."""
        gyro = flipped(m.xgyro * MILLI, m.ygyro * MILLI, m.zgyro * MILLI)
        return self._imu(m, t_ns, gyro, flipped(*(a * MILLI_G_M_S2 for a in (m.xacc, m.yacc, m.zacc))))

    def _imu(self, message: Message, t_ns: int, gyro: Vector3, accel: Vector3) -> Reading | None:
        name = message.get_type()
        if not self._is_source(name, t_ns):
            self.refused[f"{name} beside {self.imu_source}"] += 1
            return None
        remote = _boot_ns(message)
        if remote in self._stamps:
            self.refused[f"{name} repeated"] += 1
            return None
        self._stamps.append(remote)
        self._equal = self._equal + 1 if (gyro, accel) == self._last_imu else 0
        self._last_imu = (gyro, accel)
        if self._equal >= FROZEN and name not in QUANTISED:
            self.refused[f"{name} frozen"] += 1
            return None
        return ImuSample(t_ns=t_ns, sensor=self._inputs.imu, gyro_rad_s=gyro, accel_m_s2=accel)

    def _is_source(self, name: str, t_ns: int) -> bool:
        """One inertial source at a time: the best that has been heard of late."""
        if self.imu_source != name:
            better = not self.imu_source or IMU_ORDER.index(name) < IMU_ORDER.index(self.imu_source)
            if not better and t_ns - self._imu_seen_ns < ANOTHER_AFTER_NS:
                return False
            self.imu_source = name
        self._imu_seen_ns = max(t_ns, self._imu_seen_ns)
        return True

    def _attitude(self, m: Message, t_ns: int) -> Reading | None:
        q = (m.q1, m.q2, m.q3, m.q4)
        if not 0.9 < math.hypot(*q) < 1.1:
            self.refused["ATTITUDE_QUATERNION without unit length"] += 1
            return None
        self.attitude = (t_ns, q)
        if self._inputs.attitude is None:
            return None
        roll, pitch, yaw = euler_of(np.array(q) / math.hypot(*q))
        return Attitude(t_ns=t_ns, sensor=self._inputs.attitude, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)

    def _distance(self, m: Message, t_ns: int) -> Reading | None:
        sensor = next((s for s, way in self._inputs.range.items() if way == m.orientation), None)
        if sensor is None:
            self.refused[f"DISTANCE_SENSOR with orientation {m.orientation}"] += 1
            return None
        if m.signal_quality == 1 or not m.min_distance <= m.current_distance <= m.max_distance:
            self.refused["DISTANCE_SENSOR invalid or out of its range"] += 1
            return None
        known = 0 < m.covariance < UNKNOWN_VARIANCE_CM2
        sigma = math.sqrt(m.covariance) * 1e-2 if known else None
        return WallRange(t_ns=t_ns, sensor=sensor, range_m=m.current_distance * 1e-2, sigma_m=sigma)

    def _flow(self, m: Message, t_ns: int) -> Reading | None:
        """OPTICAL_FLOW tells rates and no window: the time since the message before is the window."""
        before, self._flow_ns = self._flow_ns, t_ns
        window_s = (t_ns - before) * 1e-9 if before is not None else 0.0
        if not 1e-3 <= window_s <= 0.2:
            self.refused["OPTICAL_FLOW without a window"] += 1
            return None
        return self._motion(t_ns, window_s, m.flow_rate_x * window_s, m.flow_rate_y * window_s, m.quality)

    def _flow_rad(self, m: Message, t_ns: int) -> Reading | None:
        return self._motion(t_ns, m.integration_time_us * 1e-6, m.integrated_x, m.integrated_y, m.quality)

    def _motion(self, t_ns: int, window_s: float, about_x: float, about_y: float, quality: int) -> Reading | None:
        """Rotation of the picture about x and y of a sensor with x forward and y right [rad].

        Moving to +y gives a negative flow about x, moving to +x a positive one about y; in our terms the content moves
        by ``dx = -f about_y`` and ``dy = f about_x`` where the sensor's S frame has x forward and y right.
        """
        sensor = self._inputs.flow
        spec = self.config.sensor.get(sensor or "")
        if sensor is None or not isinstance(spec, Flow):
            self.refused["flow that no sensor is configured for"] += 1
            return None
        fx, fy = spec.focal_px
        return PixelMotion(
            t_ns=t_ns - round(0.5e9 * window_s),
            sensor=sensor,
            window_s=window_s,
            dx_px=-fx * about_y,
            dy_px=fy * about_x,
            quality=float(quality),
        )

    def _vision(self, m: Message, t_ns: int) -> Reading | None:
        if self._inputs.vision is None:
            self.refused["VISION_POSITION_ESTIMATE that no sensor is configured for"] += 1
            return None
        x, y, z = (float(c) for c in self._corridor_from_local @ np.array([m.x, m.y, m.z]))
        variances = [float(m.covariance[i]) for i in (0, 6, 11)]
        spread = np.abs(self._corridor_from_local) ** 2 @ variances if min(variances) > 0.0 else None  # nan: not known
        sigma = None if spread is None else (math.sqrt(spread[0]), math.sqrt(spread[1]), math.sqrt(spread[2]))
        return UwbFix(t_ns=t_ns, sensor=self._inputs.vision, position_m=(x, y, z), sigma_m=sigma)


def with_rounding(config: Config, imu_name: str, rate_hz: float) -> Config:
    """Copy of ``config`` in which the inertial unit's noise includes rounding to 1 milli-g and 1 mrad/s.

    A step q adds the variance q^2 / 12 to a sample, the density q / sqrt(12 rate).
    """
    imu = config.sensor[imu_name]
    assert isinstance(imu, Imu)
    per_root_hz = 1.0 / math.sqrt(12.0 * rate_hz)
    data = config.to_dict()
    data["sensor"][imu_name] |= {
        "gyro_noise_density": math.hypot(imu.gyro_noise_density, MILLI * per_root_hz),
        "accel_noise_density": math.hypot(imu.accel_noise_density, MILLI_G_M_S2 * per_root_hz),
    }
    return Config.from_dict(data)


def _boot_ns(message: Message) -> int:
    """Stamp of a message on the autopilot's clock [ns]."""
    if hasattr(message, "time_usec"):
        return int(message.time_usec) * US
    if hasattr(message, "usec"):
        return int(message.usec) * US
    return int(message.time_boot_ms) * MS
