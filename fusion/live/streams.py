"""Which messages the autopilot is asked for, and asked again while they do not come."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from axialnav.fusion.live.dialect import Message, mavlink
from axialnav.fusion.live.mavlink_out import message_interval
from axialnav.fusion.live.vehicle import Vehicle

AGAIN_NS = 2_000_000_000
NO_HIGHRES_NS = 3_000_000_000
FALLBACKS = ("RAW_IMU", "SCALED_IMU")
FLOWS = ("OPTICAL_FLOW", "OPTICAL_FLOW_RAD")
WATCH_HZ, ATTITUDE_HZ = 2.0, 20.0
IDS: dict[str, int] = {
    name: getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    for name in (
        *("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "ATTITUDE_QUATERNION", "DISTANCE_SENSOR", "OPTICAL_FLOW"),
        *("OPTICAL_FLOW_RAD", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS"),
    )
}


def wanted_streams(vehicle: Vehicle) -> dict[str, float]:
    """Messages that this vehicle needs and their rates [Hz]."""
    inputs, ardupilot = vehicle.input, vehicle.mavlink.profile == "ardupilot"
    wanted = {"HIGHRES_IMU": inputs.imu_rate_hz}
    wanted["ATTITUDE_QUATERNION"] = inputs.aid_rate_hz if inputs.attitude else ATTITUDE_HZ
    if inputs.range:
        wanted["DISTANCE_SENSOR"] = inputs.aid_rate_hz
    if inputs.flow:
        wanted["OPTICAL_FLOW" if ardupilot else "OPTICAL_FLOW_RAD"] = inputs.aid_rate_hz
    wanted["EKF_STATUS_REPORT" if ardupilot else "ESTIMATOR_STATUS"] = WATCH_HZ
    return wanted


class Streams:
    """Asks for messages, and every two seconds again for those that do not come (after a reboot: for all)."""

    def __init__(self, wanted: Mapping[str, float], target: tuple[int, int], send: Callable[[Message], bool]) -> None:
        self._wanted = dict(wanted)
        self._target, self._send = target, send
        self._seen_ns: dict[str, int] = {}
        self._asked_ns: dict[str, int] = {}
        self._waiting_since_ns: int | None = None

    def seen(self, name: str, arrival_ns: int) -> None:
        """A message of that name came; one kind of flow message is as good as the other."""
        if name in FLOWS:
            self._seen_ns.update(dict.fromkeys(FLOWS, arrival_ns))
        elif name in IDS:
            self._seen_ns[name] = arrival_ns

    def silent(self, now_ns: int) -> list[str]:
        """Names of wanted messages that have not come for two seconds."""
        return [name for name in self._wanted if now_ns - self._seen_ns.get(name, -AGAIN_NS) >= AGAIN_NS]

    def ask(self, now_ns: int) -> None:
        """Ask for what is missing; for the coarse inertial messages too where the fine one does not come."""
        missing = self.silent(now_ns)
        if "HIGHRES_IMU" in missing:
            self._waiting_since_ns = now_ns if self._waiting_since_ns is None else self._waiting_since_ns
            if now_ns - self._waiting_since_ns > NO_HIGHRES_NS and not self._fallback_comes(now_ns):
                missing.extend(FALLBACKS)
        else:
            self._waiting_since_ns = None
        for name in missing:
            if now_ns - self._asked_ns.get(name, -AGAIN_NS) < AGAIN_NS:
                continue
            rate = self._wanted.get(name, self._wanted["HIGHRES_IMU"])
            if self._send(message_interval(*self._target, IDS[name], rate)):
                self._asked_ns[name] = now_ns

    def _fallback_comes(self, now_ns: int) -> bool:
        return any(now_ns - self._seen_ns.get(name, -AGAIN_NS) < AGAIN_NS for name in FALLBACKS)
