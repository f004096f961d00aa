"""``flight.toml``: what a recording says of itself, the world, the corridor, the first state and the scoring window."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import msgspec

from axialnav.fusion.config import Corridor, Initial
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.strict_toml import decode, parse
from axialnav.models.rig import Surface

STANDARD_GRAVITY_M_S2 = 9.80665
AXIS_TOLERANCE = 1e-3


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
        raise FlightError(str(error)) from None
    _check_numbers(table, str(path))
    start_s, end_s = table.evaluation.start_s, table.evaluation.end_s
    if start_s is not None and end_s is not None and not start_s < end_s:
        raise FlightError(f"{path}: evaluation.end_s is {end_s:g}, must be after start_s = {start_s:g}; correct either")
    return table


def _check_numbers(table: FlightToml, where: str) -> None:
    """Finite numbers throughout, and an axis of length 1."""
    name = not_finite(msgspec.to_builtins(table))
    if name is not None:
        raise FlightError(f"{where}: {name} must be a finite number; correct it or leave it out")
    if table.corridor is not None:
        length = math.hypot(*table.corridor.axis)
        if abs(length - 1.0) > AXIS_TOLERANCE:
            raise FlightError(
                f"{where}: corridor.axis has length {length:.4g}, must be 1 (tolerance {AXIS_TOLERANCE}); "
                f"divide {table.corridor.axis} by {length:.4g}"
            )


def not_finite(data: Any, name: str = "") -> str | None:
    """Dotted name of the first number in nested plain data that is NaN or infinite, None if there is none."""
    if isinstance(data, float) and not math.isfinite(data):
        return name
    parts = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list | tuple) else ()
    found = (not_finite(value, f"{name}.{key}" if name else str(key)) for key, value in parts)
    return next((one for one in found if one is not None), None)
