"""How much of the margin on the accelerometer's noise is needed, axis by axis, by what the aids ask for.

Vibration makes an accelerometer noisier than its data sheet, by how much nobody knows before the flight, so its noise
is told with a margin.  A filter that is told the truth moves its velocity as much as it expects to; one that is told
too much noise expects more.  The mean of those moves beside its expectation is at hand, for it is also what raises
doubt (:mod:`.rival`), and the margin follows it: slowly, never beyond what was told, never below the data sheet.  What
disturbs an aid makes the moves larger and so leaves the margin as it was told.  An accelerometer in doubt has noise of
another kind, and nothing is learned from it.

Source: K. A. Myers, B. D. Tapley, Adaptive sequential estimation with unknown noise statistics (1976): process noise by
the covariance of the corrections.
"""

from __future__ import annotations

from axialnav.fusion.kernels.shaking import in_doubt
from axialnav.models.jit import Integer, Record
from axialnav.models.scalar_kernel import kernel

MOST = 9.0  # three sigma: one surprise is no proof


@kernel
def note_moves(axis: Integer, moved: float, news: float, m: Record, c: Record) -> None:
    """Learn from the mean of the moves along world axis ``axis``, squared, in units of its expected variance.

    ``news`` is the share of that variance that is new, so that silence teaches nothing; over a window of the mean the
    shares add up to two.
    """
    if in_doubt(m):
        return
    step = 0.5 * news * (min(moved, MOST) - 1.0) * c.margin_blend
    m.margin[axis] = min(max(m.margin[axis] * (1.0 + step), c.least_margin), 1.0)
