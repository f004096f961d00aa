"""Typed access to numba, in one place, so that every compiled function has the same options.

``error_model="numpy"`` lets divisions give inf instead of raising (the filter checks its results itself);
``fastmath`` stays off because replay must be bit-identical and it brought no speed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

Record: TypeAlias = Any  # one element of a structured array inside a kernel: fields are attributes
Records: TypeAlias = NDArray[np.void]
Integer: TypeAlias = int | np.int64  # a literal int would be compiled as a constant of its own


def kernel(function: F) -> F:
    """Compile ``function`` to machine code at first use and keep the result on disk."""
    compiled: F = numba.njit(cache=True, error_model="numpy")(function)
    return compiled
