"""Strict TOML: text to typed structures and back, with errors that name the nearest key.

msgspec does the type checks; this module turns its findings into one line that a person can act on, and writes TOML
that reads back to an equal structure.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec.structs import FieldInfo

from axialnav.fusion.errors import ConfigError

T = TypeVar("T")
MAX_BYTES = 16 << 20
_UNKNOWN = re.compile(r"unknown field `(?P<field>[^`]+)`(?: - at `(?P<path>[^`]+)`)?")
_NO_CHOICE = re.compile(r"Invalid enum value .*, at `[^`]*?(?P<field>\w+)(?:\[[^`]*\])*`")
_NAMELESS = re.compile(r"`\$(?P<path>(?:\.\w+)*)\[\.\.\.\]")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def decode(data: Mapping[str, Any], kind: type[T], *, where: str) -> T:
    """Convert plain data to ``kind``.

    Raises
    ------
    ConfigError
        Unknown key (with the nearest known one), wrong type, not a number, or value out of limits; ``where`` names the
        source.
    """
    for path in _not_numbers(data, ""):
        raise ConfigError(f"{where}: {path} must be a finite number; correct it or leave it out")
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{where}: {_explain(_located(str(error), data, kind), kind)}") from None


def _located(message: str, data: Mapping[str, Any], kind: type[Any]) -> str:
    """A message of msgspec's with the name of the table, for which it says ``[...]``."""
    found = _NAMELESS.search(message)
    if found is None:
        return message
    keys = found["path"].split(".")[1:]
    tables: Any = data
    for key in keys:
        tables = tables[key]
    for name, table in tables.items():
        alone: Any = {name: table}
        for key in reversed(keys):
            alone = {key: alone}
        try:
            msgspec.convert(alone, kind)
        except msgspec.ValidationError as error:
            if str(error) == message:
                return message.replace("[...]", f".{name}", 1)
    return message


def _not_numbers(node: Any, path: str) -> Iterator[str]:
    """Yield where in plain data a nan is; one in a position would blind the filter without a word."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _not_numbers(value, f"{path}.{key}" if path else str(key))
    elif isinstance(node, list | tuple):
        for index, value in enumerate(node):
            yield from _not_numbers(value, f"{path}.{index}")
    elif isinstance(node, float) and math.isnan(node):
        yield path


def read_text(path: Path, what: str) -> str:
    """Text of a settings file.

    Raises
    ------
    ConfigError
        No file, not readable, no text, or larger than any settings are; ``what`` says what it was meant to be.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ConfigError(
                f"{what} {path}: {size} bytes, but no settings file is larger than {MAX_BYTES}; name another"
            )
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{what} {path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{what} {path}: cannot be read: it is not a text file, and settings are TOML") from None


def parse(text: str, *, where: str) -> dict[str, Any]:
    """Parse TOML text; a syntax error becomes one :class:`ConfigError` line."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where}: not valid TOML: {error}") from None


def _explain(message: str, kind: type[Any]) -> str:
    found = _UNKNOWN.search(message)
    if not found:
        plain = message.replace("$.", "").replace(" - at ", ", at ")
        choice = _NO_CHOICE.search(plain)
        return f"{plain}; there are {', '.join(_choices(kind, choice['field']))}" if choice else plain
    field = found["field"]
    table = (found["path"] or "$").removeprefix("$").removeprefix(".")
    near = difflib.get_close_matches(field, list(_all_fields(kind)), n=1, cutoff=0.5)
    hint = f"; did you mean `{near[0]}`?" if near else ""
    return f"unknown key `{table + '.' if table else ''}{field}`{hint}"


def _choices(kind: type[Any], name: str) -> list[str]:
    """All words that fields of a name take."""
    words: dict[str, None] = {}
    stack = [field.type for field in _fields(kind) if field.encode_name == name]
    while stack:
        node = stack.pop(0)
        if isinstance(node, str):
            words[node] = None
        else:
            stack = [*getattr(node, "__args__", ()), *stack]
    return list(words)


def _all_fields(kind: type[Any]) -> Iterator[str]:
    """Yield every key that can occur anywhere below ``kind``."""
    return (field.encode_name for field in _fields(kind))


def _fields(kind: type[Any]) -> Iterator[FieldInfo]:
    """Yield every field that can occur anywhere below ``kind``."""
    seen: set[type[Any]] = set()
    stack: list[Any] = [kind]
    while stack:
        node = stack.pop()
        if isinstance(node, type) and issubclass(node, msgspec.Struct):
            if node in seen:
                continue
            seen.add(node)
            for field in msgspec.structs.fields(node):
                yield field
                stack.append(field.type)
        else:
            stack.extend(getattr(node, "__args__", ()))


def set_by_path(data: dict[str, Any], path: str, text: str) -> None:
    """Set ``data`` at a dotted ``path`` to the TOML value ``text`` (a bare word is taken as a string), in place.

    Raises
    ------
    ConfigError
        Empty path, or a path that runs through something that is not a table.
    """
    *tables, key = path.split(".")
    if not key or not all(tables):
        raise ConfigError(f"parameter name must be dotted like uwb.sigma_m, got {path!r}")
    for name in tables:
        if data.get(name) is None:
            data[name] = {}
        data = data[name]
        if not isinstance(data, dict):
            raise ConfigError(f"parameter {path!r} runs through {name!r}, which is a value and not a table")
    try:
        data[key] = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        data[key] = text


def dump(data: Mapping[str, Any]) -> str:
    """Write plain data as TOML; floats keep every bit, None is left out."""
    return "\n".join(_lines(data, ())).strip() + "\n"


def _lines(data: Mapping[str, Any], prefix: tuple[str, ...]) -> Iterator[str]:
    tables: list[tuple[str, Mapping[str, Any]]] = []
    arrays: list[tuple[str, list[Mapping[str, Any]]]] = []
    for key, value in data.items():
        if isinstance(value, Mapping):
            tables.append((key, value))
        elif isinstance(value, list | tuple) and value and all(isinstance(v, Mapping) for v in value):
            arrays.append((key, list(value)))
        elif value is not None:
            yield f"{_key(key)} = {_value(value)}"
    for key, table in tables:
        if any(not isinstance(v, Mapping) for v in table.values()) or not table:
            yield f"\n[{'.'.join(map(_key, (*prefix, key)))}]"
        yield from _lines(table, (*prefix, key))
    for key, rows in arrays:
        for row in rows:
            yield f"\n[[{'.'.join(map(_key, (*prefix, key)))}]]"
            yield from _lines(row, (*prefix, key))


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return msgspec.json.encode(value).decode().replace("\x7f", "\\u007f")  # JSON allows it bare, TOML does not
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ("nan" if value != value else f"{'-' * (value < 0)}inf")
    if isinstance(value, int):
        return str(value)
    return f"[{', '.join(_value(v) for v in value)}]"
