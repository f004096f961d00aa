"""Passes of numba's front end, cut down to what scalar code needs.

numba works out after every pass which variables are alive where, for code that owns memory or gives values one by one;
scalar code does neither.
"""

from __future__ import annotations

import operator
from typing import Any

from numba.core import ir, ir_utils, transforms, typed_passes, untyped_passes
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.errors import ConstantInferenceError
from numba.core.ssa import reconstruct_ssa

POWERS = operator.pow, operator.ipow


class _Pass(FunctionPass):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__()


@register_pass(mutates_CFG=True, analysis_only=False)
class Tidy(_Pass):
    """Give every loop one way back."""

    _name = "tidy"

    def run_pass(self, state: Any) -> bool:
        """Change the blocks."""
        state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class Constants(_Pass):
    """Mark indices and exponents that are constant."""

    _name = "constants"

    def run_pass(self, state: Any) -> bool:
        """Change the statements."""
        for block in state.func_ir.blocks.values():
            for place, inst in enumerate(block.body):
                if type(inst) is ir.Assign and type(inst.value) is ir.Expr:
                    self._mark(inst, state.func_ir)
                elif type(inst) is ir.SetItem:
                    index = self._constant(state.func_ir, inst.index)
                    if index is not None:
                        block.body[place] = ir.StaticSetItem(inst.target, index, inst.index, inst.value, inst.loc)
        return True

    def _mark(self, inst: Any, func_ir: Any) -> None:
        expr = inst.value
        if expr.op == "getitem":
            index = self._constant(func_ir, expr.index)
            if index is not None:
                inst.value = ir.Expr.static_getitem(expr.value, index, expr.index, expr.loc)
        elif expr.op in ("binop", "inplace_binop") and expr.fn in POWERS:
            power = self._constant(func_ir, expr.rhs)
            if power is not None:
                expr.static_rhs = power

    @staticmethod
    def _constant(func_ir: Any, name: Any) -> Any:
        try:
            return func_ir.infer_constant(name)
        except ConstantInferenceError:
            return None


@register_pass(mutates_CFG=False, analysis_only=False)
class SingleAssignment(_Pass):
    """numba's static single assignment."""

    _name = "single_assignment"

    def run_pass(self, state: Any) -> bool:
        """Change the statements."""
        state.func_ir = reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class NoPhis(typed_passes.PreLowerStripPhis):  # type: ignore[misc]
    """What joins values is made assignments where they come from."""

    _name = "no_phis"

    def run_pass(self, state: Any) -> bool:
        """Change the statements."""
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        return True


BEFORE_TYPES = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    Tidy,
    untyped_passes.RewriteSemanticConstants,
    Constants,
    SingleAssignment,
)
