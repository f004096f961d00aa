"""Medians of repeated work, in time on the wall and in processor time (other programs disturb only the first)."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

T = TypeVar("T")


class Spent(NamedTuple):
    """Time of one repetition [s]: medians, and the least processor time.

    A neighbour on the same processor core slows the clock of a virtual machine down for both: then the least says what
    the code needs, and the medians what it got.
    """

    wall_s: float
    cpu_s: float
    least_s: float

    def per(self, count: float) -> tuple[str, str, str]:
        """Median wall, median processor and least processor time of one of ``count`` equal steps, as text [us]."""
        return tuple(f"{1e6 * seconds / count:.3g}" for seconds in self)  # type: ignore[return-value]


def median_of(repeats: int, action: Callable[[T], object], prepare: Callable[[], T]) -> Spent:
    """Time ``action`` on freshly prepared input; preparing does not count."""
    wall, cpu = [], []
    for _ in range(repeats):
        given = prepare()
        wall_0, cpu_0 = time.perf_counter(), time.process_time()
        action(given)
        wall.append(time.perf_counter() - wall_0)
        cpu.append(time.process_time() - cpu_0)
    return Spent(statistics.median(wall), statistics.median(cpu), min(cpu))


def median_of_processes(repeats: int, arguments: Sequence[str], environment: Mapping[str, str] | None = None) -> Spent:
    """Time Python processes from start to end; a failing one raises ``CalledProcessError``."""
    wall, cpu = [], []
    for _ in range(repeats):
        wall_0, cpu_0 = time.perf_counter(), _children_s()
        subprocess.run(
            [sys.executable, *arguments], check=True, capture_output=True, env={**os.environ, **(environment or {})}
        )
        wall.append(time.perf_counter() - wall_0)
        cpu.append(_children_s() - cpu_0)
    return Spent(statistics.median(wall), statistics.median(cpu), min(cpu))


def _children_s() -> float:
    spent = os.times()
    return spent.children_user + spent.children_system
