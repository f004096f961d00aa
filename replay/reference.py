"""Reference paired with estimate: ground truth at the stamps of the track, inside the scoring window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.outcome import Health, Track
from axialnav.replay.alignment import IDENTITY, RigidMotion, rigid_alignment

if TYPE_CHECKING:
    from axialnav.replay.flight import Truth

Array = NDArray[np.float64]
MAX_GAP_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Matched:
    """Estimate and truth at the same instants, both in the truth's world frame.

    ``row`` (m,) are rows of the track, ``available`` how many rows the scoring window holds; errors are estimate minus
    truth.  ``truth_velocity_m_s`` is NaN where the truth carries no velocity.
    """

    row: NDArray[np.int64]
    available: int
    alignment: RigidMotion
    position_m: Array
    velocity_m_s: Array
    velocity_covariance: Array
    truth_position_m: Array
    truth_velocity_m_s: Array


def interpolate(t_ns: NDArray[np.int64], source_t_ns: NDArray[np.int64], values: Array, max_gap_ns: int) -> Array:
    """Linear interpolation that leaves NaN outside the source and inside its gaps.

    t_ns : (n,).  source_t_ns : (k,) sorted.  values : (k, m).  max_gap_ns : widest distance between two source samples
    that is bridged; a stamp that equals a source sample needs no neighbour.  Returns (n, m).
    """
    result = np.full((t_ns.size, values.shape[1]), np.nan)
    if source_t_ns.size == 0:
        return result
    right = np.searchsorted(source_t_ns, t_ns, side="left")
    left = np.clip(right - 1, 0, source_t_ns.size - 1)
    right = np.clip(right, 0, source_t_ns.size - 1)
    gap = source_t_ns[right] - source_t_ns[left]
    bridged = (gap > 0) & (gap <= max_gap_ns) & (t_ns >= source_t_ns[left]) & (t_ns <= source_t_ns[right])
    share = ((t_ns - source_t_ns[left])[bridged] / gap[bridged])[:, None]
    result[bridged] = (1.0 - share) * values[left[bridged]] + share * values[right[bridged]]
    exact = source_t_ns[right] == t_ns
    result[exact] = values[right[exact]]
    return result


def in_window(
    t_ns: NDArray[np.int64], first_ns: int, evaluation: tuple[float | None, float | None]
) -> NDArray[np.bool_]:
    """Which stamps lie in the scoring window, given in seconds after the first IMU sample (None: open)."""
    start_s, end_s = evaluation
    # whole nanoseconds: a sample on the edge of the window belongs to it
    inside: NDArray[np.bool_] = np.ones(t_ns.size, dtype=bool)
    if start_s is not None:
        inside &= t_ns - first_ns >= round(start_s * 1e9)
    if end_s is not None:
        inside &= t_ns - first_ns <= round(end_s * 1e9)
    return inside


def usable_rows(track: Track) -> NDArray[np.bool_]:
    """Rows that hold an estimate: aligned and finite."""
    aligned = (track.flags & int(Health.ALIGNING)) == 0
    usable: NDArray[np.bool_] = aligned & np.isfinite(track.velocity_m_s).all(1) & np.isfinite(track.position_m).all(1)
    return usable


def match(track: Track, truth: Truth, evaluation: tuple[float | None, float | None], *, align: bool) -> Matched:
    """Pair every track row in the window with the truth interpolated to its stamp.

    Truth is interpolated linearly and never across a gap of more than 0.1 s.  With ``align`` the estimate is moved
    rigidly onto the truth (frames that are unrelated); position decides, velocity turns along.
    """
    inside = in_window(track.t_ns, int(track.t_ns[0]), evaluation) if track.t_ns.size else np.zeros(0, dtype=bool)
    values = np.hstack([truth.position_m, truth.velocity_m_s])
    at_track = interpolate(track.t_ns, truth.t_ns, values, MAX_GAP_NS)
    row = np.flatnonzero(inside & usable_rows(track) & np.isfinite(at_track[:, :3]).all(axis=1))
    motion = IDENTITY
    if align and row.size:
        motion = rigid_alignment(track.position_m[row], at_track[row, :3])
    return Matched(
        row=row,
        available=int(inside.sum()),
        alignment=motion,
        position_m=motion.points(track.position_m[row]),
        velocity_m_s=motion.vectors(track.velocity_m_s[row]),
        velocity_covariance=motion.covariances(track.velocity_covariance[row]),
        truth_position_m=at_track[row, :3],
        truth_velocity_m_s=at_track[row, 3:],
    )
