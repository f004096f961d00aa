"""ROS 2 message definitions: the text that stands in a recording, as a tree of fields.

Source: the ``.msg`` format (docs.ros.org, "Interfaces") and the ``ros2msg`` schema encoding of MCAP, which appends the
definition of every type that is used, each below a line of ``=``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

PRIMITIVES = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "float32": "f4",
    "float64": "f8",
    **{f"{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)},
}
BUILT_IN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
}
_FIELD = re.compile(r"(?P<type>[\w/]+)(?:<=\d+)?(?P<array>\[[^\]]*\])?\s+(?P<name>\w+)(?P<rest>.*)")
_SEPARATOR = re.compile(r"^=+\s*$\n^MSG:\s*(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message.

    Attributes
    ----------
    name
        As in the definition.
    kind
        numpy code of a primitive, ``"text"``, or ``"message"``.
    count
        None: one value.  -1: a sequence.  Else: an array of that length.
    fields
        Of a nested message.
    """

    name: str
    kind: str
    count: int | None = None
    fields: tuple[Field, ...] = ()


def short_name(name: str) -> str:
    """``pkg/msg/Type`` as ``pkg/Type``."""
    return name.replace("/msg/", "/")


def parse_definition(name: str, text: str) -> tuple[Field, ...]:
    """Fields of the message ``name`` whose definition, with those that it needs, is ``text``.

    Raises
    ------
    ValueError
        A type that is not defined, a wide string, a type within itself, or a line that is no field.
    """
    parts = _SEPARATOR.split(text)
    bodies = {**BUILT_IN, short_name(name): parts[0]}
    bodies.update(zip(map(short_name, parts[1::2]), parts[2::2], strict=True))
    return _fields(short_name(name), bodies, ())


def _fields(name: str, bodies: dict[str, str], above: tuple[str, ...]) -> tuple[Field, ...]:
    if name in above:
        raise ValueError(f"message {name} contains itself")
    if name not in bodies:
        raise ValueError(f"no definition of message {name}")
    found = []
    for line in bodies[name].splitlines():
        content = line.partition("#")[0].strip()
        match = _FIELD.fullmatch(content)
        if not content or (match and match["rest"].lstrip().startswith("=")):
            continue
        if match is None:
            raise ValueError(f"message {name}: no field: {content[:60]!r}")
        found.append(_field(match, name, bodies, (*above, name)))
    return tuple(found) or (Field("structure_needs_at_least_one_member", "u1"),)


def _field(match: re.Match[str], owner: str, bodies: dict[str, str], above: tuple[str, ...]) -> Field:
    kind, array = match["type"], match["array"]
    count = None if array is None else int(array[1:-1]) if array[1:-1].isdigit() else -1
    if kind in PRIMITIVES:
        return Field(match["name"], PRIMITIVES[kind], count)
    if kind == "string":
        return Field(match["name"], "text", count)
    if kind == "wstring":
        raise ValueError(f"message {owner}: wide strings are not read")
    full = short_name(kind)
    if "/" not in full:
        beside = f"{owner.rpartition('/')[0]}/{full}"
        full = beside if beside in bodies else "std_msgs/Header" if full == "Header" else beside
    return Field(match["name"], "message", count, _fields(full, bodies, above))
