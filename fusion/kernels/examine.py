"""Before a reading is fused: does the supervisor let it pass?  After it: what the supervisor learns from it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.measure import BLUR, FLOW, RANGE
from axialnav.fusion.kernels.reanchor import TRUST_TIME_S, note_trust
from axialnav.fusion.kernels.shadow import aid_shadow
from axialnav.fusion.kernels.tracker import COPY, STUCK, SUPERVISOR, follow
from axialnav.fusion.kernels.update import is_uwb
from axialnav.fusion.memory import LOG_CODE, LOG_WEIGHT
from axialnav.models.jit import Record
from axialnav.models.rotations import matrix_from_quaternion
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import QUAT

Array = NDArray[np.float64]
TRUST_READINGS = 5.0  # slow sources: so many readings, not half a second, make an opinion
STUCK_SIGMAS = 3.0


@kernel
def examine(t_ns: int, s: Record, seen: Record, values: Array, m: Record, w: Record, c: Record) -> int:
    """Return 0, or the :class:`~axialnav.fusion.outcome.Reason` why the reading should not be fused."""
    suspect = seen.held == 1
    if is_uwb(s.kind):
        x = m.x[0]
        matrix_from_quaternion(x[QUAT], x[QUAT + 1], x[QUAT + 2], x[QUAT + 3], w.R)
        reason = follow(t_ns, s, seen, values, m, w, c)
        return SUPERVISOR if suspect and reason != COPY else reason
    if RANGE <= s.kind <= BLUR:
        value = values[0] if s.kind == RANGE else values[1]
        same = value == seen.value[0]
        seen.repeats[0] = seen.repeats[0] + 1 if same else 0
        seen.value[0] = value
        stands = same and seen.repeats[0] >= c.stuck_count
        if stands and abs(seen.latest - seen.expected[0]) > STUCK_SIGMAS * seen.latest_sigma:
            return STUCK
        if suspect:
            return SUPERVISOR
    return 0


@kernel
def learn(t_ns: int, gap_s: float, s: Record, seen: Record, m: Record, w: Record) -> None:
    """Note the weight of a reading and what was expected of it; let pixel motion correct the shadow.

    ``w`` holds what the estimate made of the reading; ``w.v_before`` its velocity before that.
    """
    axes = int(w.row[LOG_CODE])
    if axes <= 0:
        return
    if is_uwb(s.kind):
        if seen.held == 1:
            note_trust(t_ns, gap_s, TRUST_TIME_S, w.would, seen)
        elif w.refused not in (SUPERVISOR, COPY):  # an anchor that is excluded says nothing about the others
            note_trust(t_ns, gap_s, TRUST_TIME_S, w.row[LOG_WEIGHT], seen)
    elif RANGE <= s.kind <= BLUR:
        seen.latest = w.h[0]
        seen.latest_sigma = math.sqrt(w.variance[0])
        if seen.repeats[0] == 0:
            seen.expected[0] = w.h[0]
        if s.kind >= FLOW:
            time_s = max(TRUST_TIME_S, TRUST_READINGS * seen.gap_s) if np.isfinite(seen.gap_s) else 1.0
            note_trust(t_ns, gap_s, time_s, w.would, seen)
            if w.refused == 0:
                aid_shadow(t_ns, axes, s.gate[0], s.soft_nis, w.v_before, m, w)
