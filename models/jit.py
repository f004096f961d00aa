"""Typed access to numba, in one place, so that every compiled function has the same options.

``error_model="numpy"`` lets divisions give inf instead of raising (the filter checks its results itself);
``fastmath`` stays off because replay must be bit-identical and it brought no speed.

numba keeps compiled code on disk and throws it away when the function's own file changes, but not when a function that
it calls, in another file, does; and it trips over an index that mentions a type of an older version.  The cache here
carries a stamp of all source files of the package, and an index that cannot be read counts as empty.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numba
import numba.extending
import numpy as np
from numba.core.caching import IndexDataCacheFile
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., object])

OPTIONS: dict[str, Any] = {"error_model": "numpy", "cache": True}

Record: TypeAlias = Any  # one element of a structured array inside a kernel: fields are attributes
Records: TypeAlias = NDArray[np.void]
Integer: TypeAlias = int | np.int64  # a literal int would be compiled as a constant of its own

_KERNEL_FOLDERS = ("models", "estimators", "estimators/spectral", "fusion", "fusion/kernels")


def source_stamp(package: Path) -> tuple[int, int]:
    """Newest change [ns] and total size [bytes] of the source files that kernels can come from."""
    files = [f.stat() for folder in _KERNEL_FOLDERS for f in (package / folder).glob("*.py")]
    return max(f.st_mtime_ns for f in files), sum(f.st_size for f in files)


_STAMP = source_stamp(Path(__file__).resolve().parent.parent)


class _PackageCacheFile(IndexDataCacheFile):  # type: ignore[misc]
    """numba's cache file with the stamp of the whole package."""

    def __init__(self, cache_path: str, filename_base: str) -> None:
        super().__init__(cache_path, filename_base, _STAMP)

    def save(self, key: Any, data: Any) -> None:
        """Keep one overload, while another process may be doing the same.

        numba numbers the files in the order in which they come and writes the index first, so that two processes that
        start together take the same number for different overloads.
        """
        types, *rest = key
        number = hashlib.sha256(f"{','.join(map(str, types))} {rest!r}".encode()).digest()[:8]
        name = self._data_name(int.from_bytes(number))
        self._save_data(name, (self._source_stamp, data))
        self._save_index({**self._load_index(), key: name})

    def _load_data(self, name: str) -> Any:
        stamp, data = super()._load_data(name)
        if stamp != self._source_stamp:
            raise FileNotFoundError(name)  # which numba takes for what it is: nothing there
        return data

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError, pickle.PickleError):
            return {}


def kernel(function: F) -> F:
    """Compile ``function`` to machine code at first use and keep the result on disk until any source changes."""
    compiled: Any = numba.njit(**OPTIONS)(function)
    cache_with_stamp(compiled)
    result: F = compiled
    return result


def cache_with_stamp(compiled: Any, suffix: str = "") -> None:
    """Let the cache of a compiled function see changes in the whole package; ``suffix`` keeps two of them apart."""
    cache = getattr(compiled, "_cache", None)  # there is none with NUMBA_DISABLE_JIT=1
    if cache is not None:
        cache._cache_file = _PackageCacheFile(cache._cache_path, cache._impl.filename_base + suffix)


@numba.extending.intrinsic  # type: ignore[untyped-decorator]
def array_at(typing: Any, address: Any, shape: Any, dtype: Any) -> Any:
    """Inside a kernel: the contiguous array of this shape and type whose first element stands at an address."""
    from axialnav.models.pieces import Pieces, piece, product, word

    kind = numba.types.Array(dtype.dtype, len(shape), "C")

    def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Put the pieces of an array together."""
        item = context.get_data_type(kind.dtype)
        strides = [word(context.get_abi_sizeof(item))]
        lengths = [piece(builder, arguments[1], axis) for axis in range(len(shape))]
        for length in lengths[:0:-1]:
            strides.insert(0, product(builder, strides[0], length))
        data = builder.inttoptr(arguments[0], item.as_pointer())
        return Pieces(kind, data, tuple(lengths), tuple(strides)).value(context, builder)

    return kind(address, shape, dtype), lower


def native(entry: Callable[[int], int]) -> Callable[[int], int]:
    """Return a kernel of one number, an address for :func:`array_at`, as a function that takes nothing else.

    Calling it costs a tenth of a microsecond, while the compiled function itself looks at the type of every argument,
    which for arrays takes longer than the filter.  The caller keeps alive what the addresses point at.
    """
    compiled: Any = entry
    signature = (numba.types.uintp,)
    compiled.compile(signature)
    call: Callable[[int], int] = compiled.overloads[signature].entry_point
    return call
