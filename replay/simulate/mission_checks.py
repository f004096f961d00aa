"""A mission that cannot be flown is refused with one line, before anything is simulated."""

from __future__ import annotations

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.mission import Mission, SectionPlan

MAX_SLOPE = 1.0  # rise over run: 45 degrees
MIN_WIDTH_M, MAX_WIDTH_M = 1.0, 50.0
MIN_LENGTH_M, MAX_LENGTH_M = 0.5, 5000.0
CLEARANCE_M = 0.35  # between the vehicle's middle and any wall
MAX_TURN_DEG = 120.0
MAX_TIME_S = 36_000.0
MAX_SHARE_OF_PICTURE = 0.1  # of the width that may pass per frame: five frames then still share half of a picture


def check_mission(mission: Mission) -> None:
    """Refuse what cannot be built, flown or filmed.

    Raises
    ------
    ConfigError
        One line: what, value, limit, way out.
    """
    for number, plan in enumerate(mission.section, start=1):
        _check_section(f"mission {mission.name}, section {number} ({plan.kind})", plan)
        _check_clearance(mission, number, plan)
    _check_time(mission)
    _check_camera(mission)


def _check_time(mission: Mission) -> None:
    vehicle = mission.vehicle
    takes = vehicle.still_s + sum(plan.length_m for plan in mission.section) / vehicle.speed_m_s
    for what, value, way_out in (
        ("duration_s", mission.duration_s or 0.0, "shorten it"),
        ("the way takes", takes, "shorten it, stand still for less or fly faster"),
    ):
        if not value <= MAX_TIME_S:
            raise ConfigError(
                f"mission {mission.name}: {what} {value:.3g} s, must be at most {MAX_TIME_S:g}; {way_out}"
            )


def _check_section(where: str, plan: SectionPlan) -> None:
    for name, value, low, high in (
        ("width_m", plan.width_m, MIN_WIDTH_M, MAX_WIDTH_M),
        ("height_m", plan.height_m, MIN_WIDTH_M, MAX_WIDTH_M),
        ("length_m", plan.length_m, MIN_LENGTH_M, MAX_LENGTH_M),
    ):
        if not low <= value <= high:
            raise ConfigError(f"{where}: {name} is {value:g}, must be {low:g} to {high:g}; correct it")
    if plan.kind == "corner":
        if not 5.0 <= abs(plan.turn_deg) <= MAX_TURN_DEG:
            raise ConfigError(f"{where}: turn_deg is {plan.turn_deg:g}, must be 5 to {MAX_TURN_DEG:g} either way")
        if plan.length_m < plan.width_m:
            raise ConfigError(
                f"{where}: length_m is {plan.length_m:g}, less than the width of {plan.width_m:g}; "
                "the turn would cut the inner wall, make it at least as long"
            )
    elif plan.turn_deg:
        raise ConfigError(f"{where}: turn_deg is {plan.turn_deg:g}, but only a corner turns; leave it out")
    if plan.kind == "stairs" and not 0.0 < abs(plan.rise_m) <= MAX_SLOPE * plan.length_m:
        raise ConfigError(
            f"{where}: rise_m is {plan.rise_m:g} over {plan.length_m:g} m, must not be 0 nor steeper than "
            f"{MAX_SLOPE:g}; correct either"
        )
    if plan.kind != "stairs" and plan.rise_m:
        raise ConfigError(f"{where}: rise_m is {plan.rise_m:g}, but only stairs rise; leave it out")
    _check_openings(where, plan)


def _check_openings(where: str, plan: SectionPlan) -> None:
    if plan.opening and plan.kind != "straight":
        raise ConfigError(f"{where}: {len(plan.opening)} openings, but only a straight section may have them")
    for side in ("left", "right"):
        end = 0.0
        for opening in sorted((o for o in plan.opening if o.side == side), key=lambda o: o.start_m):
            stop = opening.start_m + opening.length_m
            if opening.start_m < end or stop > plan.length_m:
                raise ConfigError(
                    f"{where}: opening from {opening.start_m:g} to {stop:g} m on the {side} must lie between "
                    f"{end:g} and {plan.length_m:g} m; move it"
                )
            end = stop


def _check_clearance(mission: Mission, number: int, plan: SectionPlan) -> None:
    vehicle = mission.vehicle
    reserve = CLEARANCE_M + 3.0 * vehicle.clearance_sigma_m
    side = 0.5 * plan.width_m - abs(vehicle.offset_m)
    above = plan.height_m - vehicle.height_m
    for what, value in (
        ("the side wall", side),
        ("the ceiling", above),
        ("the floor", vehicle.height_m),
    ):
        if value < reserve:
            raise ConfigError(
                f"mission {mission.name}, section {number}: the vehicle comes within {value:.2f} m of {what}, "
                f"must keep {reserve:.2f} m; widen the section or change vehicle.offset_m or height_m"
            )


def _check_camera(mission: Mission) -> None:
    camera, vehicle = mission.camera, mission.vehicle
    distance = mission.camera_distance_m
    passing = camera.focal_px * vehicle.speed_m_s / (camera.rate_hz * distance)
    limit = MAX_SHARE_OF_PICTURE * camera.width_px
    if passing > limit:
        fastest = limit * camera.rate_hz * distance / camera.focal_px
        raise ConfigError(
            f"mission {mission.name}: vehicle.speed_m_s = {vehicle.speed_m_s:g} moves the picture by {passing:.0f} px "
            f"per frame, beyond the camera's reach of {limit:.0f}; fly at most {fastest:.2f} m/s, farther from the "
            "wall, or raise camera.rate_hz"
        )
    for name, takes_s in (("exposure_s", camera.exposure_s), ("readout_s", camera.readout_s)):
        if not takes_s <= 1.0 / camera.rate_hz:
            raise ConfigError(
                f"mission {mission.name}: camera.{name} = {takes_s:g} is longer than the frame period of "
                f"{1.0 / camera.rate_hz:.4g} s; shorten it"
            )
    if camera.width_px % 2:
        raise ConfigError(f"mission {mission.name}: camera.width_px is {camera.width_px}, must be even; add one")
