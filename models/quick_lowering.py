"""Lowering of scalar code without the detours of numba's own.

numba writes every array that is indexed, and every attribute that is one, into memory of its own and reads the pieces
back; it gives most variables a place in memory, asks an overload resolver what the sum of two floats is, and keeps
count in every loop.  LLVM removes all that again.  Writing it takes half of the time that compiling takes, so here an
array is known by its pieces and indexed at once, and plain arithmetic is written as what it is.  The machine code comes
out with the same operations on numbers in the same order.

What is not handled here is left to numba.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from numba.core import cgutils, ir, lowering, types
from numba.core.cgutils import ir as ll
from numba.core.errors import LoweringError, new_error_context  # type: ignore[attr-defined]

from axialnav.models.pieces import (
    LAZY,
    LOOP,
    MEMBERS,
    WORD,
    Next,
    Pieces,
    Range,
    Running,
    Several,
    known,
    piece,
    product,
    total,
    word,
)
from axialnav.models.quick_passes import POWERS

FLOAT, INT = types.float64, types.int64


Write = Callable[[Any, Any, Any], Any]  # from the builder and two operands


def _plain(instruction: str) -> Write:
    return lambda builder, x, y: getattr(builder, instruction)(x, y)


def _whole(name: str) -> Write:
    at_once = getattr(operator, name)

    def write(builder: Any, x: Any, y: Any) -> Any:
        """The operation, at once where both operands are known."""
        if known(x) and known(y):
            return word(at_once(x.constant, y.constant))
        return getattr(builder, name)(x, y, flags=["nsw"])

    return write


def _comparison(instruction: str, sign: str) -> Write:
    return lambda builder, x, y: getattr(builder, instruction)(sign, x, y)


def _arithmetic() -> dict[Any, Write]:
    table: dict[Any, Write] = {}
    for name in ("add", "sub", "mul", "truediv"):
        for way in (getattr(operator, name), getattr(operator, "i" + name)):
            table[way, FLOAT] = _plain("f" + name.removeprefix("true"))
            if name != "truediv":
                table[way, INT] = _whole(name)
    signs = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq}
    for sign, way in {**signs, "!=": operator.ne}.items():
        table[way, FLOAT] = _comparison("fcmp_unordered" if sign == "!=" else "fcmp_ordered", sign)
        table[way, INT] = _comparison("icmp_signed", sign)
    return table


ARITHMETIC = _arithmetic()


class QuickLower(lowering.Lower):  # type: ignore[misc]
    """Lowering of one kernel."""

    def _find_singly_assigned_variable(self) -> None:
        """Variables that need no place in memory: after numba's SSA a single assignment comes before every use."""
        assigned: Counter[str] = Counter()
        for block in self.blocks.values():
            assigned.update(inst.target.name for inst in block.body if type(inst) is ir.Assign)
        self._singly_assigned_vars = {name for name, count in assigned.items() if count == 1}
        self._blk_local_varmap: dict[str, Any] = {}

    def lower_block(self, block: Any) -> None:
        """Lower a block; an error says the line."""
        with new_error_context("lowering {where}", where=self.func_ir.func_id.func_qualname):
            for inst in block.body:
                self.loc = inst.loc
                self.lower_inst(inst)

    def lower_inst(self, inst: Any) -> None:
        """Lower a statement."""
        kind = type(inst)
        if kind is ir.Assign:
            self.storevar(self._assigned(inst), inst.target.name)
            return
        done = False
        if kind is ir.SetItem or kind is ir.StaticSetItem:
            done = self._set_item(inst, inst.index)
        elif kind is ir.SetAttr:
            done = self._set_attribute(inst)
        if not done:
            super().lower_inst(inst)

    def loadvar(self, name: str) -> Any:
        """Value of a variable as numba passes it on."""
        value = self._raw(name)
        return value.value(self.context, self.builder) if isinstance(value, LAZY) else value

    def _raw(self, name: str) -> Any:
        """Value of a variable, perhaps in pieces."""
        known = self._blk_local_varmap.get(name)
        return known if known is not None else self.builder.load(self.getvar(name))

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Give a variable its value."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
            return
        if isinstance(value, LOOP):
            raise LoweringError("a loop over one of several ranges", loc=self.loc)
        whole = value.value(self.context, self.builder) if isinstance(value, LAZY) else value
        self.builder.store(whole, self.getvar(name))

    def _assigned(self, inst: Any) -> Any:
        """Value on the right of an assignment."""
        value, to = inst.value, self.typeof(inst.target.name)
        if type(value) is ir.Var:
            given = self.typeof(value.name)
            if given == to:
                return self._raw(value.name)
        elif type(value) is ir.Expr:
            handle = getattr(self, "_" + value.op, None)
            found = handle(value, to) if handle is not None else None
            if found is not None:
                return found
        return self.lower_assign(to, inst)

    def _convert(self, value: Any, given: Any, to: Any) -> Any:
        return value if given == to else self.context.cast(self.builder, value, given, to)

    # operators

    def _binop(self, expr: Any, to: Any) -> Any:
        signature = self.fndesc.calltypes[expr]
        kind = signature.args[0]
        if kind == FLOAT and expr.fn in POWERS and type(expr.static_rhs) is int and expr.static_rhs == 2:
            x = self._convert(self._raw(expr.lhs.name), self.typeof(expr.lhs.name), kind)
            return self._convert(self.builder.fmul(x, x), signature.return_type, to)
        write = ARITHMETIC.get((expr.fn, kind)) if signature.args[1] == kind else None
        if write is None:
            return None
        x, y = (self._convert(self._raw(v.name), self.typeof(v.name), kind) for v in (expr.lhs, expr.rhs))
        return self._convert(write(self.builder, x, y), signature.return_type, to)

    _inplace_binop = _binop

    def _build_tuple(self, expr: Any, to: Any) -> Any:
        kinds = [self.typeof(v.name) for v in expr.items]
        if not all(isinstance(kind, types.Number) for kind in kinds):
            return None
        values = (self._convert(self._raw(v.name), kind, of) for v, kind, of in zip(expr.items, kinds, to, strict=True))
        return Several(to, tuple(values))

    def _exhaust_iter(self, expr: Any, to: Any) -> Any:
        value = self._raw(expr.value.name)
        return value if isinstance(value, Several) and value.kind == to else None

    # loops

    def _call(self, expr: Any, to: Any) -> Any:
        function = self.typeof(expr.func.name)
        key = getattr(function, "typing_key", None)
        if key is range and to == types.range_state64_type and not expr.vararg:
            bounds = [self._convert(self._raw(v.name), self.typeof(v.name), INT) for v in expr.args]
            if len(bounds) < 3 or (known(bounds[2]) and bounds[2].constant != 0):
                start, stop = (word(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
                return Range(start, stop, bounds[2].constant if len(bounds) == 3 else 1)
        signature = self.fndesc.calltypes[expr]
        if key in (max, min) and len(signature.args) == 2 and set(signature.args) in ({FLOAT}, {INT}):
            kind = signature.args[0]
            first, second = (self._convert(self._raw(v.name), self.typeof(v.name), kind) for v in expr.args)
            better = ARITHMETIC[operator.gt if key is max else operator.lt, kind](self.builder, second, first)
            return self._convert(self.builder.select(better, second, first), kind, to)
        return None

    def _getiter(self, expr: Any, to: Any) -> Any:
        over = self._raw(expr.value.name)
        if not isinstance(over, Range):
            return None
        place = cgutils.alloca_once(self.builder, WORD)
        self.builder.store(over.start, place)
        return Running(over, place)

    def _iternext(self, expr: Any, to: Any) -> Any:
        loop = self._raw(expr.value.name)
        if not isinstance(loop, Running):
            return None
        number = self.builder.load(loop.place)
        valid = self.builder.icmp_signed("<" if loop.over.step > 0 else ">", number, loop.over.stop)
        self.builder.store(self.builder.add(number, word(loop.over.step)), loop.place)
        return Next(number, valid)

    def _pair_first(self, expr: Any, to: Any) -> Any:
        pair = self._raw(expr.value.name)
        return self._convert(pair.number, INT, to) if isinstance(pair, Next) else None

    def _pair_second(self, expr: Any, to: Any) -> Any:
        pair = self._raw(expr.value.name)
        return pair.valid if isinstance(pair, Next) else None

    # records

    def _getattr(self, expr: Any, to: Any) -> Any:
        kind = self.typeof(expr.value.name)
        if not isinstance(kind, types.Record):
            return None
        member, place = kind.typeof(expr.attr), self._member(kind, expr.value.name, expr.attr)
        if isinstance(member, types.NestedArray):
            if not isinstance(to, types.Array):
                return None
            return Pieces(to, place, tuple(map(word, member.shape)), tuple(map(word, member.strides)))
        value = self.context.unpack_value(self.builder, member, place, None if kind.aligned else 1)
        return self._convert(value, member, to)

    def _member(self, kind: Any, name: str, attribute: str) -> Any:
        """Pointer to a member of a record."""
        member = kind.typeof(attribute)
        item = member.dtype if isinstance(member, types.NestedArray) else member
        zero = ll.Constant(ll.IntType(32), 0)
        offset = ll.Constant(ll.IntType(32), kind.offset(attribute))
        at = self.builder.gep(self._raw(name), [zero, offset], inbounds=True)
        return self.builder.bitcast(at, self.context.get_data_type(item).as_pointer())

    def _set_attribute(self, inst: Any) -> bool:
        kind = self.typeof(inst.target.name)
        if not isinstance(kind, types.Record) or isinstance(kind.typeof(inst.attr), types.NestedArray):
            return False
        member = kind.typeof(inst.attr)
        value = self._convert(self._raw(inst.value.name), self.typeof(inst.value.name), member)
        place = self._member(kind, inst.target.name, inst.attr)
        self.context.pack_value(self.builder, member, value, place, None if kind.aligned else 1)
        return True

    # arrays

    def _getitem(self, expr: Any, to: Any) -> Any:
        indices = self._indices(expr.index)
        found = self._element(expr.value.name, indices) if indices is not None else None
        if found is None:
            return None
        kind, pieces, place = found
        if len(indices or ()) == kind.ndim:
            value = self.context.unpack_value(self.builder, kind.dtype, place, None if kind.aligned else 1)
            return self._convert(value, kind.dtype, to)
        if not isinstance(to, types.Array):
            return None
        used = len(indices or ())
        return Pieces(to, place, pieces.shape[used:], pieces.strides[used:])

    def _static_getitem(self, expr: Any, to: Any) -> Any:
        kind = self.typeof(expr.value.name)
        if isinstance(kind, types.Array):
            return self._getitem(expr, to)
        value = self._raw(expr.value.name)
        if isinstance(value, Several) and type(expr.index) is int:
            return self._convert(value.values[expr.index], value.kind[expr.index], to)
        return None

    def _set_item(self, inst: Any, index: Any) -> bool:
        kind = self.typeof(inst.target.name)
        if not isinstance(kind, types.Array) or isinstance(kind.dtype, types.Record | types.NestedArray):
            return False
        indices = self._indices(index)
        if indices is None or len(indices) != kind.ndim or isinstance(self.typeof(inst.value.name), types.Array):
            return False
        found = self._element(inst.target.name, indices)
        if found is None:
            return False
        value = self._convert(self._raw(inst.value.name), self.typeof(inst.value.name), kind.dtype)
        self.context.pack_value(self.builder, kind.dtype, value, found[2], None if kind.aligned else 1)
        return True

    def _indices(self, index: Any) -> list[Any] | None:
        """Numbers of 64 bits that an index consists of; None where it is anything else."""
        if isinstance(index, ir.Var):
            value, kind = self._raw(index.name), self.typeof(index.name)
            if isinstance(value, Several):
                values, kinds = list(value.values), list(value.kind)
            elif isinstance(kind, types.Integer):
                values, kinds = [value], [kind]
            else:
                return None
            if not all(isinstance(k, types.Integer) and k.signed for k in kinds):  # type: ignore[attr-defined]
                return None
            return [self._convert(v, k, INT) for v, k in zip(values, kinds, strict=True)]
        numbers = index if isinstance(index, tuple) else (index,)
        return [word(n) for n in numbers] if all(type(n) is int and n >= 0 for n in numbers) else None

    def _element(self, name: str, indices: Sequence[Any]) -> tuple[Any, Pieces, Any] | None:
        """Type and pieces of an array, and pointer to what the indices choose of it."""
        kind = self.typeof(name)
        if not isinstance(kind, types.Array) or kind.layout not in "CA" or len(indices) > kind.ndim:
            return None
        array = self._pieces(kind, self._raw(name))
        at = [self._from_start(index, length) for index, length in zip(indices, array.shape, strict=False)]
        if kind.layout == "A":
            return kind, array, self._by_strides(array, at)
        offset = word(0)
        for axis, number in enumerate(at):
            step = word(1)
            for length in array.shape[axis + 1 :]:
                step = product(self.builder, step, length)
            offset = total(self.builder, offset, product(self.builder, number, step))
        return kind, array, self.builder.gep(array.data, [offset])

    def _by_strides(self, array: Pieces, at: Sequence[Any]) -> Any:
        offset = word(0)
        for number, stride in zip(at, array.strides, strict=False):
            offset = total(self.builder, offset, product(self.builder, number, stride))
        return cgutils.pointer_add(self.builder, array.data, offset)

    def _from_start(self, index: Any, length: Any) -> Any:
        """An index as it counts from the start; below zero it counts from the end."""
        if known(index) and index.constant >= 0:
            return index
        below = self.builder.icmp_signed("<", index, word(0))
        return self.builder.select(below, self.builder.add(index, length), index)

    def _pieces(self, kind: Any, value: Any) -> Pieces:
        if isinstance(value, Pieces):
            return value
        shape, strides = (
            tuple(piece(self.builder, value, MEMBERS[name], axis) for axis in range(kind.ndim))
            for name in ("shape", "strides")
        )
        return Pieces(kind, piece(self.builder, value, MEMBERS["data"]), shape, strides)
