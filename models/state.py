"""Layout of the state: the one place that knows which number is where.

The nominal state is a vector of 26 numbers (attitude as a quaternion), the error state one of 25 (attitude as a
rotation vector in body axes), SI units, corridor frame W (x axial, z up).

======================  ============  ===========  ==============================
quantity                nominal       error        unit
======================  ============  ===========  ==============================
position p_W            0:3           0:3          m
velocity v_W            3:6           3:6          m s^-1
attitude q_WB           6:10          6:9          - (error: rad, body axes)
gyro bias               10:13         9:12         rad s^-1
accelerometer bias      13:16         12:15        m s^-2
blur scale              16            15           - (0 is nominal)
wall offset             17            16           m
UWB biases              18:26         17:25        m
======================  ============  ===========  ==============================
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

N_BIASES: Final = 8  # UWB paths whose slow error is estimated at a time
N_NOMINAL: Final = 18 + N_BIASES
N_ERROR: Final = 17 + N_BIASES
N_CORE: Final = 9  # position, velocity and attitude, which the others feed

POS, VEL, QUAT, GYRO_BIAS, ACCEL_BIAS, BLUR_SCALE, WALL_OFFSET, UWB_BIAS = 0, 3, 6, 10, 13, 16, 17, 18
E_POS, E_VEL, E_ATT, E_GYRO_BIAS, E_ACCEL_BIAS, E_BLUR_SCALE, E_WALL_OFFSET, E_UWB_BIAS = 0, 3, 6, 9, 12, 15, 16, 17

NOMINAL_SLICES: Final = {
    "position_m": slice(0, 3),
    "velocity_m_s": slice(3, 6),
    "quaternion_WB": slice(6, 10),
    "gyro_bias_rad_s": slice(10, 13),
    "accel_bias_m_s2": slice(13, 16),
    "blur_scale": slice(16, 17),
    "wall_offset_m": slice(17, 18),
    "uwb_bias_m": slice(18, N_NOMINAL),
}


def zero_state() -> NDArray[np.float64]:
    """Nominal state at the origin, standing still and level, all biases zero; shape (26,)."""
    x = np.zeros(N_NOMINAL)
    x[QUAT] = 1.0
    return x
