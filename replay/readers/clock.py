"""Stamps that cannot be right: jumps, a clock that starts again, another clock than the IMU's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.replay.readers.sieve import Mask, Sieve

FAR_NS = 10_000_000_000
JUMP_NS = 1_000_000_000
HOUR_NS = 3_600_000_000_000


def check_clock(sieve: Sieve, span_ns: tuple[int, int] | None) -> None:
    """Leave out rows whose stamp cannot be right.

    Parameters
    ----------
    sieve
        Rows in file order.
    span_ns
        First and last stamp of the IMU, or None.

    Raises
    ------
    FlightError
        The clock starts again inside the file.
    """
    t_ns = sieve.rows.t_ns
    steps = np.diff(t_ns)
    if len(steps) and (steps.min() < 0 or steps.max() > JUMP_NS):
        sieve.refuse(_glitches(t_ns), "clock jump: the stamp leaves its neighbours by more than 1 s and returns")
        _refuse_restart(sieve)
        sieve.refuse(_islands(sieve.rows.t_ns), "clock jump: the stamp is far from the rest of the file")
    if span_ns is not None and len(sieve.rows.t_ns):
        t_ns = sieve.rows.t_ns
        outside = (t_ns < span_ns[0] - FAR_NS) | (t_ns > span_ns[1] + FAR_NS)
        sieve.refuse(outside, "stamp more than 10 s outside the IMU's time: another clock?")


def _runs(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Borders (first rows, and the end) of the stretches in file order without a step beyond 1 s."""
    cuts = np.flatnonzero(np.abs(np.diff(t_ns)) > JUMP_NS) + 1
    return np.concatenate(([0], cuts, [len(t_ns)]))


def _glitches(t_ns: NDArray[np.int64]) -> Mask:
    """Up to three rows that lie elsewhere in time while the rows around them follow each other closely."""
    bad = np.zeros(len(t_ns), dtype=np.bool_)
    if np.count_nonzero(np.diff(t_ns) < 0) > 0.05 * len(t_ns):
        return bad  # a shuffled file: neighbours say nothing
    borders = _runs(t_ns)
    for start, end in pairwise(borders[1:-1]):
        if end - start <= 3 and 0 <= t_ns[end] - t_ns[start - 1] <= JUMP_NS:
            bad[start:end] = True
    return bad


def _refuse_restart(sieve: Sieve) -> None:
    """Raise when long stretches of the file overlap in time, as after a restart of the clock."""
    t_ns = sieve.rows.t_ns
    borders = _runs(t_ns)
    if np.count_nonzero(np.diff(t_ns) < -JUMP_NS) > 5:
        return
    stretches = [(a, b) for a, b in pairwise(borders) if b - a >= 10]
    for (a, b), (c, d) in pairwise(stretches):
        overlap_ns = min(t_ns[a:b].max(), t_ns[c:d].max()) - max(t_ns[a:b].min(), t_ns[c:d].min())
        if overlap_ns > JUMP_NS:
            raise FlightError(
                f"{sieve.rows.where}: the clock starts again at {sieve.rows.example(int(c)).partition(':')[0]}: "
                f"{(t_ns[b - 1] - t_ns[c]) / 1e9:.1f} s back, and {overlap_ns / 1e9:.1f} s are covered twice "
                f"(limit 1 s); split the recording there"
            )


def _islands(t_ns: NDArray[np.int64]) -> Mask:
    """Small groups of rows far from the main body: over 10 s away and under 1 % of it, or over an hour away."""
    order = np.argsort(t_ns, kind="stable")
    gaps = np.diff(t_ns[order])
    cuts = np.flatnonzero(gaps > FAR_NS)
    bad = np.zeros(len(t_ns), dtype=np.bool_)
    if not len(cuts):
        return bad
    borders = np.concatenate(([0], cuts + 1, [len(t_ns)]))
    sizes = np.diff(borders)
    main = int(sizes.argmax())
    for group, size in enumerate(sizes):
        if group != main:
            away_ns = int(gaps[cuts[min(group, main) : max(group, main)]].max())
            if away_ns > HOUR_NS or size < 0.01 * sizes[main]:
                bad[order[borders[group] : borders[group + 1]]] = True
    return bad
