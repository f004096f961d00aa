"""Header line of a ``data.csv``: which column is where, and whether its unit is ours."""

from __future__ import annotations

import difflib
import re

from axialnav.fusion.errors import FlightError
from axialnav.replay.readers.columns import Column, Layout
from axialnav.replay.readers.dropped import DropLog

STAMP_NAMES = ("timestamp", "t", "time", "t_ns", "stamp", "timestamp_ns")
_NAME_AND_UNIT = re.compile(r"^(?P<name>[^\[(]*)(?:[\[(](?P<unit>[^\])]*)[\])])?")
_SPELLINGS = {
    "rad/s": "rad s^-1",
    "rad s-1": "rad s^-1",
    "m/s": "m s^-1",
    "m s-1": "m s^-1",
    "m/s^2": "m s^-2",
    "m/s2": "m s^-2",
    "m s-2": "m s^-2",
    "dbm": "dBm",
    "pixel": "px",
    "pixels": "px",
}
# Units that somebody may well have used instead of ours; anything else in brackets is taken as a remark.
_FOREIGN = {"mm", "cm", "km", "ft", "deg", "deg/s", "deg s^-1", "°", "°/s", "g", "mg", "us", "µs", "ms", "cm/s", "mrad"}
_OURS = {"ns", "s", "m", "px", "rad", "rad s^-1", "m s^-1", "m s^-2", "dBm"}


def split_header(text: str) -> list[tuple[str, str]]:
    """Names (lower case) and units of a header line, without its leading ``#``."""
    pairs = []
    for part in text.lstrip("# \t").split(","):
        found = _NAME_AND_UNIT.match(part.strip())
        name = (found["name"] if found else part).strip().lower().replace(" ", "_")
        unit = ((found["unit"] if found else None) or "").strip()
        pairs.append((name, _SPELLINGS.get(unit.lower(), unit)))
    while pairs and pairs[-1] == ("", ""):
        pairs.pop()
    return pairs


def place_columns(
    header: list[tuple[str, str]] | None, width: int, layout: Layout, where: str, drops: DropLog
) -> list[Column | None]:
    """Say for every column of the file after the stamp which :class:`Column` it is, None for unknown ones.

    Columns are found by name.  Where there is no header, or only strange names stand where the required columns belong,
    these are taken in their documented order, as EuRoC readers do; strange names are noted.

    Parameters
    ----------
    header
        Names and units from :func:`split_header`, stamp included, or None.
    width
        Number of columns of the file, stamp included.
    where
        Sensor and file name, for messages.
    drops
        Where strange names are noted.

    Raises
    ------
    FlightError
        A required column is missing, or a column is in another unit.
    """
    if header and header[0][0] not in STAMP_NAMES and any(name in STAMP_NAMES for name, _ in header[1:]):
        raise FlightError(
            f"{where}: the first column must be the timestamp [ns], is `{header[0][0]}`; reorder the file"
        )
    required = [column for column in layout if column.required]
    names = [name for name, _ in header[1:]] if header else []
    placed: list[Column | None] = [_find(name, layout) for name in names]
    missing = [column for column in required if column not in placed]
    if missing and (not header or not any(placed[: len(required)])):
        if width - 1 < len(required):
            raise FlightError(
                f"{where}: {width} columns, needs at least {len(required) + 1}: "
                f"{', '.join(['timestamp', *(column.name for column in required)])}"
            )
        if names:
            reason = "names in the header not known: taken in the documented order"
            drops.add(where.partition("/")[0], reason, 1, names[0])
        free = [column if column not in required else None for column in placed[len(required) :]]
        placed = [*required, *free]
        missing = []
    if missing:
        raise FlightError(f"{where}: no column `{missing[0].name}`{_hint(missing[0], names)}; correct the header line")
    placed += [None] * (width - 1 - len(placed))
    _check_units(header or [], placed, where)
    return _without_repeats(placed)


def _find(name: str, layout: Layout) -> Column | None:
    return next((column for column in layout if name in column.names), None)


def _without_repeats(placed: list[Column | None]) -> list[Column | None]:
    """The first of several columns with one name counts; the others become unknown columns."""
    return [None if column in placed[:i] else column for i, column in enumerate(placed)]


def _hint(column: Column, names: list[str]) -> str:
    near = difflib.get_close_matches(column.name.lower(), names, n=1, cutoff=0.5)
    return f" (is `{near[0]}` meant?)" if near else f" among {', '.join(names)}"


def _check_units(header: list[tuple[str, str]], placed: list[Column | None], where: str) -> None:
    expected = ["ns", *(column.unit if column else "" for column in placed)]
    for (name, unit), ours in zip(header, expected, strict=False):
        if ours and unit != ours and (unit in _FOREIGN or unit in _OURS):
            raise FlightError(f"{where}: column `{name}` is in [{unit}], must be in [{ours}]; convert the file")
