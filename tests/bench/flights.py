"""The real flights of the bench, what is asked of each, and the filters that are compared on them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from axialnav.replay.flight import Flight
from tests.bench.changed import late, turning

FLIGHTS = Path(__file__).resolve().parents[2].parent / "shared" / "flights"


@dataclass(frozen=True)
class Case:
    """One replay and its limits; a limit that is None is not asked.

    Attributes
    ----------
    flight
        Folder name.
    without
        Sensors switched off.
    axial_m_s
        RMSE of the axial velocity [m/s].
    axis_m
        RMSE of position on its worst axis [m].
    position_m
        RMSE of position in space, after rigid alignment where the frames are unrelated [m].
    speed_m_s
        RMSE of the horizontal speed against GPS [m/s].
    consistent
        Whether the NEES of velocity has to lie in its 95 % band.
    farthest_m
        Position error that means "lost" [m].
    """

    flight: str
    without: tuple[str, ...] = ()
    axial_m_s: float | None = None
    axis_m: float | None = None
    position_m: float | None = None
    speed_m_s: float | None = None
    consistent: bool = False
    farthest_m: float | None = None

    @property
    def label(self) -> str:
        """Flight and what is switched off."""
        return self.flight + "".join(f" without {name}" for name in self.without)


OBSTACLES, BOLT = "util_nlos_tdoa2_obs_flow_tof", "util_los_tdoa2_bolt_short"
METAL, SICK, SICK_FAST = "util_nlos_tdoa2_circle_metal", "util_los_tdoa2_circle", "util_los_tdoa3_circle_fast"
LOST_M = 2.0  # the circles have a radius of about 1 m: farther off, the estimate is of no use

CASES = (
    Case(OBSTACLES, axial_m_s=0.05, axis_m=0.07),
    Case(BOLT, axial_m_s=0.05, axis_m=0.06, consistent=True),
    Case(OBSTACLES, ("uwb0",), axial_m_s=0.13),
    Case(BOLT, ("uwb0",), axial_m_s=0.13),
    Case("util_base_tdoa2_circle_noobs", axial_m_s=0.10, axis_m=0.15),
    Case("util_nlos_tdoa2_circle_wood", axial_m_s=0.10, axis_m=0.15),
    Case(METAL, axial_m_s=0.15, axis_m=0.30, farthest_m=LOST_M),
    Case(SICK, axial_m_s=0.20, axis_m=0.30, farthest_m=LOST_M),
    Case(SICK_FAST, axial_m_s=0.30, axis_m=0.35),
    Case("isas_walk1", position_m=0.17),
    Case("copter_px4flow_gps", speed_m_s=0.5),
)

FOUR_SIGMA = math.erf(4.0 / math.sqrt(2.0))
NEVER = "1e9"  # [s] or [sigma]: farther than any flight
GATED = ("uwb", "flow", "range", "height", "attitude")

DEFAULT: dict[str, str] = {}
NO_RIVAL = {"imu_fault.enabled": "false"}
HARD_GATE = {f"{source}.gate.soft_sigma": NEVER for source in GATED}
NO_BIASES = {
    "uwb.bias_sigma_m": "0.0",
    "uwb.range_bias_sigma_m": "0.0",
    "uwb.sigma_m": "0.15",
    "uwb.range_sigma_m": "0.15",
}
NO_SHAKING = {"imu.jolt_time_s": "0.0", "imu.shaken_walk": "0.0"}
WHITE_UWB = {**NO_BIASES, "uwb.correlation_time_s": "0.0"}
NO_REANCHOR = {"supervisor.reanchor_aided_s": NEVER, "supervisor.reanchor_alone_s": NEVER}
NO_SUPERVISOR = {"supervisor.enabled": "false"}
RIGHT_HANDED = {"handedness": '"right"'}
PLAIN = {
    **NO_RIVAL,
    **HARD_GATE,
    **WHITE_UWB,
    **NO_REANCHOR,
    **NO_SUPERVISOR,
    **RIGHT_HANDED,
    **{f"{source}.gate.probability": repr(FOUR_SIGMA) for source in GATED},
    **NO_SHAKING,
    "uwb.sigma_m": "0.2",
    "uwb.range_sigma_m": "0.2",
}
VARIANTS: dict[str, dict[str, str]] = {
    "default": DEFAULT,
    "no rival": NO_RIVAL,
    "jolts believed": NO_SHAKING,
    "hard gate": HARD_GATE,
    "no bias states": NO_BIASES,
    "white UWB noise": WHITE_UWB,
    "no re-anchoring": NO_REANCHOR,
    "no supervisor": NO_SUPERVISOR,
    "right-handed": RIGHT_HANDED,
    "plain": PLAIN,
}
CHANGES: dict[str, Callable[[Flight], Flight]] = {"rotation ignored": turning, "0.1 s late": late}
