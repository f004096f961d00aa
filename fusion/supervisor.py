"""States of a source as the supervisor sees it, and how they are packed into one number of the track.

The decisions are made in :mod:`axialnav.fusion.kernels.supervise`.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray


class SourceState(IntEnum):
    """What the supervisor makes of a source; members are sentences in :data:`SOURCE_STATES`."""

    OFF = 0
    ALIGNING = 1
    OK = 2
    SUSPECT = 3
    REACQUIRE = 4
    LOST = 5


SOURCE_STATES: dict[SourceState, str] = {
    SourceState.OFF: "switched off, or nothing has come yet",
    SourceState.ALIGNING: "speaks, but not long enough to be judged",
    SourceState.OK: "believed, reading by reading, as far as its gate goes",
    SourceState.SUSPECT: "moves, or measures, otherwise than the sources it is compared with",
    SourceState.REACQUIRE: "moves as it should again, but from another place",
    SourceState.LOST: "silent for longer than its time-out",
}

STATE_BITS: Final = 3
MAX_STATES: Final = 17  # of 3 bits each in the 53 bits of a float64's mantissa


def unpack_states(packed: NDArray[np.int64], count: int) -> NDArray[np.int8]:
    """States of the first ``count`` sources, shape (n, count); those past the seventeenth read OFF."""
    shifts = STATE_BITS * np.arange(min(count, MAX_STATES))
    states = np.zeros((len(packed), count), np.int8)
    states[:, : len(shifts)] = (packed[:, None] >> shifts) & (2**STATE_BITS - 1)
    return states
