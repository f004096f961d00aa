"""Which UWB paths have a bias state: eight places, given to those that are heard.

A path is an anchor of one source, or an axis of its fixes.  It keeps its place as long as it speaks; a new one takes a
place that is free, or one whose owner has been silent for so long that its bias is forgotten.  Where all places are in
use, a path goes without.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_UWB_BIAS, N_BIASES, N_ERROR, UWB_BIAS

Array = NDArray[np.float64]
FORGOTTEN = 3.0  # correlation times of silence after which a place is given away


@kernel
def place_of(t_ns: int, path: Integer, s: Record, m: Record, c: Record) -> int:
    """Place of a path of the source ``s`` among the bias states, -1 without one; notes that it was heard."""
    if not s.bias_variance > 0.0:
        return -1
    key = s.first_path + path
    oldest, heard = -1, t_ns - int(FORGOTTEN * c.uwb_bias_time_s * 1e9)
    for k in range(N_BIASES):
        if m.path[k] == key:
            m.path_heard[k] = t_ns
            return k
        if m.path_heard[k] < heard:
            oldest, heard = k, m.path_heard[k]
    if oldest >= 0:
        m.path[oldest] = key
        m.path_heard[oldest] = t_ns
        m.path_variance[oldest] = s.bias_variance
        for row in range(2):
            forget_bias(m.x[row], m.P[row], oldest, s.bias_variance)
    return oldest


@kernel
def forget_bias(x: Array, P: Array, place: Integer, variance: float) -> None:
    """Start a bias anew: zero, of the given variance [m^2] and independent of everything."""
    i = E_UWB_BIAS + place
    x[UWB_BIAS + place] = 0.0
    for k in range(N_ERROR):
        P[i, k] = 0.0
        P[k, i] = 0.0
    P[i, i] = variance
