"""From an event to what the update needs: readings, predictions, Jacobian rows and variances per axis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.kernels.covariance import project
from axialnav.fusion.kernels.paths import place_of
from axialnav.fusion.kernels.picture import look_at_surface, motion_at_slope, motion_of_picture
from axialnav.fusion.kernels.window import state_in_window
from axialnav.fusion.outcome import Reason
from axialnav.fusion.sources import Kind
from axialnav.models.aiding import height, tilt
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_VEL, N_ERROR
from axialnav.models.uwb import uwb_position, uwb_range, uwb_tdoa
from axialnav.models.wall_range import wall_range

Array = NDArray[np.float64]

FLOW, BLUR, RANGE = int(Kind.FLOW), int(Kind.BLUR), int(Kind.RANGE)
UWB_RANGE, UWB_TDOA, UWB_POSITION = int(Kind.UWB_RANGE), int(Kind.UWB_TDOA), int(Kind.UWB_POSITION)
HEIGHT = int(Kind.HEIGHT)
WEAK_SIGNAL, NO_GEOMETRY, OUT_OF_RANGE = int(Reason.WEAK_SIGNAL), int(Reason.NO_GEOMETRY), int(Reason.OUT_OF_RANGE)
UNKNOWN_ANCHOR, SIGN_UNCERTAIN, TOO_SHORT = (
    int(Reason.UNKNOWN_ANCHOR),
    int(Reason.SIGN_UNCERTAIN),
    int(Reason.TOO_SHORT),
)
NO_MOTION = int(Reason.NO_MOTION)
TURN = 2.0 * np.pi
SIGN_SIGMAS = 2.0


@kernel
def measure(
    t_ns: int, s: Record, seen: Record, values: Array, x: Array, P: Array, m: Record, w: Record, c: Record
) -> int:
    """Evaluate one event; return its number of axes, or minus the :class:`Reason` why it cannot be used.

    ``w.z``, ``w.h``, ``w.variance`` receive reading, prediction and noise variance per axis, ``w.H`` the Jacobian rows,
    ``w.repeated`` how many readings of the source say the same thing.
    ``w.p`` and ``w.R`` hold the position at the stamp and the attitude.
    """
    for i in range(3):
        for k in range(N_ERROR):
            w.H[i, k] = 0.0
    kind = s.kind
    w.repeated = 1.0
    if kind == UWB_TDOA:
        return _measure_tdoa(t_ns, s, seen, values, x, m, w, c)
    if kind == UWB_RANGE:
        return _measure_uwb_range(t_ns, s, seen, values, x, m, w, c)
    if kind == FLOW:
        return _measure_flow(t_ns, s, values, x, P, m, w)
    if kind == BLUR:
        return _measure_blur(t_ns, s, values, x, P, m, w)
    if kind == RANGE:
        return _measure_range(s, values, x, w)
    if kind == UWB_POSITION:
        return _measure_fix(t_ns, s, seen, values, x, m, w, c)
    if kind == HEIGHT:
        w.z[0] = values[0]
        w.h[0] = height(w.p, seen.datum_m, w.H[0])
        w.variance[0] = variance_of(values[1], s.sigma)
        w.repeated = repetition(seen.gap_s, s.correlation_s)
        return 1
    for i in range(2):
        w.h[i] = tilt(w.R, i, w.H[i])
        w.z[i] = w.h[i] + wrapped(values[i] - w.h[i])
        w.variance[i] = variance_of(values[3], s.sigma)
    w.repeated = repetition(seen.gap_s, s.correlation_s)
    return 2


@kernel
def wrapped(angle: float) -> float:
    """The same angle within -pi..pi [rad]."""
    return float(angle - TURN * round(angle / TURN))


@kernel
def variance_of(claimed_sigma: float, floor_sigma: float) -> float:
    """Noise variance: the reading's own claim where it makes one, but never below the configured floor."""
    sigma = claimed_sigma if claimed_sigma > floor_sigma else floor_sigma
    return sigma * sigma


@kernel
def _measure_range(s: Record, values: Array, x: Array, w: Record) -> int:
    w.z[0] = values[0]
    if not s.low <= values[0] <= s.high:
        return -OUT_OF_RANGE
    if not look_at_surface(s, x, 0.0, w):
        return -NO_GEOMETRY
    w.h[0] = wall_range(w.p, w.R, s.R_BS, s.lever_B, w.normal, w.plane[0], s.offset_is_state, w.H[0], w.ray)
    rough = w.plane[1] ** 2
    w.variance[0] = variance_of(values[1], s.sigma) + rough
    if not values[1] > s.sigma:
        w.repeated = (s.white_share * s.sigma**2 + rough) / w.variance[0]
    return 1 if np.isfinite(w.h[0]) else -NO_GEOMETRY


@kernel
def repetition(gap_s: float, correlation_s: float) -> float:
    """How many readings that come every ``gap_s`` say the same thing.

    Errors with the correlation exp(-dt / tau) average as slowly as white ones of a variance coth(dt / 2 tau) times
    larger: 1 for slow sources, 2 tau / dt for fast ones.
    """
    if not (gap_s > 0.0 and correlation_s > 0.0):  # also before the second reading, when the gap is not known
        return 1.0
    return 1.0 / math.tanh(0.5 * gap_s / correlation_s)


