"""Rows of a ``data.csv``: exact integer stamps and float64 values, dirty rows left out and counted.

A clean file goes through numpy's compiled parser.  Whatever that refuses is read line by line, so that one bad row
costs one row.  Every value is bit for bit what ``float(text)`` gives, on both ways.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.replay.readers.cells import STAMP_LIMIT, parse_row, split_fields
from axialnav.replay.readers.columns import Column, Layout
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.header import STAMP_NAMES, place_columns, split_header

_LINE_END = re.compile(r"\r\n|\r|\n")
HEAD_LENGTH = 10_000
_NUMBER_STARTS = frozenset("0123456789+-")


@dataclass(frozen=True)
class Rows:
    """Rows of one file, in file order.

    Attributes
    ----------
    where
        File name for messages.
    t_ns
        Stamps [ns], shape (n,).
    values
        One array of shape (n,) per column found, float64 or (for text columns) str.
    text
        The whole file, for examples.
    numbers
        Line number (from 1) of every row, or None to find them when they are needed.
    """

    where: str
    t_ns: NDArray[np.int64]
    values: dict[Column, NDArray[Any]]
    text: str = field(repr=False, default="")
    numbers: NDArray[np.int64] | None = None

    @cached_property
    def _lines(self) -> list[tuple[int, str]]:
        return list(_data_lines(self.text))

    def example(self, row: int) -> str:
        """Line number and text of a row."""
        if self.numbers is None:
            number, text = self._lines[row]
            return f"line {number}: {text}"
        number = int(self.numbers[row])
        if not self.text:
            return f"message {number} at t_ns={self.t_ns[row]}"
        return f"line {number}: {_LINE_END.split(self.text)[number - 1]}"

    def subset(self, rows: NDArray[Any]) -> Rows:
        """The rows chosen by a mask or an index array."""
        numbers = self.numbers if self.numbers is not None else np.array([n for n, _ in self._lines], dtype=np.int64)
        values = {column: array[rows] for column, array in self.values.items()}
        return Rows(self.where, self.t_ns[rows], values, self.text, numbers[rows])


def read_rows(path: Path, layout: Layout, sensor: str, drops: DropLog) -> Rows:
    """Read a ``data.csv``.

    Rows that are short, long or not numbers are left out and noted in ``drops``; empty values become NaN.

    Raises
    ------
    FlightError
        The file cannot be opened, or its header does not fit ``layout``.
    """
    where = f"{sensor}/{path.name}"
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror or error}") from None
    header, start = _head(text)
    if start is None:
        return _no_rows(where, text)
    first = [line for _, line in islice(_data_lines(text[start : start + HEAD_LENGTH]), 5)]
    _require_commas(first[0], layout, where)
    width = _width(header, first)
    placed = place_columns(header, width, layout, where, drops)
    for index, column in enumerate(placed):
        if column is None:
            name = header[index + 1][0] if header and index + 1 < len(header) else f"column {index + 2}"
            drops.add(sensor, "column not known, not used", 1, name or f"column {index + 2}")
    # numpy's parser (2.4) can crash on characters beyond the basic plane in an integer field, so it gets ASCII alone
    fast = _parse_fast(path, placed) if text.isascii() else None
    if fast is not None:
        return Rows(where, fast[0], fast[1], text)
    return _parse_slow(text, placed, where, sensor, drops)


def _no_rows(where: str, text: str) -> Rows:
    return Rows(where, np.zeros(0, dtype=np.int64), {}, text, np.zeros(0, dtype=np.int64))


def _head(text: str) -> tuple[list[tuple[str, str]] | None, int | None]:
    """Header (names and units), if there is one, and where the first line of data begins, if there is one."""
    header = None
    for match in re.finditer(r"[^\r\n]+", text):
        line = match.group().strip()
        if not line:
            continue
        names = split_header(line)
        if line.startswith("#"):
            header = names if any(name in STAMP_NAMES for name, _ in names) else header
        elif _is_header(line):
            header = names
        else:
            return header, match.start()
    return header, None


def _require_commas(line: str, layout: Layout, where: str) -> None:
    """Refuse files with another separator, as spreadsheets write them where the comma is the decimal sign."""
    needed = sum(column.required for column in layout)
    for separator, name in ((";", "semicolons"), ("\t", "tabs"), (" ", "spaces")):
        found = line.count(separator)
        if found >= max(needed, 2) or (found and len(split_fields(line)) <= needed):
            if separator == " " and "," in line:
                continue
            raise FlightError(f"{where}: values are separated by {name}, must be by commas; convert the file")


def _width(header: list[tuple[str, str]] | None, lines: list[str]) -> int:
    """Columns of the file: those of the header, or more where the first rows agree on more."""
    counts = sorted(len(split_fields(line)) for line in lines)
    return max(len(header or ()), counts[len(counts) // 2])


def _is_header(line: str) -> bool:
    """Whether a line without ``#`` is a header: it names the stamp."""
    return line[0] not in _NUMBER_STARTS and any(name in STAMP_NAMES for name, _ in split_header(line))


