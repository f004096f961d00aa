"""How numba is made to compile a tree of small kernels once instead of once a level.

By itself numba optimises every compiled function together with all that it calls, emits machine code for it and wraps
it for Python: a tree of a hundred small functions goes through LLVM many times over, and nearly all of that work is
thrown away.  Here a kernel that is called by another one ends as a *part*: its unoptimised LLVM module, nothing else.
Only a kernel that is called from Python becomes a *whole*: all parts below it are linked into one module, made private
to it, optimised once and emitted once.

Parts are kept on disk as bitcode, with the names of the parts that they call, so that another whole (the streaming
filter beside the replay) needs no second type inference.

The front end is cut down to what scalar code needs: no array expressions, closures, objects or memory of its own.
Operators on the same types are resolved once per process instead of at every place where they stand.

This leans on numba's inside; :mod:`axialnav.models.scalar_kernel` uses it with the versions that it was tried with.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import importlib
import operator
from collections.abc import Iterator
from typing import Any

from numba import _dynfunc
from numba.core import codegen, compiler, errors, funcdesc, typed_passes, typeinfer, types, typing
from numba.core.caching import CompileResultCacheImpl
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.environment import Environment
from numba.core.errors import NumbaWarning

from axialnav.models.quick_lowering import QuickLower
from axialnav.models.quick_passes import BEFORE_TYPES, NoPhis

FIRST_WITHOUT_GATHER = 17  # first LLVM that can be told to leave gathers and scatters alone
TWO_ALIKE = (types.float64,) * 2, (types.int64,) * 2
Call = tuple[str, str, tuple[Any, ...]]  # module, name and argument types of a kernel that a part calls


class PartLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of one kernel for use inside others, as it comes out of the front end.

    Attributes
    ----------
    call
        Where the kernel is found, and its argument types.
    """

    call: Call
    _shared_module: Any

    def calls(self) -> list[PartLibrary]:
        """Parts that are called directly."""
        return [library for library in self._linking_libraries if isinstance(library, PartLibrary)]

    def own_module(self) -> Any:
        """The kernel's module with numba's own helpers linked in, symbols mergeable."""
        if self._shared_module is None:
            module = self._final_module
            for library in self._linking_libraries:
                if not isinstance(library, PartLibrary):
                    module.link_in(library._get_module_for_linking(), preserve=True)
            for function in module.functions:
                if not function.is_declaration and function.linkage == codegen.ll.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module = module
        return self._shared_module

    def _everything(self, seen: dict[PartLibrary, None]) -> Iterator[PartLibrary]:
        if self not in seen:
            seen[self] = None
            yield self
            for part in self.calls():
                yield from part._everything(seen)

    def _get_module_for_linking(self) -> Any:
        whole = self.own_module().clone()
        for part in list(self._everything({}))[1:]:
            whole.link_in(part.own_module(), preserve=True)
        return whole

    def _ensure_finalized(self) -> None:
        """Nothing: parts are finished in the whole that they go into."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    @classmethod
    def from_bitcode(cls, name: str, call: Call, bitcode: bytes, calls: list[PartLibrary]) -> PartLibrary:
        """Library of a part that was kept on disk."""
        from numba.core.registry import cpu_target

        library = cls(cpu_target.target_context.codegen(), name)
        library.call = call
        library._linking_libraries = list(calls)
        library._final_module = library._shared_module = codegen.ll.parse_bitcode(bitcode)
        return library


@functools.cache
def _machine(generator: Any) -> Any:
    """Target machine of the optimiser: numba's, but without the instructions that gather a vector from many places.

    LLVM takes them to be quick and turns loops over rows of eight into loops over eight rows; here they doubled the
    time of a prediction.
    """
    options: dict[str, Any] = {"opt": 3}
    generator._customize_tm_options(options)
    triple = codegen.ll.get_process_triple()
    if triple.startswith("x86") and codegen.ll.llvm_version_info[0] >= FIRST_WITHOUT_GATHER:
        options["features"] += ",+prefer-no-gather,+prefer-no-scatter"
    return codegen.ll.Target.from_triple(triple).create_target_machine(**options)


class WholeLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code of one kernel for Python and of everything that it calls, optimised together."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == codegen.ll.Linkage.linkonce_odr:
                # inlined where it is called once, and left out where it never is; without a name in the object code,
                # because the loader would hand out a function whose arguments were optimised away under that name
                function.linkage = "private"
        builder = codegen.create_pass_builder(_machine(self._codegen), opt=2, loop_vectorize=True, slp_vectorize=True)
        builder.getModulePassManager().run(self._final_module, builder)


class _Inference(typeinfer.TypeInferer):  # type: ignore[misc]
    """numba's type inference with a memory for built-in functions: their result depends on the types alone."""

    known: dict[Any, Any] = {}  # noqa: RUF012  shared on purpose, as numba's own type registry is

    def resolve_call(self, fnty: Any, pos_args: tuple[Any, ...], kw_args: dict[str, Any]) -> Any:
        """Signature of a call."""
        if kw_args or isinstance(fnty, types.Dispatcher | types.RecursiveCall | types.FunctionType):
            return super().resolve_call(fnty, pos_args, kw_args)
        plain = tuple(types.misc.unliteral(a) for a in pos_args)
        if all(isinstance(a, types.Number | types.Boolean) for a in plain[fnty is operator.getitem :]):
            pos_args = plain  # numbers in the source are as good as variables
            if getattr(fnty, "typing_key", None) in (max, min) and pos_args in TWO_ALIKE:
                return typing.signature(pos_args[0], *pos_args)  # else numba compiles a function for it
        key = fnty, pos_args
        if key not in self.known:
            self.known[key] = super().resolve_call(fnty, pos_args, kw_args)
        return self.known[key]


