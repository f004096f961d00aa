"""Wall distance: what a single-beam range finder reads in front of a plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.ray import distance_along_ray
from axialnav.models.scalar_kernel import kernel
from axialnav.models.state import E_ATT, E_POS, E_WALL_OFFSET

Array = NDArray[np.float64]
MIN_COSINE = 0.5  # a more grazing beam returns from something else


@kernel
def wall_range(
    p_W: Array,
    R_WB: Array,
    R_BS: Array,
    lever_B: Array,
    normal_W: Array,
    offset_m: float,
    offset_is_state: bool,
    H: Array,
    work: Array,
) -> float:
    """Predict the range along the beam [m] and write its Jacobian row into ``H`` (18,).

    Returns NaN where the beam points away from the surface (blind, not wrong), and a negative range where the estimate
    lies behind it, so that a reading can bring it back; ``work`` (8,) is scratch.
    """
    if not distance_along_ray(p_W, R_WB, lever_B, R_BS[:, 2], normal_W, offset_m, work) > MIN_COSINE:
        return np.nan
    for i in range(3):
        H[E_POS + i] = work[1 + i]
        H[E_ATT + i] = work[4 + i]
    if offset_is_state:
        H[E_WALL_OFFSET] = work[7]
    return float(work[0])
