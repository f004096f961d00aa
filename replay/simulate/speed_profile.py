"""How fast the course is flown: distance over time with continuous jerk."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.course import smoothstep
from axialnav.replay.simulate.mission import VehiclePlan

Array = NDArray[np.float64]
PEAK = 35.0 / 16.0  # largest slope of the smooth step
STOP_EVERY_M, PAUSE_S = 5.0, 2.0
PAPER_SPEEDS = (0.5, 1.0, 0.75, 1.25, 0.6, 1.1)  # of the commanded speed: slow to brisk, as in the field flights
PAPER_EVERY_M = 5.0
GRID_S = 0.01
REST_S = 2.0  # at the end
BEYOND_S = 1.0


def distance_over_time(plan: VehiclePlan, length_m: float, duration_s: float | None) -> tuple[Array, Array]:
    """Instants [s] and distance flown [m], shape (n,) each, ``GRID_S`` apart.

    Standing still first, then the stretches of the profile, then standing again; cut or prolonged to ``duration_s``.
    The last ``BEYOND_S`` go on after the end of the flight, so that a flight that is cut ends in motion.
    """
    speeds, times = [0.0], [plan.still_s]
    for speed, stretch_m, pause_s in _stretches(plan, length_m):
        speeds.append(speed)
        times.append(stretch_m)
        if pause_s > 0.0:
            speeds.append(0.0)
            times.append(pause_s)
    t, v = _timeline(plan, speeds, times)
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    end = t[-1] + REST_S if duration_s is None else duration_s
    grid = np.arange(round((end + BEYOND_S) / GRID_S) + 1) * GRID_S
    return grid, np.interp(grid, t, distance)


def _stretches(plan: VehiclePlan, length_m: float) -> list[tuple[float, float, float]]:
    """Speed, length and pause afterwards of each stretch."""
    if plan.profile == "constant":
        return [(plan.speed_m_s, length_m, 0.0)]
    every = STOP_EVERY_M if plan.profile == "stop_and_go" else PAPER_EVERY_M
    count = max(1, round(length_m / every))
    each = length_m / count
    if plan.profile == "stop_and_go":
        return [(plan.speed_m_s, each, PAUSE_S)] * count
    return [(plan.speed_m_s * PAPER_SPEEDS[k % len(PAPER_SPEEDS)], each, 0.0) for k in range(count)]


def _timeline(plan: VehiclePlan, speeds: list[float], amounts: list[float]) -> tuple[Array, Array]:
    """Speed over time; ``amounts`` are seconds where the speed is 0 and metres elsewhere, transitions included."""
    speeds = _reachable(plan, speeds, amounts)
    ramps = [_ramp_s(plan, a, b) for a, b in pairwise([*speeds, 0.0])]
    t, v, now = [0.0], [0.0], 0.0
    for k, (speed, amount) in enumerate(zip(speeds, amounts, strict=True)):
        hold = amount
        if speed > 0.0:
            before, after = speeds[k - 1], speeds[k + 1] if k + 1 < len(speeds) else 0.0
            spent = _share(before, speed) * ramps[k - 1] + _share(after, speed) * ramps[k]
            hold = max(amount - spent, 0.0) / speed
        now += hold
        t.append(now)
        v.append(speed)
        after = speeds[k + 1] if k + 1 < len(speeds) else 0.0
        steps = max(2, round(ramps[k] / (0.2 * GRID_S)))
        share = np.arange(1, steps + 1) / steps
        t += (now + share * ramps[k]).tolist()
        v += (speed + (after - speed) * smoothstep(share)).tolist()
        now += ramps[k]
    return np.array(t), np.array(v)


def _share(other: float, own: float) -> float:
    """Metres of a second of transition that belong to the stretch flown at ``own``."""
    return 0.5 * own if other == 0.0 else 0.25 * (other + own)


def _ramp_s(plan: VehiclePlan, a: float, b: float) -> float:
    return PEAK * abs(b - a) / plan.acceleration_m_s2 if a != b else 2.0 * GRID_S


def _reachable(plan: VehiclePlan, speeds: list[float], amounts: list[float]) -> list[float]:
    """Speeds that can be reached and left again within their stretch."""
    most = np.sqrt(np.array(amounts) * plan.acceleration_m_s2 / PEAK)
    return [float(v) for v in np.minimum(speeds, most)]
