"""The built-in scenarios, and how a scenario's name or file becomes a mission."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path
from typing import cast

import msgspec

from axialnav.fusion.errors import ConfigError
from axialnav.replay.simulate.mission import Mission, Opening, SectionPlan, UwbCondition, VehiclePlan, read_mission
from axialnav.replay.simulate.mission_checks import check_mission

OVERHEAD_S = 6.0  # standing still, speeding up and slowing down
CONDITIONS: tuple[str, ...] = ("clean", "corner", "ramp", "step", "spikes", "frozen", "wild", "none")


def straight(duration_s: float) -> Mission:
    """One straight tunnel past two doorways on the other side."""
    length = max(duration_s - OVERHEAD_S, 6.0)
    doors = tuple(Opening(side="right", start_m=share * length, length_m=1.2) for share in (0.3, 0.6))
    return Mission(name="straight", section=(SectionPlan(kind="straight", length_m=length, opening=doors),))


def stairs(duration_s: float) -> Mission:
    """Level, up a flight of stairs at 30 degrees, level again."""
    run = max((duration_s - OVERHEAD_S) * 0.9, 9.0)
    level, climb = 0.25 * run, 0.5 * run
    flat = SectionPlan(kind="straight", length_m=level)
    up = SectionPlan(kind="stairs", length_m=climb, rise_m=0.5774 * climb)
    return Mission(name="stairs", section=(flat, up, flat))


def corner(duration_s: float) -> Mission:
    """A right-angled turn; the anchors stay behind it."""
    reach = 3.0
    leg = max(0.5 * (duration_s - OVERHEAD_S) - reach, 4.0)
    flat = SectionPlan(kind="straight", length_m=leg)
    turn = SectionPlan(kind="corner", length_m=reach, turn_deg=-90.0)
    return Mission(name="corner", section=(flat, turn, flat))


def mission(duration_s: float) -> Mission:
    """Straight, stairs, straight, a reflecting corner, straight, with stops on the way."""
    run = max(0.85 * (duration_s - OVERHEAD_S) - 6.0, 12.0)
    flat = SectionPlan(kind="straight", length_m=0.25 * run)
    up = SectionPlan(kind="stairs", length_m=0.25 * run, rise_m=0.12 * run)
    turn = SectionPlan(kind="corner", length_m=3.0, turn_deg=-90.0)
    return Mission(name="mission", section=(flat, up, flat, turn, flat), vehicle=VehiclePlan(profile="paper"))


BUILT_IN: dict[str, tuple[Callable[[float], Mission], float]] = {
    "straight": (straight, 40.0),
    "stairs": (stairs, 40.0),
    "corner": (corner, 40.0),
    "mission": (mission, 60.0),
}


def mission_of(scenario: str, *, duration_s: float | None = None, uwb: str | None = None) -> Mission:
    """Mission of a built-in scenario or of a TOML file, checked.

    Parameters
    ----------
    scenario
        A name of ``BUILT_IN`` or the path of a file.
    duration_s
        Length of the flight [s]; built-in corridors are made as long as that takes, others are flown no longer.
    uwb
        Condition of the radio, one of ``CONDITIONS``; None for what the mission says.

    Raises
    ------
    ConfigError
        No such scenario, condition or file, or a mission that cannot be flown.
    """
    if duration_s is not None and not 5.0 <= duration_s <= 36_000.0:
        raise ConfigError(f"--duration is {duration_s:g} s, must be 5 to 36000; choose another")
    if scenario in BUILT_IN:
        make, usual_s = BUILT_IN[scenario]
        plan = make(usual_s if duration_s is None else duration_s)
    elif scenario.endswith(".toml"):
        plan = read_mission(Path(scenario))
    else:
        near = difflib.get_close_matches(scenario, BUILT_IN, n=1)
        hint = f"; is {near[0]!r} meant?" if near else ""
        raise ConfigError(f"no scenario {scenario!r}: there are {', '.join(BUILT_IN)}, or a file NAME.toml{hint}")
    if duration_s is not None:
        plan = msgspec.structs.replace(plan, duration_s=duration_s)
    if uwb is not None:
        if uwb not in CONDITIONS:
            raise ConfigError(f"--uwb is {uwb!r}, must be one of {', '.join(CONDITIONS)}")
        plan = msgspec.structs.replace(plan, uwb=msgspec.structs.replace(plan.uwb, condition=cast(UwbCondition, uwb)))
    check_mission(plan)
    return plan
