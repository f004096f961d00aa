"""Single anchors: a path that changes, or is, otherwise than the filter says is excluded, and no other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.kinematics import WINDOWS, allowed_m, way
from axialnav.fusion.kernels.locate import HEARD_S, NARROWEST_M, common_length
from axialnav.fusion.kernels.measure import UWB_TDOA
from axialnav.fusion.kernels.shadow import displacement_variance
from axialnav.fusion.kernels.tracker import STEPPED, path_length
from axialnav.fusion.memory import BLOCK_S, BLOCKS
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import POS

Array = NDArray[np.float64]
CALM = 0.8  # share of a limit below which ways agree again
BACK_S = 0.4
MOVED = 1


@kernel
def judge_anchors(
    t_ns: int, aided: bool, unfit: bool, s: Record, seen: Record, m: Record, w: Record, c: Record
) -> bool:
    """Move the rings of the paths on and exclude single anchors, unless all of them do not fit; ``w.R``: the attitude.

    Returns whether half of the anchors that can be judged, or more, move otherwise than the shadow: then it is the
    source.
    """
    moving, bad, heard = 0, 0, 0
    common = _refer_paths(t_ns, s, seen, m, w)
    if unfit:
        return False
    judged = _note_ways(t_ns, s, seen, m, w) if aided else 0
    for a in range(s.n_anchors):
        if (t_ns - seen.t_heard[a]) * 1e-9 >= HEARD_S:
            continue
        moved = _moved(a, judged, s, seen, m, w, c) if judged > 0 else 0.0
        heard += 1
        moving += 1 if moved > 1.0 else 0
        apart = abs(seen.offset[a] - common + path_length(w.q, s.anchors[a]) - path_length(w.fix, s.anchors[a]))
        _judge(a, apart, moved, seen, m, c)
        bad += 1 if seen.anchor_bad[a] > 0 else 0
    if not aided and 2 * bad > heard:  # then it is the filter that is wrong
        for a in range(s.n_anchors):
            seen.anchor_bad[a] = 0
    elif aided and bad > 0:
        _exclude_strangers(t_ns, s, seen, m)
    return moving > 0 and 2 * moving >= judged


@kernel
def _refer_paths(t_ns: int, s: Record, seen: Record, m: Record, w: Record) -> float:
    """Write the antenna on the source's path into ``w.q`` and on the filter's into ``w.fix``; move the rings on.

    Returns the length common to all paths, which differences leave open.
    """
    at = m.block % BLOCKS
    for i in range(3):
        lever = w.R[i, 0] * s.lever_B[0] + w.R[i, 1] * s.lever_B[1] + w.R[i, 2] * s.lever_B[2]
        w.q[i] = m.shadow_p[i] + seen.reference[i] + lever
        w.fix[i] = m.x[0, POS + i] + lever
    common = common_length(t_ns, NARROWEST_M, s, seen, w) if s.kind == UWB_TDOA else 0.0
    for a in range(s.n_anchors):
        heard = (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S
        seen.ring[a, at] = seen.offset[a] - common if heard else np.nan
    return common


@kernel
def _judge(a: int, apart: float, moved: float, seen: Record, m: Record, c: Record) -> None:
    """Exclude an anchor whose path is ``apart`` [m] from the filter's or ``moved`` too far; take it back when calm.

    One that has stepped was excluded at once; it must come closer than others to be taken back, but need not wait.
    """
    stepped = seen.anchor_bad[a] == STEPPED
    keep = CALM * (c.fit_m if stepped else c.anchor_m)
    if apart > c.anchor_m or moved > 1.0:
        seen.anchor_bad[a] = max(seen.anchor_bad[a], MOVED)
        seen.bad_block[a] = m.block
    elif apart > keep or moved > CALM:
        seen.bad_block[a] = m.block
    elif (m.block - seen.bad_block[a]) * BLOCK_S > (BACK_S if stepped else c.agree_s):
        seen.anchor_bad[a] = 0


@kernel
def _exclude_strangers(t_ns: int, s: Record, seen: Record, m: Record) -> None:
    """While some anchors are excluded, one that has no history to be judged by is too: it may be behind the same."""
    then = (m.block - WINDOWS[-1]) % BLOCKS
    for a in range(s.n_anchors):
        if (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S and not np.isfinite(seen.ring[a, then]):
            seen.anchor_bad[a] = max(seen.anchor_bad[a], MOVED)


@kernel
def _note_ways(t_ns: int, s: Record, seen: Record, m: Record, w: Record) -> int:
    """Write the ways of all paths beside the shadow's into ``w.ways``; return how many can be judged."""
    judged = 0
    for a in range(s.n_anchors):
        known = False
        for k in range(len(WINDOWS)):
            w.ways[k, a] = np.nan
            if (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S and m.block > WINDOWS[k] + 3:
                w.ways[k, a] = way(seen.ring[a], m.block, WINDOWS[k])
            known = known or np.isfinite(w.ways[k, a])
        judged += 1 if known else 0
    return judged


@kernel
def _moved(a: Integer, judged: Integer, s: Record, seen: Record, m: Record, w: Record, c: Record) -> float:
    """How far path ``a`` changed otherwise than the shadow says, in units of what is allowed.

    Differences tell paths only beside each other: there, it is how far it changed otherwise than half of the others.
    """
    if s.kind != UWB_TDOA:
        return _excess(a, np.int64(-1), s, seen, m, w, c)  # a literal would compile it once more
    beyond, near = 0, 0
    for b in range(s.n_anchors):
        excess = _excess(a, b, s, seen, m, w, c)
        beyond += 1 if excess > 1.0 else 0
        near += 1 if excess > CALM else 0
    if 2 * beyond >= judged:
        return 1.01
    return 1.0 if 2 * near >= judged else 0.0  # not calm, not beyond


@kernel
def _excess(a: Integer, b: Integer, s: Record, seen: Record, m: Record, w: Record, c: Record) -> float:
    """Way of path ``a`` beside that of path ``b`` (-1: beside the shadow's), in units of what is allowed."""
    far = max(path_length(w.q, s.anchors[a]), 0.05)
    near = max(path_length(w.q, s.anchors[b]), 0.05) if b >= 0 else 1.0
    for i in range(3):
        w.ray[i] = (w.q[i] - s.anchors[a, i]) / far
        if b >= 0:
            w.ray[i] -= (w.q[i] - s.anchors[b, i]) / near
    largest = 0.0
    for k in range(len(WINDOWS)):
        apart = w.ways[k, a] - (w.ways[k, b] if b >= 0 else 0.0)
        if np.isfinite(apart):
            variance = displacement_variance(WINDOWS[k] * BLOCK_S, w.ray, m, c) + 0.5 * seen.scatter * seen.scatter
            largest = max(largest, abs(apart) / allowed_m(variance, c))
    return float(largest)