@kernel
def _uwb_variance(
    claimed_sigma: float, place: Integer, other: Integer, s: Record, seen: Record, w: Record, c: Record
) -> float:
    """White variance of a reading; paths without a place add their bias and make readings repeat each other."""
    variance = variance_of(claimed_sigma, s.sigma)
    if place < 0 or other < 0:
        w.repeated = repetition(seen.gap_s, s.correlation_s)
        variance += ((1.0 if place < 0 else 0.0) + (1.0 if other < 0 else 0.0)) * s.bias_variance
    return variance


@kernel
def obstructed(power_difference_db: float, c: Record) -> float:
    """Factor on the variance of a range whose total power exceeds that of its first path; NaN: not reported, 1."""
    excess = (power_difference_db - c.nlos_db) / c.nlos_scale_db
    return 1.0 + excess * excess if excess > 0.0 else 1.0


@kernel
def _measure_uwb_range(
    t_ns: int, s: Record, seen: Record, values: Array, x: Array, m: Record, w: Record, c: Record
) -> int:
    a = int(values[0])
    if not 0 <= a < s.n_anchors:
        return -UNKNOWN_ANCHOR
    w.z[0] = values[1]
    if not values[1] > 0.0:
        return -OUT_OF_RANGE
    place = place_of(t_ns, a, s, m, c)
    w.h[0] = uwb_range(x, w.p, w.R, s.lever_B, s.anchors[a], place, w.H[0])
    w.variance[0] = _uwb_variance(values[2], place, np.int64(0), s, seen, w, c) * obstructed(values[3] - values[4], c)
    return 1 if np.isfinite(w.h[0]) else -NO_GEOMETRY


@kernel
def _measure_tdoa(t_ns: int, s: Record, seen: Record, values: Array, x: Array, m: Record, w: Record, c: Record) -> int:
    a, b = int(values[0]), int(values[1])
    if not (0 <= a < s.n_anchors and 0 <= b < s.n_anchors):
        return -UNKNOWN_ANCHOR
    w.z[0] = values[2]
    place_a, place_b = place_of(t_ns, a, s, m, c), place_of(t_ns, b, s, m, c)
    w.h[0] = uwb_tdoa(x, w.p, w.R, s.lever_B, s.anchors[a], s.anchors[b], place_a, place_b, w.H[0])
    w.variance[0] = _uwb_variance(values[3], place_a, place_b, s, seen, w, c)
    return 1 if np.isfinite(w.h[0]) else -NO_GEOMETRY


@kernel
def _measure_fix(t_ns: int, s: Record, seen: Record, values: Array, x: Array, m: Record, w: Record, c: Record) -> int:
    for i in range(3):
        place = place_of(t_ns, i, s, m, c)
        w.z[i] = values[i]
        w.h[i] = uwb_position(x, w.p, w.R, s.lever_B, i, place, w.H[i])
        w.variance[i] = _uwb_variance(values[3 + i], place, np.int64(0), s, seen, w, c)
    return 3


@kernel
def _measure_flow(t_ns: int, s: Record, values: Array, x: Array, P: Array, m: Record, w: Record) -> int:
    if values[4] < s.low:
        return -WEAK_SIGNAL
    if not np.isfinite(values[1]):
        return -NO_MOTION
    axes = 2 if np.isfinite(values[2]) else 1
    state_in_window(t_ns, values[0], x, m, w)
    coherence_px = values[6] if np.isfinite(values[6]) else s.coherence_px
    for i in range(axes):
        w.z[i] = values[1 + i]
        sigma = values[5] if i == 1 and np.isfinite(values[5]) else values[3]
        w.variance[i] = sigma**2 if np.isfinite(sigma) else s.sigma**2
        w.h[i] = motion_of_picture(s, values[0], coherence_px, i, w)
    if not np.isfinite(w.h[0]):
        return -NO_GEOMETRY
    if axes == 2 and s.half_view > 0.0 and not _believable(s, P, w):
        return 1
    return axes


@kernel
def _believable(s: Record, P: Array, w: Record) -> bool:
    """Whether what a picture does across its rows may be true: it is measured by other means than what it does along.

    The two have nothing in common that could go wrong, so that the one must not take the other with it.
    """
    apart = w.z[1] - w.h[1]
    return bool(apart * apart <= s.gate[0] * (project(P, w.H[1], w.PHt) + w.variance[1]))


@kernel
def _measure_blur(t_ns: int, s: Record, values: Array, x: Array, P: Array, m: Record, w: Record) -> int:
    """Unsigned length: usable only while the direction of motion is known and the blur is long enough to see."""
    state_in_window(t_ns, values[0], x, m, w)
    signed = motion_at_slope(s, values[0], np.int64(0), 0.0, w)  # a literal 0 would compile the model once more
    if not np.isfinite(signed):
        return -NO_GEOMETRY
    spread = 0.0
    for i in range(3):
        for j in range(3):
            spread += w.H[0, E_VEL + i] * P[E_VEL + i, E_VEL + j] * w.H[0, E_VEL + j]
    if signed * signed < SIGN_SIGMAS * SIGN_SIGMAS * spread:
        return -SIGN_UNCERTAIN
    w.z[0] = values[1]
    w.variance[0] = values[2] ** 2 if np.isfinite(values[2]) else s.sigma**2
    if values[1] * values[1] < SIGN_SIGMAS * SIGN_SIGMAS * w.variance[0]:
        return -TOO_SHORT
    w.h[0] = abs(signed)
    if signed < 0.0:
        for k in range(N_ERROR):
            w.H[0, k] = -w.H[0, k]
    return 1
