"""Rows in use, and the log of those that are not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.dropped import DropLog

Mask = NDArray[np.bool_]


class Sieve:
    """Rows that are still in use, and the log of those that are not.

    Parameters
    ----------
    rows
        Rows as read, in file order.
    sensor
        Name for the log.
    drops
        The log.
    """

    def __init__(self, rows: Rows, sensor: str, drops: DropLog) -> None:
        self.rows = rows
        self.sensor = sensor
        self._drops = drops

    def refuse(self, bad: Mask, reason: str) -> None:
        """Leave out the rows in ``bad``."""
        if bad.any():
            self.note(bad, reason)
            self.rows = self.rows.subset(~bad)

    def note(self, which: Mask, reason: str) -> None:
        """Log rows that stay in use."""
        self._drops.add(self.sensor, reason, int(which.sum()), self.rows.example(int(which.argmax())))
