"""How much the accelerometer is shaken, by its own reading, and what that leaves of its trust.

A vehicle changes its acceleration within tenths of a second.  What is quicker is vibration or a blow, and of that an
accelerometer gives the mean only roughly: range, bandwidth and the filters behind it swallow part, and what is left is
rectified into an offset that lasts as long as the shaking, along the axes that are shaken.  So a jolt adds white noise
while it lasts, and shaking that goes on lets the bias walk, axis by axis.

Source: IEEE Std 1293-2018, vibration rectification; the offset grows with the mean square of the vibration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.jit import Record
from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
MEAN_S = 0.1  # what changes the specific force more slowly is flying
SHAKING_S = 1.0
CALM_S = 10.0  # a shaken accelerometer is trusted again over so long a time


@kernel
def note_shaking(dt: float, force: Array, apart: Array, m: Record, c: Record) -> None:
    """Learn from the specific force (3,) over a step how far it is from its fading mean, and for how long it has been.

    Leaves in ``m.jolt`` (3,) the white noise of the acceleration along the body axes [m^2/s^3] and in ``m.shaken_walk``
    that of its bias [m^2/s^5], beyond those of an accelerometer at rest; ``apart`` (3,) is scratch.
    """
    white = c.accel_white / dt  # what its noise at rest makes of the square of all three together
    total = 0.0
    for i in range(3):
        apart[i] = force[i] - m.force[i]
        m.force[i] += dt / (MEAN_S + dt) * apart[i]
        total += apart[i] * apart[i]
    beyond = max(total - white - c.jolt_m_s2 * c.jolt_m_s2, 0.0)
    shaken = 0.0
    for i in range(3):
        m.jolt[i] = c.jolt_time_s * beyond * apart[i] * apart[i] / total if beyond > 0.0 else 0.0
        m.shaking[i] += dt / (SHAKING_S + dt) * (apart[i] * apart[i] - white / 3.0 - m.shaking[i])
        m.shaken[i] = max(m.shaking[i], m.shaken[i] - dt / CALM_S * m.shaken[i])
        shaken += m.shaken[i]
    share = max(1.0 - c.shaken_m_s2 * c.shaken_m_s2 / shaken, 0.0) if shaken > 0.0 else 0.0
    for i in range(3):
        m.shaken_walk[i] = c.shaken_walk * share * max(m.shaken[i], 0.0)


@kernel
def in_doubt(m: Record) -> bool:
    """Whether the accelerometer is not to be believed: shaken, or a rival that does not believe it is in charge."""
    return bool(m.imu_fault == 1 or m.shaken_walk[0] + m.shaken_walk[1] + m.shaken_walk[2] > 0.0)
