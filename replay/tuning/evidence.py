"""What the readings of one trial say, each in the same place in every trial.

A delay on trial changes the order of events, and with it the rows of the log.  Within a sensor the order stays; so a
reading's place here is that of its sensor plus its number there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.rehearsal import Terms, Trial

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Evidence:
    """Parts of the likelihood, innovations and variances (n, 3) by place."""

    terms: Terms
    innovation: Array
    variance: Array


def counts_of(trial: Trial) -> Ints:
    """Number of readings of each sensor."""
    return np.bincount(trial.log.source, minlength=len(trial.log.sensors)).astype(np.int64)


def collect(trial: Trial, counts: Ints, margin_s: float = 0.0) -> Evidence:
    """Evidence of a trial.

    Parameters
    ----------
    trial
        Log and terms in the order of events.
    counts
        Places for each sensor; readings beyond, and places that no reading fills, do not count.
    margin_s
        Readings so near to either end of the recording do not count.  A shift of stamps pushes them out of what the
        inertial unit covers; were they counted, every shift would seem unlikely for that alone.
    """
    log, terms = trial.log, trial.terms
    order = np.argsort(log.source, kind="stable")
    source = log.source[order]
    number = np.arange(source.size) - np.searchsorted(source, source)
    fits = number < counts[source]
    rows, place = order[fits], (np.concatenate(([0], np.cumsum(counts)))[source] + number)[fits]
    size = int(counts.sum())

    def placed(values: NDArray[np.generic]) -> NDArray[np.generic]:
        """Values in their places among all readings, zero elsewhere."""
        filled = np.zeros((size, *values.shape[1:]), values.dtype)
        filled[place] = values[rows]
        return filled

    used = terms.used
    if margin_s > 0.0 and log.t_ns.size:
        from_start, to_end = log.t_ns - log.t_ns.min(), log.t_ns.max() - log.t_ns
        used = used & (np.minimum(from_start, to_end) > margin_s * 1e9)
    return Evidence(
        Terms(*(placed(values) for values in (used, terms.nis, terms.log_det, terms.gate, terms.weight))),  # type: ignore[arg-type]
        placed(log.innovation),  # type: ignore[arg-type]
        placed(log.variance),  # type: ignore[arg-type]
    )


def expected_curvature(middle: Evidence, around: Sequence[Evidence], span: Array, reference: Terms) -> Array:
    """Part of one flight in the curvature of :mod:`axialnav.replay.tuning.scoring`, (n, n).

    Parameters
    ----------
    middle
        At the point.
    around
        Below and above along every coordinate, 2 n of them.
    span
        Distance between each two, (n,).
    reference
        Which readings count.
    """
    inside = [one.terms.used & (one.terms.nis < one.terms.gate) for one in (middle, *around)]
    rows = np.flatnonzero(np.logical_and.reduce(inside) & reference.used)
    scale = np.sqrt(reference.weight[rows])[:, None]
    deviation = np.sqrt(middle.variance[rows])
    changes = []
    for i, width in enumerate(span):
        below, above = around[2 * i], around[2 * i + 1]
        of_y = (above.innovation[rows] - below.innovation[rows]) / deviation
        of_s = np.log(above.variance[rows] / below.variance[rows])
        whole = np.nan_to_num(scale * np.hstack([np.sqrt(2.0) * of_y, of_s]) / width)  # NaN: fewer than three axes
        changes.append(whole.ravel())
    stacked = np.array(changes)
    curvature: Array = stacked @ stacked.T
    return curvature