def _data_lines(text: str) -> Iterator[tuple[int, str]]:
    """Line number and text of every line of data."""
    for number, line in enumerate(_LINE_END.split(text), start=1):
        content = line.partition("#")[0].strip()
        if content and not _is_header(content):
            yield number, line.strip()


def _parse_fast(path: Path, placed: list[Column | None]) -> tuple[NDArray[np.int64], dict[Column, NDArray[Any]]] | None:
    """Parse with :func:`numpy.loadtxt`; None where the file is not clean or holds free text."""
    if any(column is not None and column.text and not column.name.startswith("anchor") for column in placed):
        return None
    kinds = ["S1" if column is None else "i8" if column.text else "f8" for column in placed]
    names = [f"c{i}" for i in range(len(placed))]
    dtype = np.dtype([("t", "i8"), *zip(names, kinds, strict=True)])
    try:
        table = np.loadtxt(path, dtype=dtype, delimiter=",", encoding="utf-8-sig", ndmin=1)
    except (ValueError, OSError, UnicodeError):
        return None
    stamps = np.ascontiguousarray(table["t"])
    if len(stamps) and max(abs(int(stamps.min())), abs(int(stamps.max()))) >= STAMP_LIMIT:
        return None
    values: dict[Column, NDArray[Any]] = {}
    for name, column in zip(names, placed, strict=True):
        if column is not None:
            array = np.ascontiguousarray(table[name])
            values[column] = _as_text(array) if column.text else array
    return stamps, values


def _as_text(whole: NDArray[Any]) -> NDArray[Any]:
    """Integers to text, by way of the few distinct ones."""
    distinct, inverse = np.unique(whole, return_inverse=True)
    return np.array([str(value) for value in distinct.tolist()])[inverse]


def _parse_slow(text: str, placed: list[Column | None], where: str, sensor: str, drops: DropLog) -> Rows:
    bad: dict[str, list[str]] = {}
    numbers: list[int] = []
    stamps: list[int] = []
    rows: list[list[Any]] = []
    width = len(placed) + 1
    places = [i for i, column in enumerate(placed, start=1) if column is not None and column.required]
    needed = 1 + max(places, default=0)
    for number, line in _data_lines(text):
        fields = split_fields(line)
        row = parse_row(fields, placed, width, needed)
        if isinstance(row, str):
            bad.setdefault(row, []).append(f"line {number}: {line}")
            continue
        numbers.append(number)
        stamps.append(row[0])
        rows.append(row)
    for reason, examples in bad.items():
        drops.add(sensor, reason, len(examples), examples[0])
    values: dict[Column, NDArray[Any]] = {}
    for index, column in enumerate(placed):
        if column is not None:
            cells = [row[index + 1] for row in rows]
            values[column] = np.array(cells, dtype=np.str_ if column.text else np.float64)
    return Rows(where, np.array(stamps, dtype=np.int64), values, text, np.array(numbers, dtype=np.int64))
