"""Where a UWB source says the vehicle is: a robust Gauss-Newton fix from the offsets of its anchors.

The offsets hold the last readings of every anchor, carried along the shadow to now, so ranges and range differences
that came one after the other make one fix.  Differences leave a length common to all anchors open, which is eliminated.
The weights redescend (Geman-McClure) with a scale that narrows from step to step: one bad anchor drops out.

Source: Nocedal and Wright (2006), section 10.3 (Gauss-Newton); Geman and McClure (1987).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.measure import UWB_POSITION, UWB_TDOA
from axialnav.fusion.kernels.reanchor import solve_symmetric
from axialnav.fusion.kernels.tracker import STEPPED, path_length, refer
from axialnav.models.jit import Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_POS, POS

Array = NDArray[np.float64]
STEPS = 10
WIDEST_M, NARROWEST_M, NARROWING = 6.0, 0.3, 0.6
DOUBT = 100.0  # the filter's position variance counts so many times larger, but it is never put aside
LEAST_PRIOR, MOST_PRIOR = 0.01, 1e3  # weight of its position per axis against one path
HEARD_S = 1.0
LEAST_ANCHORS = 3
INLIER_M = 0.6
ENOUGH_AGREE = 0.6
FAR_M = 0.5
STEPPED_WEIGHT = 0.01  # of a path that has taken a new level: it only settles what the others leave open


@kernel
def locate(t_ns: int, s: Record, seen: Record, m: Record, w: Record) -> float:
    """Write the source's position relative to the shadow into ``w.fix`` (3,); return the share of anchors that agree.

    ``w.R`` holds the attitude.  0 where nothing can be said: too few anchors heard within the last second.
    """
    if s.kind == UWB_POSITION:
        for i in range(3):
            w.fix[i] = seen.offset[i]
        return 1.0 if (t_ns - seen.t_heard[0]) * 1e-9 < HEARD_S else 0.0
    for i in range(3):
        lever = w.R[i, 0] * s.lever_B[0] + w.R[i, 1] * s.lever_B[1] + w.R[i, 2] * s.lever_B[2]
        w.q[i] = m.shadow_p[i] + seen.reference[i] + lever  # where the offsets hold
        w.y[i] = m.x[0, POS + i] + lever
        w.fix[i] = w.q[i]
        variance = DOUBT * m.P[0, E_POS + i, E_POS + i]
        w.prior[i] = min(max(NARROWEST_M * NARROWEST_M / variance, LEAST_PRIOR), MOST_PRIOR)
    count = 0
    for a in range(s.n_anchors):
        if (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S:
            count += 1
    if count < LEAST_ANCHORS:
        return 0.0
    scale, w.common = WIDEST_M, 0.0
    for _ in range(STEPS):
        if not _step(t_ns, scale, s, seen, w):
            return 0.0
        scale = max(scale * NARROWING, NARROWEST_M)
    share = _agreeing(t_ns, s, seen, w) / count
    size2 = 0.0
    for i in range(3):
        w.fix[i] -= w.q[i]
        size2 += w.fix[i] * w.fix[i]
    if share >= ENOUGH_AGREE and size2 > FAR_M * FAR_M:
        refer(w.fix, s, seen, w)
        for i in range(3):
            w.fix[i] = 0.0
    for i in range(3):
        w.fix[i] += seen.reference[i]
    return float(share)


@kernel
def _residual(a: int, s: Record, seen: Record, w: Record) -> float:
    return float(path_length(w.q, s.anchors[a]) + seen.offset[a] - path_length(w.fix, s.anchors[a]))


@kernel
def _step(t_ns: int, scale: float, s: Record, seen: Record, w: Record) -> bool:
    """One Gauss-Newton step of ``w.fix``, weights at ``scale`` [m]; False where the geometry gives none."""
    A, b, mean_u = w.S, w.rhs, w.ray
    mean_r, total = 0.0, 0.0
    for i in range(3):
        mean_u[i] = 0.0
        b[i] = w.prior[i] * (w.y[i] - w.fix[i])
        for j in range(3):
            A[i, j] = w.prior[i] if i == j else 0.0
    for a in range(s.n_anchors):
        if (t_ns - seen.t_heard[a]) * 1e-9 >= HEARD_S:
            continue
        r = _residual(a, s, seen, w)
        soft = 1.0 + ((r - w.common) / scale) ** 2
        weight = (STEPPED_WEIGHT if seen.anchor_bad[a] == STEPPED else 1.0) / (soft * soft)
        distance = max(path_length(w.fix, s.anchors[a]), 0.05)
        total += weight
        mean_r += weight * r
        for i in range(3):
            u = (w.fix[i] - s.anchors[a, i]) / distance
            mean_u[i] += weight * u
            b[i] += weight * u * r
            for j in range(3):
                A[i, j] += weight * u * (w.fix[j] - s.anchors[a, j]) / distance
    if s.kind == UWB_TDOA and total > 0.0:
        for i in range(3):
            b[i] -= mean_u[i] * mean_r / total
            for j in range(3):
                A[i, j] -= mean_u[i] * mean_u[j] / total
    if not solve_symmetric(A, b, w.move):
        return False
    for i in range(3):
        w.fix[i] += w.move[i]
    w.common = 0.0
    if s.kind == UWB_TDOA:
        w.common = common_length(t_ns, scale, s, seen, w)
    return bool(np.isfinite(w.fix[0]))


@kernel
def common_length(t_ns: int, scale: float, s: Record, seen: Record, w: Record) -> float:
    """Length common to all anchors: the weighted mean residual at ``w.fix``, found robustly in a few passes."""
    common = 0.0
    wide = WIDEST_M
    for _ in range(4):
        total, mean = 0.0, 0.0
        for a in range(s.n_anchors):
            if (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S:
                r = _residual(a, s, seen, w)
                soft = 1.0 + (r - common) ** 2 / (wide * wide)
                total += 1.0 / (soft * soft)
                mean += r / (soft * soft)
        common = mean / total
        wide = max(0.5 * wide, scale)
    return common


@kernel
def _agreeing(t_ns: int, s: Record, seen: Record, w: Record) -> int:
    count = 0
    for a in range(s.n_anchors):
        if (t_ns - seen.t_heard[a]) * 1e-9 < HEARD_S and abs(_residual(a, s, seen, w) - w.common) < INLIER_M:
            count += 1
    return count
