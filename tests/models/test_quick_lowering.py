"""Scalar kernels compute what the same function computes in Python: every way that is lowered by our own means."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from axialnav.models.jit import Record, Records, array_at, native
from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
THING = np.dtype(
    [("x", "f8", 3), ("P", "f8", (2, 3, 4)), ("count", "i8"), ("bad", "i4", 5), ("share", "f4", (2, 2)), ("t", "f8")],
    align=True,
)
WORD = np.dtype(np.int64)


@kernel
def from_both_ends(a: Array, b: Array, n: int) -> float:
    total = 0.0
    for i in range(-n, n):
        total += a[i] * b[i, -1] - b[i, 0] ** 2
    a[-1], b[0, n - 1] = total, a[1]
    return total


@kernel
def loops(n: int, out: Array) -> int:
    at = 0
    for i in range(n, -n, -2):
        for j in range(i, 3):
            if j == 1:
                continue
            if j > 1 and i < 0:
                break
            out[at % 7] += i * 10.0 + j
            at += 1
    for _ in range(n - n):
        at += 1000
    k = 0
    while k < n:
        k += 1
        if k == 2:
            continue
        at += k
    return at


@kernel
def of_records(things: Records, which: int) -> float:
    s = things[which]
    s.count += 2
    s.t = s.count / 3 - s.t
    for i in range(3):
        s.x[i] = things[0].x[i] + s.bad[i] * 0.5
        row = s.P[1, i]
        row[-1] = row[0] - i
    s.bad[s.count % 5] = s.bad[1] + 7
    s.share[1, 0] = s.t
    return float(_second(s, s.P[1]) + float(s.share[1, 0]))


@kernel
def _second(s: Record, M: Array) -> float:
    x, (y, z) = s.x[0], _pair(M, M[2])
    return float(x + y * 10.0 + z * 100.0)


@kernel
def _pair(M: Array, row: Array) -> tuple[float, float]:
    return M[0, 1] + M.shape[0], row[1 : row.shape[0]][0]


@kernel
def extremes(a: float, b: float, n: int) -> float:
    most, least, many = max(a, b), min(a, b), max(n, 3) * min(n, 2)
    if most != most or a == b or not a < b:
        return float(many) if least >= most else -float(many)
    return float(math.floor(most)) + least + many


def same(function: Any, *arguments: Any) -> bool:
    """Whether result and everything written are the same, compiled and in Python."""
    compiled, plain = ([a.copy() if isinstance(a, np.ndarray) else a for a in arguments] for _ in range(2))
    with np.errstate(all="ignore"):
        alike = np.array_equal(function(*compiled), in_python(function)(*plain), equal_nan=True)
    written = zip(compiled, plain, strict=True)
    return alike and all(np.array_equal(ours, theirs, equal_nan=True) for ours, theirs in written)


def in_python(function: Any) -> Callable[..., Any]:
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return plain


def test_indices_count_from_both_ends_whatever_the_layout() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=8), rng.normal(size=(9, 6))
    for one, two in ((a, b), (a[::2], b[::2, ::3]), (a[::-1], b.T.copy().T), (a[1::3], b[:, 1:4])):
        assert same(from_both_ends, one, two, 2)


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_loops_run_as_often(n: int) -> None:
    assert same(loops, n, np.zeros(7))


def test_records_are_read_and_written_in_place() -> None:
    things = np.zeros(2, THING)
    rng = np.random.default_rng(1)
    for name in ("x", "P", "t"):
        things[name] = rng.normal(size=things[name].shape)
    things["count"], things["bad"] = 3, np.arange(10).reshape(2, 5)
    compiled, plain = things.copy(), things.copy().view(np.recarray)
    assert of_records(compiled, 1) == pytest.approx(in_python(of_records)(plain, 1), rel=1e-15)
    for name in things.dtype.names or ():
        assert compiled[name].tobytes() == plain[name].tobytes()


def test_the_larger_and_the_smaller_also_of_what_is_no_number() -> None:
    for a in (1.5, -0.0, 0.0, math.nan, math.inf):
        for b in (2.5, 0.0, math.nan, -math.inf):
            assert same(extremes, a, b, 3)


@kernel
def at_address(address: int) -> int:
    places = array_at(address, (2,), WORD)
    matrix, n = array_at(places[0], (2, places[1]), WORD), places[1]
    matrix[1, n - 1] = 5
    return int(matrix[0, 1] * 100 + matrix[1, 0])


def test_an_array_is_taken_from_its_address() -> None:
    matrix = np.arange(6).reshape(2, 3)
    places = np.array([matrix.ctypes.data, 3])
    assert native(at_address)(places.ctypes.data) == 103
    assert matrix[1, 2] == 5
