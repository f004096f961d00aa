"""``flight.toml``: what a recording says of itself, the world, the corridor, the first state and the scoring window."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from axialnav.fusion.config import Corridor, Initial
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.strict_toml import decode, parse
from axialnav.models.rig import Surface

STANDARD_GRAVITY_M_S2 = 9.80665


class _Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of all tables: frozen and strict."""


class FlightTable(_Table, frozen=True, kw_only=True):
    """``[flight]``: where the recording comes from."""

    name: str | None = None
    source: str | None = None
    licence: str | None = None
    note: str | None = None


class WorldTable(_Table, frozen=True, kw_only=True):
    """``[world]``."""

    gravity_m_s2: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = STANDARD_GRAVITY_M_S2


class EvaluationTable(_Table, frozen=True, kw_only=True):
    """``[evaluation]``: scoring window [s] after the first IMU sample."""

    start_s: float | None = None
    end_s: float | None = None


class FlightToml(_Table, frozen=True, kw_only=True):
    """The whole file; every table may be missing."""

    flight: FlightTable = FlightTable()
    world: WorldTable = WorldTable()
    corridor: Corridor | None = None
    surface: dict[str, Surface] = {}
    initial: Initial | None = None
    evaluation: EvaluationTable = EvaluationTable()


def read_flight_toml(path: Path) -> FlightToml:
    """Read the file; one that does not exist gives the defaults.

    Raises
    ------
    FlightError
        Not TOML, an unknown key (with the nearest known one), a wrong value, or an empty scoring window.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        return FlightToml()
    except (OSError, UnicodeDecodeError) as error:
        raise FlightError(f"{path}: cannot be read: {error}") from None
    try:
        table = decode(parse(text, where=str(path)), FlightToml, where=str(path))
    except (ConfigError, ValueError) as error:
        raise FlightError(" ".join(str(error).split())) from None
    start_s, end_s = table.evaluation.start_s, table.evaluation.end_s
    if start_s is not None and end_s is not None and not start_s < end_s:
        raise FlightError(f"{path}: evaluation.end_s is {end_s:g}, must be after start_s = {start_s:g}; correct either")
    return table
