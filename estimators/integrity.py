"""Which row bands tell of the wall, and whether the frames fit one motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.search import SOFTENING, Profiles

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
REACH_PX = 0.75
OPPOSED = 8.0  # softened log-likelihood by which a band must prefer another displacement to count as opposed
SURE = 6.0  # standard deviations of unrelated frames above which a band has an opinion of its own
STATIC_PX = 1.0


@dataclass(frozen=True)
class Choice:
    """The displacement most row bands can live with.

    Parameters
    ----------
    index
        Grid point.
    agree
        Bands that do not prefer another displacement, shape (b,).
    opposed
        Bands that firmly prefer another one, shape (b,).
    """

    index: int
    agree: Mask
    opposed: Mask


def choose(profiles: Profiles, every_band: bool = True) -> Choice:
    """Let the bands vote: each has its own global search.

    Candidates are the peaks of all bands and of their sum.  A band opposes a candidate if its own peak stands out from
    noise and is far more likely; a band without texture opposes nothing.  The candidate with the fewest opponents
    wins, then the most likely one.
    """
    gain, grid = profiles.gain, profiles.grid_px
    bands = gain.shape[0]
    if not every_band:
        everyone = np.ones(bands, dtype=np.bool_)
        return Choice(int(np.argmax(gain.sum(axis=0))), everyone, ~everyone)
    best = gain.max(axis=1)
    sure = best > SURE * profiles.spread
    candidates = {
        int(np.argmax(gain.sum(axis=0))),
        *(int(i) for i, s in zip(gain.argmax(axis=1), sure, strict=True) if s),
    }
    choices = []
    for candidate in candidates:
        near = np.abs(grid - grid[candidate]) <= REACH_PX
        opposed = sure & ((best - gain[:, near].max(axis=1)) / SOFTENING > OPPOSED)
        place = (
            int(np.flatnonzero(near)[np.argmax(gain[~opposed][:, near].sum(axis=0))])
            if not opposed.all()
            else candidate
        )
        likelihood = float(gain[~opposed, place].sum())
        choices.append((int(opposed.sum()), -likelihood, place, opposed))
    _, _, place, opposed = min(choices, key=lambda choice: choice[:2])
    return Choice(place, ~opposed, opposed)
