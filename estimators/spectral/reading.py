"""The best comb of a composite, its uncertainty, and how much better it is than the others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.spectral.copies import Copies
from axialnav.estimators.spectral.look import candidates
from axialnav.estimators.spectral.picture import WINDOW_LOOKS
from axialnav.estimators.spectral.ratio import (
    COMMON,
    MOST_NOISE,
    NOISE,
    SHIFT,
    STATIC,
    STILL_PX,
    WHITE,
    Ratio,
    ratio_of,
)
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
STEPS, SHORT_STEPS = 10, 5
SEPARATE, SEPARATE_PX = 0.1, 0.3
SHORTER = (1.0, 0.8)  # of a displacement: where to look for one with a frame missing
PRIOR_DOF = 6.0
UNKNOWN, TINY = 0.0025, 1e-12
MISFIT = 1.05  # measured on photographs


@dataclass(frozen=True)
class Reading:
    """The best comb.

    Parameters
    ----------
    theta
        Its parameters, shape (p,).
    sigma_px
        Standard deviation of the displacement from the spread of the strips [px].
    rival
        Log-likelihood by which it beats the best other displacement; inf if none looks like one.
    still
        Log-likelihood by which it beats no motion.
    gap
        Log-likelihood by which a missing frame explains the picture better; not positive for an even composite.
    excess
        Mean squared misfit over the one that the strips' spread explains; 1 for the right model.
    noise
        Power of the noise.
    standing
        Share of the texture that does not move, and its standard deviations from none.
    """

    theta: Array
    sigma_px: float
    rival: float
    still: float
    gap: float
    excess: float
    noise: float
    standing: tuple[float, float]

    @property
    def displacement_px(self) -> float:
        """Per frame period, unsigned."""
        return float(self.theta[SHIFT])

    @property
    def common(self) -> float:
        """Share of the texture that all frames have in common."""
        return float(self.theta[COMMON])


def read_comb(copies: Copies, usable: NDArray[np.bool_], reach_px: float) -> Reading:
    """Displacement of a composite up to ``reach_px``; ``usable`` are the frequencies to use, shape (f,)."""
    ratio = ratio_of(copies, usable)
    starts, noise = candidates(ratio, copies.length, reach_px)
    tops = [ratio.climb(start, STEPS) for start in starts]
    costs = [cost(ratio, theta, ratio.model(theta)[1]) for theta in tops]
    best = tops[int(np.argmin(costs))]
    residual, weight, gradient = ratio.model(best)
    weighted = gradient * weight[:, None]
    information = weighted.T @ gradient
    inverse = np.linalg.inv(information + np.diag(ratio.prior[1] + TINY))
    spread, dispersion = uncertainty(copies, ratio, best, weighted @ inverse[SHIFT], weight)
    expected = float(inverse[SHIFT, SHIFT]) * dispersion * WINDOW_LOOKS  # helps where strips are few
    freedom = len(copies.rows) - 1
    variance = (freedom * spread + PRIOR_DOF * expected) / (freedom + PRIOR_DOF)
    least = float(weight @ residual**2)
    excess = least / len(weight) / dispersion
    worth = 1.0 / (2.0 * dispersion * WINDOW_LOOKS)
    apart = max(SEPARATE * best[SHIFT], SEPARATE_PX)
    rivals = [cost(ratio, top, weight) for top in tops if abs(top[SHIFT] - best[SHIFT]) > apart]
    still = ratio.climb(np.array([STILL_PX, 1.0, noise, 0.0, 0.0]), SHORT_STEPS, moving=False)
    gap = max((least - missing(ratio, times, best, weight) for times in with_gaps(copies.frames)), default=-math.inf)
    return Reading(
        best,
        MISFIT * math.sqrt(variance) * max(1.0, excess),
        (min(rivals, default=math.inf) - least) * worth,
        (cost(ratio, still, weight) - least) * worth,
        gap * worth,
        excess,
        float(best[NOISE]) * ratio.faintest,
        standing_share(ratio, best, weighted.T @ residual, information, dispersion),
    )


def cost(ratio: Ratio, theta: Array, weight: Array) -> float:
    """Weighted sum of squared residuals."""
    return float(weight @ ratio.model(theta)[0] ** 2)


def with_gaps(frames: int) -> list[tuple[int, ...]]:
    """Times of frames of which one between the others is missing; seen from behind they are the same picture."""
    return [tuple(k + (k >= gap) for k in range(frames)) for gap in range(1, frames // 2 + 1) if frames > 2]


def missing(even: Ratio, times: tuple[int, ...], best: Array, weight: Array) -> float:
    """Least cost of copies at uneven ``times``."""
    uneven, starts = even.uneven(times), [best.copy() for _ in SHORTER]
    for start, share in zip(starts, SHORTER, strict=True):
        start[SHIFT] *= share
    start = min(starts, key=lambda theta: cost(uneven, theta, weight))
    return cost(uneven, uneven.climb(start, SHORT_STEPS), weight)


def standing_share(
    ratio: Ratio, theta: Array, pull: Array, information: Array, dispersion: float
) -> tuple[float, float]:
    """Share of the texture that stands still, if hardly anything is known of it beforehand, over its sigma as well."""
    certain = ratio.prior[1].copy()
    certain[[STATIC, WHITE]] *= UNKNOWN
    inverse = np.linalg.inv(information + np.diag(certain + TINY))
    share = float(theta[STATIC] + (inverse @ (pull + certain * (ratio.prior[0] - theta)))[STATIC])
    return share, share / math.sqrt(float(inverse[STATIC, STATIC]) * dispersion * WINDOW_LOOKS)


def uncertainty(copies: Copies, ratio: Ratio, theta: Array, influence: Array, weight: Array) -> tuple[float, float]:
    """Variance of the displacement from the spread of the strips [px^2], and the factor that turns weights into theirs.

    ``influence`` (f,) is what a residual moves the displacement by.
    """
    strips = len(copies.rows)
    pulls, own = np.empty(strips), np.empty(len(weight))
    strip_residuals(
        copies.together, copies.apart, copies.rows / copies.rows.sum(), ratio.faint / ratio.faintest,
        1.0 / copies.frames, theta, ratio.comb(theta), ratio.faint, influence, pulls, own,
    )  # fmt: skip
    freedom = strips / (strips - 1)
    return float(np.sum((pulls - pulls.mean()) ** 2)) * freedom, float(np.mean(weight * own)) * freedom


@kernel
def strip_residuals(
    together: Array,
    apart: Array,
    part: Array,
    inverse: Array,
    share: float,
    theta: Array,
    comb: Array,
    faint: Array,
    influence: Array,
    pulls: Array,
    own: Array,
) -> None:
    """Every strip's pull on the displacement (s,), and the strips' squared deviations from their mean (f,)."""
    pulls[:] = 0.0
    for f in range(comb.shape[0]):
        total, square = 0.0, 0.0
        for s in range(part.shape[0]):
            single = apart[s, f] * inverse[f]
            model = single * (share + comb[f] * theta[COMMON] + theta[STATIC])
            model += faint[f] * theta[WHITE] - comb[f] * min(theta[NOISE] * faint[f], MOST_NOISE)
            residual = part[s] * (together[s, f] * inverse[f] * share - model)
            pulls[s] += influence[f] * residual
            total += residual
            square += residual * residual
        own[f] = square - total * total / part.shape[0]
