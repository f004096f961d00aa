"""One thing that is wrong with a recording."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Gravity(IntEnum):
    """How bad it is, the worst first; also the order in which to repair."""

    STOP = 0
    FIX = 1
    LOOK = 2


@dataclass(frozen=True, slots=True)
class Symptom:
    """A finding with its remedy.

    Attributes
    ----------
    gravity
        STOP: no replay without repair; FIX: the result will be wrong; LOOK: it may be less good than it could be.
    sensor
        Folder of the sensor, or "flight".
    what
        What was seen, with the number and the limit.
    remedy
        What to do.
    """

    gravity: Gravity
    sensor: str
    what: str
    remedy: str
