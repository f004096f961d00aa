"""UWB ranging in a corridor: line of sight by geometry, reflections by episodes.

Out of sight a receiver locks on a reflection: the range is too long, never too short, by an amount that stays for the
length of an episode.  The law of the errors is the one of hallway recordings (see docs/simulate.md): median 1.6 m,
95 % below 4.8 m, episodes of 0.5 to 8 s; received power minus first-path power is about 4 dB in line of sight and 8 to
14 dB out of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.simulate.rays import sees
from axialnav.replay.simulate.world import World

Array = NDArray[np.float64]
BIAS_MEDIAN_M, BIAS_LOG_SIGMA, BIAS_MAX_M = 1.6, 0.65, 8.0
EPISODE_S = (0.5, 8.0)  # shortest and longest; durations are log-uniform
CALM_S = (0.2, 2.0)  # between episodes a weak direct path is found through the wall
THROUGH_WALL_M = 0.3
LOS_DB, LOS_DB_SIGMA = 4.0, 1.0
NLOS_DB = (8.0, 14.0)
POWER_1M_DBM, PATH_LOSS = -62.0, 2.0
CORRELATION_S = 0.015  # of the receiver's noise: neighbouring ranges share their multipath
DROPOUT = {True: 0.005, False: 0.15}  # share of ranges lost in and out of sight


@dataclass(frozen=True)
class Links:
    """What every measurement of a round-robin of anchors saw.

    Attributes
    ----------
    anchor
        Index of the anchor, shape (n,).
    distance_m, bias_m
        True range and what reflection adds, shape (n,).
    in_sight
        Shape (n,).
    """

    anchor: NDArray[np.int64]
    distance_m: Array
    bias_m: Array
    in_sight: NDArray[np.bool_]


def observe(
    world: World, anchors: Array, t_s: Array, antenna_m: Array, geometric: bool, rng: np.random.Generator
) -> Links:
    """Ranges to all anchors in turn.

    Parameters
    ----------
    world
        The corridor.
    anchors
        Places (a, 3) [m].
    t_s, antenna_m
        Instants [s] (n,) and places of the antenna then (n, 3) [m].
    geometric
        Whether walls in the way matter.
    rng
        Draws the episodes.
    """
    index = np.arange(len(t_s)) % len(anchors)
    distance = np.linalg.norm(antenna_m - anchors[index], axis=1)
    seen = sees(world, antenna_m, anchors[index]) if geometric else np.ones(len(t_s), dtype=np.bool_)
    bias = np.zeros(len(t_s))
    for a in range(len(anchors)):
        own = index == a
        bias[own] = episodes(t_s[own], ~seen[own], rng)
    return Links(index, distance, bias, seen)


def episodes(t_s: Array, hidden: NDArray[np.bool_], rng: np.random.Generator) -> Array:
    """Bias of one link [m], shape (n,): lognormal and constant within an episode, small between episodes."""
    bias = np.zeros(len(t_s))
    until, value, reflected = -np.inf, 0.0, False
    for k in np.flatnonzero(hidden):
        if t_s[k] >= until:
            reflected = not reflected
            low, high = EPISODE_S if reflected else CALM_S
            until = t_s[k] + float(np.exp(rng.uniform(np.log(low), np.log(high))))
            median = BIAS_MEDIAN_M if reflected else THROUGH_WALL_M
            value = min(median * float(np.exp(BIAS_LOG_SIGMA * rng.normal())), BIAS_MAX_M)
        bias[k] = value
    return bias


def noise(t_s: Array, sigma_m: float, rng: np.random.Generator) -> Array:
    """First-order Gauss-Markov noise of one receiver [m], shape (n,)."""
    keep = np.exp(-np.diff(t_s, prepend=t_s[:1]) / CORRELATION_S)
    white = rng.normal(size=len(t_s)) * np.sqrt(np.maximum(1.0 - keep**2, 0.0))
    out = np.empty(len(t_s))
    last = float(rng.normal())
    for k in range(len(t_s)):
        last = keep[k] * last + white[k]
        out[k] = last
    return sigma_m * out


def powers(links: Links, rng: np.random.Generator) -> tuple[Array, Array]:
    """Received power and first-path power of every measurement [dBm], shape (n,) each."""
    count = len(links.anchor)
    rssi = POWER_1M_DBM - 10.0 * PATH_LOSS * np.log10(np.maximum(links.distance_m, 0.5)) + rng.normal(size=count)
    rssi -= np.where(links.in_sight, 0.0, 6.0)
    direct = LOS_DB + LOS_DB_SIGMA * rng.normal(size=count)
    hidden = rng.uniform(*NLOS_DB, count)
    gap = np.where(links.in_sight, direct, hidden)
    return np.round(rssi, 1), np.round(rssi - gap, 1)
