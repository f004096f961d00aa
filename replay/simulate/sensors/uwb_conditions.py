"""What goes wrong with the radio, by name: the conditions of ``axialnav simulate --uwb``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
RAMP_M, RAMP_RISE_S, EVENT_S = 2.5, 4.0, 15.0
STEP_M = 1.5
SPIKE_SHARE, SPIKE_M = 0.05, (2.0, 20.0)
FROZEN_S = 8.0
WILD_M = (-1.0, 4.0)


def event_start_s(duration_s: float) -> float:
    """When the condition sets in: a third into the flight."""
    return duration_s / 3.0


def disturb(condition: str, t_s: Array, values: Array, start_s: float, rng: np.random.Generator) -> Array:
    """Readings (n,) or (n, 3) of one receiver under a condition.

    ``ramp``: grows to 2.5 m in 4 s and lasts 15 s; ``step``: 1.5 m for 15 s; ``spikes``: 5 % of the readings are 2 to
    20 m off; ``frozen``: the value stays for 8 s; ``wild``: -1 to 4 m off for 15 s.  ``clean`` and ``corner`` change
    nothing: a corner's reflections come from the geometry.  Positions are disturbed along their first axis.
    """
    change = _CONDITIONS.get(condition)
    if change is None:
        return values
    if values.ndim == 2:
        moved = values.copy()
        if condition == "frozen":
            return _frozen_rows(t_s, values, start_s)
        moved[:, 0] = change(t_s - start_s, values[:, 0], rng)
        return moved
    return change(t_s - start_s, values, rng)


def _ramp(t: Array, values: Array, rng: np.random.Generator) -> Array:
    return values + RAMP_M * np.clip(t / RAMP_RISE_S, 0.0, 1.0) * (t < EVENT_S)


def _step(t: Array, values: Array, rng: np.random.Generator) -> Array:
    return values + STEP_M * ((t >= 0.0) & (t < EVENT_S))


def _spikes(t: Array, values: Array, rng: np.random.Generator) -> Array:
    hit = rng.random(len(t)) < SPIKE_SHARE
    return values + hit * rng.uniform(*SPIKE_M, len(t))


def _frozen(t: Array, values: Array, rng: np.random.Generator) -> Array:
    return _frozen_rows(t, values, 0.0)


def _frozen_rows(t: Array, values: Array, start_s: float) -> Array:
    first = int(np.searchsorted(t, start_s))
    last = int(np.searchsorted(t, start_s + FROZEN_S))
    out = values.copy()
    out[first:last] = values[min(first, len(values) - 1)]
    return out


def _wild(t: Array, values: Array, rng: np.random.Generator) -> Array:
    return values + rng.uniform(*WILD_M, len(t)) * ((t >= 0.0) & (t < EVENT_S))


_CONDITIONS: dict[str, Callable[[Array, Array, np.random.Generator], Array]] = {
    "ramp": _ramp,
    "step": _step,
    "spikes": _spikes,
    "frozen": _frozen,
    "wild": _wild,
}
