"""Limits as data: a TOML file that says which numbers of ``metrics.json`` have to lie where.

One table ``[check.NAME]`` per check.  ``metric`` is a path into ``metrics.json``, its keys joined by dots; ``*`` in it
stands for every key at that place, and the check is made for each of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from axialnav.fusion.errors import ConfigError
from axialnav.fusion.strict_toml import decode, parse, read_text

DEFAULT_LIMITS = Path(__file__).parent / "limits" / "default.toml"
Path_ = Annotated[str, msgspec.Meta(pattern=r"^[^.]+(\.[^.]+)*$")]


class Limit(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One check.

    Attributes
    ----------
    metric
        Path into ``metrics.json``.
    divided_by
        Paths whose sum divides the value; not evaluated where the sum is 0.
    take
        What of the value is compared: itself, its size without the sign, or of a list of ``[start, end]`` intervals
        their number, the longest or the sum of their lengths.
    warn_above, fail_above, warn_below, fail_below
        Limits; the value may lie on them.
    warn_outside
        Path of a pair ``[low, high]`` outside of which the check warns.
    unless
        Path of a truth value, or several; where one is true the check is skipped as not evaluated.
    if_absent
        What it means that the last key of ``metric`` is missing while the table that would hold it is there.
    required
        A check that could not be evaluated makes the whole verdict NOT_EVALUATED.
    why
        One phrase for the person who reads the table.
    """

    metric: Path_
    divided_by: tuple[Path_, ...] = ()
    take: Literal["value", "size", "count", "longest", "total"] = "value"
    warn_above: float | None = None
    fail_above: float | None = None
    warn_below: float | None = None
    fail_below: float | None = None
    warn_outside: Path_ | None = None
    unless: Path_ | tuple[Path_, ...] = ()
    if_absent: float | None = None
    required: bool = False
    why: str = ""

    def __post_init__(self) -> None:
        limits = (self.warn_above, self.fail_above, self.warn_below, self.fail_below, self.warn_outside)
        if all(limit is None for limit in limits):
            raise ValueError(f"check of {self.metric} has no limit; give one like fail_above = 0.3")


class LimitsFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A limits file: checks by name, in the order of the file."""

    check: dict[str, Limit] = {}


def read_limits(path: Path | None = None) -> dict[str, Limit]:
    """Checks of a limits file; of the one that comes with the package if none is given.

    Raises
    ------
    ConfigError
        The file cannot be read, is no TOML, has an unknown key or a value of the wrong type, or holds no check.
    """
    source = path or DEFAULT_LIMITS
    checks = decode(parse(read_text(source, "limits"), where=str(source)), LimitsFile, where=str(source)).check
    if not checks:
        raise ConfigError(f"limits {source}: no [check.NAME] table in it, so there is nothing to check")
    return checks
