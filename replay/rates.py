"""Rates and gaps of the recorded sensors, for the printed summary and the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from axialnav.replay.flight import Flight

MIN_GAP_S = 0.2
GAP_PERIODS = 5.0


@dataclass(frozen=True, slots=True)
class SensorRate:
    """Readings of one sensor: count, mean rate, and silences.

    ``rate_hz`` is None below two distinct stamps; ``gaps`` counts silences of more than 0.2 s and more than five median
    periods, ``longest_s`` and ``longest_at_s`` (after the first IMU sample) describe the longest of them.
    """

    name: str
    count: int
    rate_hz: float | None
    gaps: int
    longest_s: float
    longest_at_s: float


def sensor_rates(flight: Flight, first_ns: int) -> list[SensorRate]:
    """Rate and gaps of every sensor of the flight; ``first_ns`` is the stamp that counts as 0 s."""
    return [_rate(name, table.t_ns, first_ns) for name, table in flight.tables.items()]


def _rate(name: str, t_ns: np.ndarray[tuple[int], np.dtype[np.int64]], first_ns: int) -> SensorRate:
    steps_s = np.diff(t_ns) * 1e-9
    positive = steps_s[steps_s > 0.0]
    if positive.size == 0:
        return SensorRate(name, int(t_ns.size), None, 0, 0.0, 0.0)
    period_s = float(np.median(positive))
    is_gap = steps_s > max(MIN_GAP_S, GAP_PERIODS * period_s)
    longest = int(np.argmax(steps_s))
    gaps = int(is_gap.sum())
    at_s = float(t_ns[longest] - first_ns) * 1e-9
    return SensorRate(name, int(t_ns.size), (t_ns.size - 1) / float(steps_s.sum()), gaps, float(steps_s[longest]), at_s)
