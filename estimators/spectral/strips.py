"""Strips of the picture that show something else than the wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.picture import Spectra, spectra_of
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
ODD = 6.0  # times the usual disagreement
MAX_LOST = 0.34


@kernel
def disagreement(power: Array, rows: Array, out: Array) -> None:
    """Mean squared deviation of every strip from the median of all strips, in units of that of noise; ``out`` (s,)."""
    strips, count = power.shape
    column = np.empty(strips)
    out[:] = 0.0
    for f in range(count):
        for s in range(strips):
            value, at = power[s, f], s
            while at > 0 and column[at - 1] > value:
                column[at] = column[at - 1]
                at -= 1
            column[at] = value
        middle = 0.5 * (column[(strips - 1) // 2] + column[strips // 2])
        for s in range(strips):
            out[s] += (power[s, f] / middle - 1.0) ** 2 * rows[s] / count


def odd_strips(spectra: Spectra) -> NDArray[np.bool_]:
    """Strips whose spectrum is unlike the others', shape (s,): something fixed to the camera stands before the wall."""
    strange = np.empty(len(spectra.rows))
    disagreement(spectra.power, spectra.rows, strange)
    return np.asarray(strange > ODD * max(1.0, float(np.median(strange))))


def wall_rows(rows: NDArray[np.uint32], odd: NDArray[np.bool_]) -> NDArray[np.uint32]:
    """The rows (r, w) of the strips that are not odd."""
    edges = np.linspace(0, len(rows), len(odd) + 1).astype(np.int64)
    return np.ascontiguousarray(rows[np.repeat(~odd, np.diff(edges))])


def wall_spectra(rows: NDArray[np.uint32], variance_gain: float) -> Spectra | None:
    """Spectra of the strips that show the wall, from rows (r, w); None if there are too few.

    Odd strips take part neither in the spectra nor in the level of the columns.
    """
    spectra = spectra_of(rows, variance_gain)
    odd = odd_strips(spectra)
    if not odd.any():
        return spectra
    return None if float(np.mean(odd)) > MAX_LOST else spectra_of(wall_rows(rows, odd), variance_gain)
