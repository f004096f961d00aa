"""Tables of simulated flights as the typed readings that a vehicle would push."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from axialnav.fusion.outcome import Outcome
from axialnav.fusion.readings import (
    Attitude,
    Height,
    ImuSample,
    PixelMotion,
    Reading,
    UwbFix,
    UwbRange,
    UwbTdoa,
    WallRange,
)
from tests.fusion.made_flights import ANCHORS, MadeFlight, Table

NAMES = list(ANCHORS)
Row = dict[str, Any]


def _vectors(row: Row) -> Row:
    return {key: tuple(value.tolist()) if value.ndim else float(value) for key, value in row.items()}


MAKERS: dict[str, Callable[..., Reading]] = {
    "imu": ImuSample,
    "range": WallRange,
    "flow": PixelMotion,
    "uwb": lambda anchor, **rest: UwbRange(anchor=NAMES[int(anchor)], **rest),
    "tdoa": lambda anchor_a, anchor_b, **rest: UwbTdoa(
        anchor_a=NAMES[int(anchor_a)], anchor_b=NAMES[int(anchor_b)], **rest
    ),
    "fix": UwbFix,
    "baro": Height,
    "attitude": Attitude,
}
ORDER = list(MAKERS)


def readings_of(name: str, table: Table) -> Iterator[Reading]:
    """Typed readings of one table."""
    make = MAKERS[name.rstrip("0123456789")]
    for i, t_ns in enumerate(table.t_ns.tolist()):
        row = _vectors({key: column[i] for key, column in table.columns.items()})
        yield make(t_ns=t_ns, sensor=name, **row)


def readings(flight: MadeFlight) -> list[Reading]:
    """All readings of a flight in the order in which they can be known: pixel motion when its window ends."""
    every = [reading for name, table in flight.tables.items() for reading in readings_of(name, table)]
    return sorted(every, key=known_ns)


def known_ns(reading: Reading) -> int:
    """When a reading can be known at the earliest [ns]."""
    return reading.t_ns + (round(0.5e9 * reading.window_s) if isinstance(reading, PixelMotion) else 0)


def counts(outcomes: list[Outcome]) -> dict[str, int]:
    """How many readings met which verdict."""
    found: dict[str, int] = {}
    for outcome in outcomes:
        found[outcome.verdict.name] = found.get(outcome.verdict.name, 0) + 1
    return found
