"""Values inside a kernel while it is lowered: numbers known beforehand, arrays in pieces, loops under way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numba.core import cgutils
from numba.core.cgutils import ir as ll

WORD = ll.IntType(64)
MEMBERS = {"meminfo": 0, "parent": 1, "nitems": 2, "itemsize": 3, "data": 4, "shape": 5, "strides": 6}


def word(value: int) -> Any:
    """A number of 64 bits."""
    return ll.Constant(WORD, value)


def known(value: Any) -> bool:
    """Whether a number is known while compiling."""
    return isinstance(value, ll.Constant) and isinstance(value.constant, int)


def product(builder: Any, a: Any, b: Any) -> Any:
    """``a * b``, at once where both are known."""
    if known(a) and known(b):
        return word(a.constant * b.constant)
    if known(a) and a.constant == 1:
        return b
    return a if known(b) and b.constant == 1 else builder.mul(a, b)


def total(builder: Any, a: Any, b: Any) -> Any:
    """``a + b``, at once where both are known."""
    if known(a) and known(b):
        return word(a.constant + b.constant)
    if known(a) and a.constant == 0:
        return b
    return a if known(b) and b.constant == 0 else builder.add(a, b)


def piece(builder: Any, aggregate: Any, *place: int) -> Any:
    """Member of a struct or array value, looked up where it was put in rather than read back."""
    value = aggregate
    while isinstance(value, ll.InsertValue):
        put = tuple(value.indices)
        if put == place:
            return value.operands[1]
        if put == place[: len(put)]:
            return piece(builder, value.operands[1], *place[len(put) :])
        value = value.operands[0]
    return builder.extract_value(aggregate, place)


@dataclass(frozen=True)
class Pieces:
    """An array that is known by its pieces."""

    kind: Any  # numba's type
    data: Any
    shape: tuple[Any, ...]
    strides: tuple[Any, ...]

    def value(self, context: Any, builder: Any) -> Any:
        """The array as numba passes it on."""
        struct = context.get_value_type(self.kind)
        item = context.get_abi_sizeof(context.get_data_type(self.kind.dtype))
        count = word(1)
        for length in self.shape:
            count = product(builder, count, length)
        shape, strides = (cgutils.pack_array(builder, v, WORD) for v in (self.shape, self.strides))
        value = ll.Constant(struct, None)
        for name, part in {
            "nitems": count, "itemsize": word(item), "data": self.data, "shape": shape, "strides": strides,
        }.items():  # fmt: skip
            value = builder.insert_value(value, part, MEMBERS[name])
        return value


@dataclass(frozen=True)
class Several:
    """A tuple of numbers that has not been put together."""

    kind: Any
    values: tuple[Any, ...]

    def value(self, context: Any, builder: Any) -> Any:
        """The tuple as numba passes it on."""
        return context.make_tuple(builder, self.kind, self.values)


@dataclass(frozen=True)
class Range:
    """What a loop runs over, by a known step."""

    start: Any
    stop: Any
    step: int


@dataclass(frozen=True)
class Running:
    """A loop under way; ``place`` is where its next number is kept."""

    over: Range
    place: Any


@dataclass(frozen=True)
class Next:
    """Next number of a loop, and whether there is one."""

    number: Any
    valid: Any


LAZY = Pieces, Several
LOOP = Range, Running, Next
