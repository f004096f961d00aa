"""Which of a log's streams and fields are which sensor: one TOML file, with defaults for every format."""

from __future__ import annotations

import difflib
from importlib import resources
from pathlib import Path
from typing import Literal

import msgspec

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.strict_toml import decode, parse, read_text
from axialnav.models.rig import AnySensor
from axialnav.replay.readers.flight_toml import FlightToml

STAMP_NS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
TRUTH = "truth"


class Source(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, rename={"streams": "from"}):
    """``[source.NAME]``: where the readings of a sensor stand in the log.

    Attributes
    ----------
    streams
        Names or types of streams; the first that the log has is read.  In the file: ``from``.
    unless
        Streams that are better: where the log has one of them, this source is not read.
    stamp, stamp_unit
        Field that holds the time, and its unit; None: the time that the format gives every message.
    where
        Conditions on fields; other messages are left out.
    fields
        Field of the reading -> expression, or one per axis.
    """

    streams: tuple[str, ...]
    unless: tuple[str, ...] = ()
    stamp: str | None = None
    stamp_unit: Literal["ns", "us", "ms", "s"] = "us"
    where: str | None = None
    fields: dict[str, str | tuple[str, ...]] = {}


class Mapping(FlightToml, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file: the tables of ``flight.toml``, ``[sensor.NAME]`` as in a configuration, and ``[source.NAME]``.

    ``defaults = false`` leaves out what the format's own mapping says.
    """

    defaults: bool = True
    sensor: dict[str, AnySensor] = msgspec.field(default_factory=dict)
    source: dict[str, Source] = msgspec.field(default_factory=dict)


def load_mapping(path: Path, own: Path | None, default: str) -> tuple[Mapping, frozenset[str]]:
    """Mapping for the log at ``path``, and the names of the sensors that the user's own file asks for.

    Parameters
    ----------
    own
        The user's file; None: the one beside the log with its name and ``.toml``, if there is one.
    default
        Name of the format's own mapping.

    Raises
    ------
    FlightError
        The file cannot be read or understood.
    """
    text = resources.files("axialnav.replay.readers").joinpath(f"defaults/{default}.toml").read_text(encoding="utf-8")
    base = _decode(text, f"defaults/{default}.toml")
    own = own or _beside(path)
    if own is None:
        return base, frozenset()
    try:
        asked = _decode(read_text(own, "mapping"), str(own))
    except ConfigError as error:
        raise FlightError(str(error)) from None
    _check_names(asked, base, own)
    if not asked.defaults:
        return asked, frozenset(asked.source)
    merged = msgspec.structs.replace(
        asked,
        surface={**base.surface, **asked.surface},
        sensor={**base.sensor, **asked.sensor},
        source={**base.source, **asked.source},
    )
    return merged, frozenset(asked.source)


def _beside(path: Path) -> Path | None:
    for candidate in (path.with_name(path.name + ".toml"), path.with_suffix(".toml")):
        if candidate != path and candidate.is_file():
            return candidate
    return None


def _decode(text: str, where: str) -> Mapping:
    try:
        return decode(parse(text, where=where), Mapping, where=where)
    except (ConfigError, ValueError) as error:
        raise FlightError(str(error)) from None


def _check_names(asked: Mapping, base: Mapping, where: Path) -> None:
    known = {**base.sensor, **asked.sensor}
    for name in asked.source:
        if name not in known and name != TRUTH:
            near = difflib.get_close_matches(name, [*known, TRUTH], n=1)
            hint = f"; is {near[0]} meant?" if near else ""
            raise FlightError(f"{where}: [source.{name}] has no [sensor.{name}] that says what it is{hint}")
