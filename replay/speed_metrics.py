"""Score against GPS where there is no ground truth: the horizontal speed, which needs no common heading."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import Track
from axialnav.replay.reference import in_window, interpolate, usable_rows

if TYPE_CHECKING:
    from axialnav.replay.flight import GpsReference

Array = NDArray[np.float64]
MAX_TRACK_GAP_NS = 100_000_000
LATENCIES_S = np.arange(0.0, 0.5001, 0.01)
MIN_SPEED_CHANGE_M_S = 0.2
SPEED_KEYS = ("horizontal_speed_rmse_m_s", "horizontal_speed_mean_error_m_s", "gps_latency_s")
NO_SPEED: dict[str, Any] = {"used": 0, "available": 0, **dict.fromkeys(SPEED_KEYS)}


def speed_metrics(track: Track, gps: GpsReference, evaluation: tuple[float | None, float | None]) -> dict[str, Any]:
    """RMSE of horizontal speed at the GPS stamps, and how late GPS seems to be.

    The filter's world has an unknown heading against north, so speeds are compared and not components.  The score takes
    GPS as stamped; ``gps_latency_s`` (shift of 0 .. 0.5 s that fits best; None where the speed hardly changes) is for
    information.

    Returns
    -------
    dict
        ``used``, ``available`` (GPS samples in the window), ``horizontal_speed_rmse_m_s``,
        ``horizontal_speed_mean_error_m_s`` (filter minus GPS), ``gps_latency_s``.
    """
    if track.t_ns.size == 0:
        return NO_SPEED
    inside = in_window(gps.t_ns, int(track.t_ns[0]), evaluation)
    t_ns = gps.t_ns[inside]
    reference = np.hypot(gps.velocity_m_s[inside, 0], gps.velocity_m_s[inside, 1])
    usable = usable_rows(track)
    speed = np.hypot(track.velocity_m_s[usable, 0], track.velocity_m_s[usable, 1])[:, None]
    stamps = track.t_ns[usable]
    error = interpolate(t_ns, stamps, speed, MAX_TRACK_GAP_NS)[:, 0] - reference
    good = np.isfinite(error)
    return {
        "used": int(good.sum()),
        "available": int(t_ns.size),
        "horizontal_speed_rmse_m_s": float(np.sqrt((error[good] ** 2).mean())) if good.any() else None,
        "horizontal_speed_mean_error_m_s": float(error[good].mean()) if good.any() else None,
        "gps_latency_s": _latency(t_ns, reference, stamps, speed),
    }


def _latency(t_ns: NDArray[np.int64], reference: Array, stamps: NDArray[np.int64], speed: Array) -> float | None:
    """Shift that makes past speed fit the reference best [s]."""
    if t_ns.size < 3 or float(np.nanstd(reference)) < MIN_SPEED_CHANGE_M_S:
        return None
    costs = []
    for late_s in LATENCIES_S:
        error = interpolate(t_ns - int(late_s * 1e9), stamps, speed, MAX_TRACK_GAP_NS)[:, 0] - reference
        good = np.isfinite(error)
        costs.append(float((error[good] ** 2).mean()) if good.any() else np.inf)
    best = int(np.argmin(costs))
    if best == LATENCIES_S.size - 1 or not np.isfinite(costs[best]):
        return None  # the fit still improves at the end of the search: the two do not show the same motion
    return float(LATENCIES_S[best])
