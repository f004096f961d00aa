"""Fields of a log with sign and scale: ``-yacc``, ``0.01 * distance``, ``-flow_y * step_s``, ``lat_deg | 1e-7 * lat``.

Products and quotients of numbers and fields, nothing else: a mapping is data, not a program.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_TOKEN = re.compile(r"\s*([*/])\s*")
_ELEMENT = re.compile(r"(?P<name>.+)\[(?P<index>\d+)\]")
_CONDITION = re.compile(r"(?P<left>.+?)\s*(?P<sign>==|!=|<=|>=|<|>)\s*(?P<right>[-+.\deE]+)")


class MissingFieldError(KeyError):
    """None of an expression's alternatives can be computed; holds the first field that is missing."""


def column(columns: Mapping[str, NDArray[Any]], name: str) -> NDArray[Any]:
    """One field, or one element of an array field.

    Raises
    ------
    MissingFieldError
        There is none of that name.
    """
    if name in columns:
        return columns[name]
    element = _ELEMENT.fullmatch(name)
    if element and element["name"] in columns:
        array, index = columns[element["name"]], int(element["index"])
        if array.ndim == 2 and index < array.shape[1]:
            return np.asarray(array[:, index])
    raise MissingFieldError(name)


def evaluate(text: str, columns: Mapping[str, NDArray[Any]], rows: int) -> Array:
    """Values of an expression, shape (rows,), of the first alternative whose fields are all there.

    Raises
    ------
    MissingFieldError
        No alternative can be computed.
    """
    missing: MissingFieldError | None = None
    for alternative in text.split("|"):
        try:
            return _product(alternative.strip(), columns, rows)
        except MissingFieldError as error:
            missing = missing or error
    raise missing or MissingFieldError(text)


def _product(text: str, columns: Mapping[str, NDArray[Any]], rows: int) -> Array:
    sign = -1.0 if text.startswith("-") else 1.0
    parts = _TOKEN.split(text.lstrip("+-").strip())
    result = np.full(rows, sign)
    for operator, factor in zip(["*", *parts[1::2]], parts[::2], strict=True):
        value = _factor(factor, columns)
        result = result * value if operator == "*" else result / value
    return result


def _factor(text: str, columns: Mapping[str, NDArray[Any]]) -> Array | float:
    try:
        return float(text)
    except ValueError:
        return np.asarray(column(columns, text), dtype=np.float64)


def holds(text: str, columns: Mapping[str, NDArray[Any]], rows: int) -> NDArray[np.bool_]:
    """Which rows fulfil conditions like ``orientation == 25 and quality > 0``; one on an absent field always holds.

    Raises
    ------
    ValueError
        Not a condition.
    """
    kept = np.ones(rows, dtype=np.bool_)
    for part in text.split(" and "):
        match = _CONDITION.fullmatch(part.strip())
        if match is None:
            raise ValueError(f"{part.strip()!r} is no condition; write it like orientation == 25")
        try:
            left = evaluate(match["left"], columns, rows)
        except MissingFieldError:
            continue
        right = float(match["right"])
        compare = {"==": np.equal, "!=": np.not_equal, "<": np.less, ">": np.greater}
        compare |= {"<=": np.less_equal, ">=": np.greater_equal}
        kept &= compare[match["sign"]](left, right)
    return kept
