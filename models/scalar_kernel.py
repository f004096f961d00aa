"""The decorators of everything that runs once per reading: loops over numbers in arrays that are there already.

Such kernels make no arrays and use no array expressions.  In exchange they compile four times as fast as with
:func:`axialnav.models.jit.kernel` (how: :mod:`axialnav.models.one_module`), and what they call is inlined across files.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from axialnav.models.jit import OPTIONS, cache_with_stamp

F = TypeVar("F", bound=Callable[..., object])

TRIED = (0, 62), (0, 68)  # oldest and newest numba whose inside is as expected; others compile as usual, slowly


def kernel(function: F) -> F:
    """Compile ``function`` to machine code at first use and keep the result on disk until any source changes."""
    return _compiled(function, nogil=False)


def threaded_kernel(function: F) -> F:
    """As :func:`kernel`, for long work: other threads of the process run meanwhile.

    Not for flight: a thread that gives its turn away may wait milliseconds to get it back.
    """
    return _compiled(function, nogil=True)


def apart_kernel(function: F) -> F:
    """As :func:`kernel`, for a function whose arrays never overlap: that is what vector instructions need to know."""
    return _compiled(function, nogil=False, apart=True)


def _compiled(function: F, *, nogil: bool, apart: bool = False) -> F:
    known = TRIED[0] <= numba.version_info.short <= TRIED[1]
    compiled: Any = _in_one_module(function, nogil, apart) if known else numba.njit(nogil=nogil, **OPTIONS)(function)
    cache_with_stamp(compiled)
    result: F = compiled
    return result


def _in_one_module(function: F, nogil: bool, apart: bool) -> Any:
    from axialnav.models.one_module import ApartCompiler, PartCacheImpl, PartCompiler, WholeCompiler

    # nothing is allocated, so nothing has to be counted
    whole: Any = numba.njit(nogil=nogil, _nrt=False, pipeline_class=WholeCompiler, **OPTIONS)(function)
    if whole is function:  # NUMBA_DISABLE_JIT=1
        return whole
    part: Any = numba.njit(
        _nrt=False,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=ApartCompiler if apart else PartCompiler,
        **OPTIONS,
    )(function)
    part._cache._impl = PartCacheImpl(function)
    cache_with_stamp(part, ".part")
    # other kernels that name the whole get the part
    whole.part, whole.get_call_template, whole.get_overload = part, part.get_call_template, part.get_overload
    return whole
