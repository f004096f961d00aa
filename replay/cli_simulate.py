"""The verb ``simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError
from axialnav.replay.cli_output import emit, progress_bar

if TYPE_CHECKING:
    from axialnav.replay.flight import Flight


def simulate(
    scenario: str,
    out: Path,
    /,
    *,
    seed: int = 0,
    duration: float | None = None,
    frames: Annotated[bool, Parameter(negative="--no-frames")] = True,
    uwb: str | None = None,
) -> int:
    """Fly a simulated corridor and write a flight folder; equal arguments write equal bytes.

    Parameters
    ----------
    scenario
        straight, stairs, corner, mission, or a TOML file with a mission of your own.
    out
        Flight folder to write; must not hold a flight.
    seed
        Number from which everything random follows.
    duration
        Length of the flight in seconds; built-in corridors are made as long as that takes.
    frames
        Render the camera's pictures; without them a flight takes a second.
    uwb
        Condition of the radio: clean, corner (reflections where walls are in the way), ramp, step, spikes, frozen,
        wild, none.
    """
    from axialnav.replay.simulate.flight import simulate as fly
    from axialnav.replay.simulate.scenarios import mission_of

    if seed < 0:
        raise ConfigError(f"--seed is {seed}, must be 0 or more; choose another")
    mission = mission_of(scenario, duration_s=duration, uwb=uwb)
    with progress_bar(f"simulate {mission.name}") as progress:
        flight = fly(mission, out, seed=seed, frames=frames, progress=progress)
    emit(_summary(flight, out))
    return 0


def _summary(flight: Flight, out: Path) -> str:
    seconds = float(flight.truth.t_ns[-1] - flight.truth.t_ns[0]) * 1e-9 if flight.truth is not None else 0.0
    counts = "   ".join(f"{name} {len(table)}" for name, table in flight.tables.items())
    return f"flight     {out}   {seconds:.1f} s   {counts}"
