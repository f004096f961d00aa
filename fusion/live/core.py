"""The filter in one place: readings in from one thread, states out to any."""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.axial_estimator import AxialEstimator
from axialnav.fusion.config import Config, Initial
from axialnav.fusion.corridor import CorridorEstimator, NotStartedError, PastStateError
from axialnav.fusion.errors import FlightError, ReadingError
from axialnav.fusion.memory import the_imu
from axialnav.fusion.outcome import AxialState, Outcome, Verdict
from axialnav.fusion.readings import ImuSample, Reading
from axialnav.models.rig import BlurMeter, Camera, Flow, Imu, Uwb

MAX_GAP_NS = 1_000_000_000  # without inertial samples for longer, nobody knows where the vehicle is
MAX_SPEED_M_S = 100.0
SIGMA_M, SIGMA_M_S, SIGMA_RAD = 0.5, 1.0, 0.2  # of a state that is taken over
LONG_AGO_NS = -(2**62)
SILENT_NS = 250_000_000
LOCK_S = 0.05
AXIAL = (BlurMeter, Camera, Flow, Uwb)
ESTIMATORS: dict[str, type[CorridorEstimator]] = {"corridor": CorridorEstimator, "axial": AxialEstimator}


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The estimate carried forward to ``state.t_ns``, and how fresh it is.

    Attributes
    ----------
    state
        Estimate.
    rate_rad_s
        Latest angular rate in body axes, bias removed, shape (3,).
    imu_ns
        Stamp of the newest inertial sample.
    aid_ns, axial_ns
        Arrival of the latest reading that was fused: of any, and of a sensor that sees the motion along the corridor.
    restarts
        How often the filter has been started again.
    """

    state: AxialState
    rate_rad_s: NDArray[np.float64]
    imu_ns: int
    aid_ns: int
    axial_ns: int
    restarts: int


class Tap(Protocol):
    """Who wants to know what the filter saw (the recorder)."""

    def restarted(self, config: Config) -> None:
        """The filter starts anew with ``config``; what follows belongs to the new one."""

    def pushed(self, reading: Reading, outcome: Outcome, arrival_ns: int) -> None:
        """One reading went into the filter."""


class FilterCore:
    """Owns the estimator; starts it anew where its past is of no use.

    Parameters
    ----------
    make_config
        Configuration for the next estimator (the noise depends on which inertial messages come).
    kind
        ``"corridor"`` or ``"axial"``.
    tap
        Told of everything that goes in.

    Attributes
    ----------
    verdicts
        Sensor and verdict -> count.
    refused
        Reason -> readings that the filter did not take.
    restarts
        Reason -> how often the filter was started anew.
    began_ns
        Stamp of the first inertial sample of the present filter; None before it.
    """

    def __init__(self, make_config: Callable[[], Config], kind: str = "corridor", tap: Tap | None = None) -> None:
        self.verdicts: Counter[tuple[str, str]] = Counter()
        self.refused: Counter[str] = Counter()
        self.restarts: Counter[str] = Counter()
        self._make_config, self._kind, self._tap = make_config, kind, tap
        self._lock = threading.Lock()
        self.began_ns: int | None = None
        self._imu: ImuSample | None = None
        self._fused_ns: dict[str, int] = {}  # arrival of each sensor's latest fused reading
        self._axial: frozenset[str] = frozenset()
        self._count = 0
        self._last: AxialState | None = None
        self._sick = False
        self._estimator = self._new()

    def _new(self, last: AxialState | None = None, gap_s: float = 0.0) -> CorridorEstimator:
        config = self._make_config()
        if self._count:
            config = resumed(config, last, gap_s)
        if self._tap is not None:
            self._tap.restarted(config)
        self._rotation_BS = the_imu(config).rotation_BS
        aids = {n: s for n, s in config.sensor.items() if n not in config.disabled and not isinstance(s, Imu)}
        self._axial = frozenset(name for name, spec in aids.items() if isinstance(spec, AXIAL))
        self._fused_ns = dict.fromkeys(aids, LONG_AGO_NS)
        return ESTIMATORS[self._kind](config)

    def push(self, reading: Reading, arrival_ns: int) -> Outcome | None:
        """Take one reading; None if the filter would not have it.  From one thread only."""
        with self._lock:
            self._watch(reading)
            try:
                outcome = self._estimator.push(reading)
            except ReadingError:
                self.refused[f"{reading.sensor}: not a reading of a configured sensor"] += 1
                return None
            except FlightError as error:
                self._restart(f"cannot start: {error}", reading.t_ns)
                return None
            if isinstance(reading, ImuSample):
                self.began_ns = self.began_ns or reading.t_ns
                if self._imu is None or reading.t_ns > self._imu.t_ns:
                    self._imu = reading
            elif outcome.verdict is Verdict.FUSED:
                self._fused_ns[reading.sensor] = arrival_ns
        self.verdicts[reading.sensor, outcome.verdict.name] += 1
        if self._tap is not None:
            self._tap.pushed(reading, outcome, arrival_ns)
        return outcome

    def restart(self, reason: str, now_ns: int) -> None:
        """Start anew, for example because the autopilot did; from the thread that pushes."""
        with self._lock:
            self._restart(reason, now_ns)

    def snapshot(self, now_ns: int) -> Snapshot | None:
        """The estimate carried forward to ``now_ns``; None while there is none or the filter is stuck."""
        if not self._lock.acquire(timeout=LOCK_S):
            return None
        try:
            if self._imu is None:
                return None
            state = self._estimator.state(max(now_ns, self._imu.t_ns))
            if not _is_sane(state):
                self._sick = True  # the thread that pushes starts it anew
                return None
            if state.velocity_valid:
                self._last = state
            rate = self._rotation_BS @ np.array(self._imu.gyro_rad_s) - state.gyro_bias_rad_s
            aid_ns = max(self._fused_ns.values(), default=LONG_AGO_NS)
            axial_ns = max((self._fused_ns[name] for name in self._axial), default=LONG_AGO_NS)
            return Snapshot(state, rate, self._imu.t_ns, aid_ns, axial_ns, self._count)
        except (NotStartedError, PastStateError):
            return None
        finally:
            self._lock.release()

    def silent(self, now_ns: int) -> list[str]:
        """Sensors of which nothing has been fused for a quarter of a second."""
        return sorted(name for name, t_ns in self._fused_ns.items() if now_ns - t_ns > SILENT_NS)

    def _watch(self, reading: Reading) -> None:
        if self._sick:
            self._restart("the estimate ran away", reading.t_ns)
        newest = self._imu
        if isinstance(reading, ImuSample) and newest is not None and reading.t_ns - newest.t_ns > MAX_GAP_NS:
            self._restart("no inertial samples for more than 1 s", reading.t_ns)

    def _restart(self, reason: str, now_ns: int) -> None:
        last = None if self._sick else self._last
        gap_s = (now_ns - self._imu.t_ns) * 1e-9 if self._imu is not None else 0.0
        self._sick, self._last = False, None
        self.restarts[reason] += 1
        self._count += 1
        self._imu, self.began_ns = None, None
        self._estimator = self._new(last, max(gap_s, 0.0))


def resumed(config: Config, last: AxialState | None, gap_s: float) -> Config:
    """The configuration of a filter that starts in the middle of a flight: near where the last one was, if it knew.

    What ``[initial]`` says holds for the beginning of the flight only.  Sigmas grow with the time that nobody saw.
    """
    if last is None:
        return msgspec.structs.replace(config, initial=None)
    w, x, y, z = (float(c) for c in last.quaternion_WB)
    px, py, pz = (float(c) for c in last.position_m)
    vx, vy, vz = (float(c) for c in last.velocity_m_s)
    initial = Initial(
        position_m=(px, py, pz),
        velocity_m_s=(vx, vy, vz),
        yaw_rad=math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        sigma_position_m=SIGMA_M + gap_s * SIGMA_M_S,
        sigma_velocity_m_s=SIGMA_M_S,
        sigma_yaw_rad=SIGMA_RAD * (1.0 + gap_s),
    )
    return msgspec.structs.replace(config, initial=initial)


def _is_sane(state: AxialState) -> bool:
    numbers = (state.position_m, state.velocity_m_s, state.quaternion_WB, state.covariance)
    finite = all(bool(np.isfinite(n).all()) for n in numbers)
    return finite and float(np.abs(state.velocity_m_s).max()) < MAX_SPEED_M_S