@register_pass(mutates_CFG=True, analysis_only=False)
class ScalarTypeInference(typed_passes.BaseTypeInference):  # type: ignore[misc]
    """Type inference of one kernel."""

    _name = "scalar_type_inference"

    def run_pass(self, state: Any) -> bool:
        """Find the types of all variables and calls."""
        warned = errors.WarningsFixer(NumbaWarning)  # type: ignore[attr-defined]
        inference = _Inference(state.typingctx, state.func_ir, warned)
        with state.typingctx.callstack.register(state.targetctx.target, inference, state.func_ir.func_id, state.args):
            for index, (name, given) in enumerate(zip(state.func_ir.arg_names, state.args, strict=True)):
                inference.seed_argument(name, index, given)
            if state.return_type is not None:
                inference.seed_return(state.return_type)
            inference.build_constraint()
            inference.propagate()
            state.typemap, state.return_type, state.calltypes = inference.unify()
        return True


def _mangle(name: str, argument_types: tuple[Any, ...], *, abi_tags: Any = (), uid: Any = None) -> str:
    """Symbol of a function, the same in every process; numba puts the number into it that a record has in this one."""
    described = hashlib.sha256(",".join(map(str, argument_types)).encode()).hexdigest()[:24]
    return str(funcdesc.default_mangler(name, (), abi_tags=(*abi_tags, described), uid=uid))


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """Lowering of a part: no machine code."""

    _name = "part_lowering"
    lowering_class = QuickLower

    def run_pass(self, state: Any) -> bool:
        """Write the kernel's LLVM module and make it callable from other kernels."""
        target, function = state.targetctx, state.func_id
        # numba numbers functions as they come, but one process links what another has kept: names have to be the same
        function.unique_id = function.firstlineno
        state.library = PartLibrary(target.codegen(), function.func_qualname)
        state.library.call = function.modname, function.func_qualname, tuple(state.args)
        state.flags.no_compile = True
        target.mangler = _mangle
        try:
            super().run_pass(state)
        finally:
            vars(target).pop("mangler", None)
        result = state["cr"]
        entry = _insert(target, result.fndesc, state.library, result.env)
        state["cr"] = result._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class WholeLowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """Lowering of a whole."""

    _name = "whole_lowering"
    lowering_class = QuickLower

    def run_pass(self, state: Any) -> bool:
        """Write the kernel's LLVM module, link its parts, optimise, emit."""
        state.library = WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


def _insert(target: Any, description: Any, library: PartLibrary, environment: Any) -> Any:
    """Tell numba how a part is called; the object returned stands for it and has no code."""
    module, name = description.lookup_module(), description.qualname.split(".")[-1]
    entry = _dynfunc.make_function(module, name, "part of other kernels", 0, environment, (library,))
    target.insert_user_function(entry, description, [library])
    return entry


class _Flags(compiler.Flags):  # type: ignore[misc]
    """numba's flags, quicker to compare: they are part of the key of nearly everything that it looks up."""

    def __hash__(self) -> int:
        return hash(tuple(self._values))

    def __eq__(self, other: object) -> bool:
        if type(other) is _Flags:
            return bool(self._values == other._values)
        return bool(super().__eq__(other))


class _ScalarCompiler(compiler.CompilerBase):  # type: ignore[misc]
    lowering: Any

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = _Flags(self.state.flags)

    def define_pipelines(self) -> list[PassManager]:
        """The passes that scalar code needs."""
        passes = PassManager("scalar kernel")
        for one in (*BEFORE_TYPES, ScalarTypeInference, NoPhis, self.lowering, typed_passes.NoPythonBackend):
            passes.add_pass(one, one._name)
        passes.finalize()
        return [passes]


class PartCompiler(_ScalarCompiler):
    """Compiles a kernel for use in others."""

    lowering = PartLowering


class ApartCompiler(PartCompiler):
    """Compiles a part whose arrays never overlap, so that a store to one need not wait for loads from another."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags.noalias = True


class WholeCompiler(_ScalarCompiler):
    """Compiles a kernel for use from Python."""

    lowering = WholeLowering

    def _compile_core(self) -> Any:
        """Compile with the garbage collector at rest: it would take a fifth of the time and find next to nothing."""
        resting = gc.isenabled()
        gc.disable()
        try:
            return super()._compile_core()
        finally:
            if resting:
                gc.enable()


class PartCacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    """How a part is kept on disk."""

    def reduce(self, cres: Any) -> tuple[Any, ...]:
        """What has to be pickled."""
        library, description = cres.library, cres.fndesc
        description.typemap = description.calltypes = None
        bitcode = library.own_module().as_bitcode()
        return library.name, library.call, bitcode, [part.call for part in library.calls()], description, cres.signature

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        """The compiled part again."""
        name, call, bitcode, calls, description, signature = payload
        library = PartLibrary.from_bitcode(name, call, bitcode, [_part(*called) for called in calls])
        environment = Environment.from_fndesc(description)
        return compiler.compile_result(
            typing_context=target_context.typing_context,
            target_context=target_context,
            entry_point=_insert(target_context, description, library, environment),
            typing_error=None,
            type_annotation="",
            library=library,
            call_helper=None,
            signature=signature,
            objectmode=False,
            lifted=(),
            fndesc=description,
            environment=environment,
            metadata=None,
            reload_init=[],
        )


def _part(module: str, name: str, types_of_arguments: tuple[Any, ...]) -> PartLibrary:
    """Library of a kernel, from disk or compiled anew."""
    part = getattr(importlib.import_module(module), name).part
    part.compile(types_of_arguments)
    library: PartLibrary = part.overloads[types_of_arguments].library
    return library
