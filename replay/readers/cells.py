"""Cells of one line of a ``data.csv``: stamps to exact integers, values to float64."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import Any

from axialnav.replay.readers.columns import Column

STAMP_LIMIT = 2**62
_WHOLE = re.compile(r"[+-]?[0-9]{1,19}")
_STAMP = re.compile(r"[+-]?[0-9]{1,19}(\.[0-9]{0,30})?([eE][+]?[0-9]{1,2})?")


def split_fields(line: str) -> list[str]:
    """Cells of a line without remark; a trailing comma ends the line and begins no cell."""
    fields = [part.strip() for part in line.partition("#")[0].split(",")]
    if len(fields) > 1 and not fields[-1]:
        fields.pop()
    return fields


def _parse_stamp(text: str) -> int | None:
    """Stamp from a whole number, also one written as a float: ``1e9``, ``1.5e9`` and ``1000000000.0`` are whole."""
    if _WHOLE.fullmatch(text):
        stamp = int(text)
    elif _STAMP.fullmatch(text) and Decimal(text) == int(Decimal(text)):
        stamp = int(Decimal(text))
    else:
        return None
    return stamp if abs(stamp) < STAMP_LIMIT else None


def parse_row(fields: list[str], placed: list[Column | None], width: int, needed: int) -> list[Any] | str:
    """Stamp and values of a row in the order of the file, or the reason why it cannot be used."""
    if len(fields) < needed:
        return f"row too short (needs {needed} values)"
    if len(fields) > width:
        return f"row too long (the file has {width} columns)"
    stamp = _parse_stamp(fields[0])
    if stamp is None:
        return "timestamp is not a whole number of nanoseconds below 2**62"
    row: list[Any] = [stamp]
    for column, cell in zip(placed, [*fields[1:], *[""] * (width - len(fields))], strict=True):
        if column is None or column.text:
            row.append(cell)
            continue
        value = _parse_number(cell)
        if value is None:
            return "not a number"
        row.append(value)
    return row


def _parse_number(text: str) -> float | None:
    """Number from text, NaN from nothing; Python's own extras (``1_0``, other scripts' digits) are not numbers."""
    if not text:
        return math.nan
    if "_" in text or not text.isascii():
        return None
    try:
        return float(text)
    except ValueError:
        return None
