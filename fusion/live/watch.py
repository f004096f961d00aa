"""Is the autopilot using what we send?  In plain words, from EKF_STATUS_REPORT or ESTIMATOR_STATUS."""

from __future__ import annotations

from typing import Literal

from axialnav.fusion.live.dialect import Message, mavlink

PATIENCE_NS = 12_000_000_000  # ArduPilot needs about nine seconds to begin with deltas
SILENCE_NS = 3_000_000_000
TRUSTED_RATIO = 0.8
RELATIVE_OR_ABSOLUTE: int = mavlink.EKF_POS_HORIZ_REL | mavlink.EKF_POS_HORIZ_ABS
VELOCITY: int = mavlink.EKF_VELOCITY_HORIZ
CONSTANT_POSITION: int = mavlink.EKF_CONST_POS_MODE
HINTS = {
    "ardupilot": "check AHRS_EKF_TYPE 3, EK3_SRC1_POSXY 6, EK3_SRC1_VELXY 6, VISO_TYPE and VISO_QUAL_MIN 0, and reboot",
    "px4": "check EKF2_EV_CTRL and EKF2_EV_QMIN 0",
}


class Watch:
    """Keeps the latest status of the autopilot's estimator and says what it means.

    Attributes
    ----------
    using
        True or False once it is known, None before.
    """

    def __init__(self, profile: Literal["ardupilot", "px4"], delay_parameter: str) -> None:
        self.using: bool | None = None
        self._profile: Literal["ardupilot", "px4"] = profile
        self._delay_parameter = delay_parameter
        self._report_ns: int | None = None
        self._flags = 0
        self._velocity_ratio = self._position_ratio = 0.0
        self._sending_since_ns: int | None = None

    def take(self, message: Message, arrival_ns: int) -> None:
        """Take an EKF_STATUS_REPORT or ESTIMATOR_STATUS; other messages are ignored."""
        name = message.get_type()
        if name == "EKF_STATUS_REPORT":
            self._velocity_ratio, self._position_ratio = message.velocity_variance, message.pos_horiz_variance
        elif name == "ESTIMATOR_STATUS":
            self._velocity_ratio, self._position_ratio = message.vel_ratio, message.pos_horiz_ratio
        else:
            return
        self._report_ns, self._flags = arrival_ns, message.flags

    def sentence(self, now_ns: int, *, sending: bool, why_not: str, heard: bool, bad_signatures: int) -> str:
        """One sentence for a person.

        Parameters
        ----------
        now_ns
            Present time [ns].
        sending, why_not
            Whether we send, and the reason where we do not.
        heard
            Whether anything usable comes from the autopilot.
        bad_signatures
            Packets refused because of their signature so far.
        """
        self._sending_since_ns = (self._sending_since_ns or now_ns) if sending else None
        if not heard and bad_signatures:
            return "signing: everything from the autopilot has a wrong signature or none; both ends need the same key"
        if not heard:
            return "silence: nothing comes from the autopilot; check wiring, port, baud rate and mavlink.allow"
        if not sending:
            self.using = False
            return f"not sending: {why_not}"
        return self._judge(now_ns)

    def _judge(self, now_ns: int) -> str:
        assert self._sending_since_ns is not None
        report = "EKF_STATUS_REPORT" if self._profile == "ardupilot" else "ESTIMATOR_STATUS"
        since = now_ns - self._sending_since_ns
        if self._report_ns is None or now_ns - self._report_ns > SILENCE_NS:
            self.using = None
            return f"sending, but the autopilot does not tell whether it uses it: no {report}"
        if not self._in_use():
            self.using = False if since > PATIENCE_NS else None
            if since <= PATIENCE_NS:
                return "sending; the autopilot has not begun to use it yet"
            return (
                f"ignored: the autopilot takes messages but does not navigate with them; {HINTS[self._profile]}; "
                f"with signing set on its side, set mavlink.key_file too"
            )
        self.using = True
        if self._velocity_ratio > TRUSTED_RATIO:
            return (
                f"used, but its velocity test is at {self._velocity_ratio:.1f} of the limit: "
                f"check {self._delay_parameter} and the axes of the inertial unit"
            )
        if self._position_ratio > TRUSTED_RATIO:
            return (
                f"used, but its position test is at {self._position_ratio:.1f} of the limit: the two disagree on where "
                f"they are or which way the corridor runs; check output.heading_deg and the yaw source"
            )
        return "the autopilot navigates with our estimate"

    def _in_use(self) -> bool:
        if self._flags & CONSTANT_POSITION:
            return False
        wanted = RELATIVE_OR_ABSOLUTE if self._profile == "ardupilot" else VELOCITY
        return bool(self._flags & wanted)


def delay_advice(profile: Literal["ardupilot", "px4"], round_trip_ns: int | None) -> tuple[str, int]:
    """Parameter to set on the autopilot and its value [ms].

    The state is carried forward to the instant of sending, so that only the way to the autopilot is left: half a round
    trip, and on average half the 5 ms in which its loop picks messages up.  PX4 takes the stamps themselves, once
    TIMESYNC has converged (about 50 s).
    """
    one_way_ms = round((round_trip_ns or 0) * 0.5e-6 + 2.5)
    return ("VISO_DELAY_MS", one_way_ms) if profile == "ardupilot" else ("EKF2_EV_DELAY", 0)
