"""Before the first message: do autopilot and filter agree on which way is down, and on a stated heading."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.live.axes import FLIP, local_from_corridor
from axialnav.fusion.outcome import AxialState
from axialnav.models.rotations import rotation_matrix

Array = NDArray[np.float64]
PATIENCE_NS = 5_000_000_000  # how long an autopilot's attitude is waited for
FRESH_NS = 500_000_000


class AttitudeCheck:
    """Compares our attitude with ATTITUDE_QUATERNION; ArduPilot (VISO_TYPE 3) refuses to arm if they differ by 10 deg.

    Attributes
    ----------
    passed
        Whether the first message may go out; once passed it stays so until :meth:`again`.
    tilt_deg, yaw_deg
        Latest differences; None before the first comparison.  Yaw counts only where a heading is stated.
    """

    def __init__(self, limit_deg: float, heading_rad: float | None) -> None:
        self.passed = False
        self.note = ""
        self.tilt_deg: float | None = None
        self.yaw_deg: float | None = None
        self._limit_deg = limit_deg
        self._heading_rad = heading_rad
        self._theirs: tuple[int, tuple[float, float, float, float]] | None = None
        self._waiting_since_ns: int | None = None

    def autopilot(self, attitude: tuple[int, tuple[float, float, float, float]] | None) -> None:
        """Latest attitude of the autopilot: stamp [ns], quaternion body FRD to NED."""
        self._theirs = attitude

    def again(self) -> None:
        """Check once more, because the filter or the autopilot has started anew."""
        self.passed, self._waiting_since_ns, self.note = False, None, ""

    def verdict(self, state: AxialState, now_ns: int) -> str:
        """Why nothing may be sent yet; empty if it may."""
        if self.passed:
            return ""
        theirs = self._theirs
        if theirs is None or now_ns - theirs[0] > FRESH_NS:
            self._waiting_since_ns = self._waiting_since_ns or now_ns
            if now_ns - self._waiting_since_ns < PATIENCE_NS:
                return "waiting for the autopilot's attitude to compare with"
            self.passed, self.note = True, "the autopilot sends no ATTITUDE_QUATERNION: attitudes were not compared"
            return ""
        tilt, yaw = self._compare(state, np.array(theirs[1]))
        self.tilt_deg, self.yaw_deg = tilt, yaw
        if tilt > self._limit_deg:
            return f"roll and pitch differ from the autopilot's by {tilt:.0f} deg; check T_BS of the inertial unit"
        if self._heading_rad is not None and yaw > self._limit_deg:
            return f"yaw differs from the autopilot's by {yaw:.0f} deg; check output.heading_deg and the compass"
        self.passed, self.note = True, ""
        return ""

    def _compare(self, state: AxialState, q_theirs: Array) -> tuple[float, float]:
        ours = local_from_corridor(self._heading_rad or 0.0) @ rotation_matrix(state.quaternion_WB) @ FLIP
        theirs = rotation_matrix(q_theirs / np.linalg.norm(q_theirs))
        down = float(np.clip(ours[2] @ theirs[2], -1.0, 1.0))
        mine, yours = (math.atan2(R[1, 0], R[0, 0]) for R in (ours, theirs))
        return math.degrees(math.acos(down)), abs(math.degrees(math.remainder(mine - yours, math.tau)))
