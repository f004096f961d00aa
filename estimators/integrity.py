"""Which row bands tell of the wall, and whether the frames fit one motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import WINDOW_VARIANCE, Fit
from axialnav.estimators.positions import centred_times
from axialnav.estimators.products import Products
from axialnav.estimators.search import SOFTENING, Profiles
from axialnav.models.jit import kernel

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
Mask = NDArray[np.bool_]
REACH_PX = 0.75
OPPOSED = 8.0  # softened log-likelihood by which a band must prefer another displacement to count as opposed
SURE = 6.0  # standard deviations of unrelated frames above which a band has an opinion of its own
STATIC_PX = 1.0
MAX_WHITENESS = 0.4
FINE_FROM, MIDDLE = 0.75, (0.2, 0.45)
FAR = 4.0
TOLERATED_PX, TOLERATED_SHARE, TOLERATED_LEAST_PX = 0.15, 0.05, 0.02  # lenses and slanting walls do that much
MEDIAN_OF_NORMAL, MAX_USUAL = 0.6745, 2.0
MAX_LOST_STRIPS = 5
MAX_ALIEN, MAX_ALIEN_SHARE = 1.4, 0.15
TINY = 1e-12


@dataclass(frozen=True)
class Choice:
    """The displacement most row bands can live with.

    Parameters
    ----------
    index
        Grid point.
    agree
        Bands that do not prefer another displacement, shape (b,).
    opposed
        Bands that firmly prefer another one, shape (b,).
    """

    index: int
    agree: Mask
    opposed: Mask


def choose(profiles: Profiles, every_band: bool = True) -> Choice:
    """Let the bands vote: each has its own global search.

    Candidates are the peaks of all bands and of their sum.  A band opposes a candidate if its own peak stands out from
    noise and is far more likely; a band without texture opposes nothing.  The candidate with the fewest opponents
    wins, then the most likely one.
    """
    gain = profiles.gain
    bands, likeliest = gain.shape[0], int(np.argmax(profiles.everyone))
    if not every_band:
        everyone = np.ones(bands, dtype=np.bool_)
        return Choice(likeliest, everyone, ~everyone)
    floor = SURE * profiles.spread

    def against(candidate: int) -> Mask:
        """Bands that oppose a grid point."""
        best, near = profiles.highest(candidate, REACH_PX)
        return np.asarray((best > floor) & (best - near > OPPOSED * SOFTENING))

    opposed = against(likeliest)
    if not opposed.any():
        return Choice(likeliest, ~opposed, opposed)  # no other can have fewer opponents or be more likely
    choices = []
    for candidate in sorted({likeliest, *gain[gain.max(axis=1) > floor].argmax(axis=1).tolist()}):
        near, opposed = profiles.near(candidate, REACH_PX), against(candidate)
        place = near.start + int(np.argmax(gain[~opposed, near].sum(axis=0))) if not opposed.all() else candidate
        likelihood = float(gain[~opposed, place].sum())
        choices.append((int(opposed.sum()), -likelihood, place, opposed))
    _, _, place, opposed = min(choices, key=lambda choice: choice[:2])
    return Choice(place, ~opposed, opposed)


def quarrelling(fit: Fit, products: Products) -> Mask:
    """Strips whose own displacement lies far from that of the usual strip, shape (s,).

    Far is measured by their own information and by how much strips differ in general, so that a picture that is a
    little uneven everywhere loses none.
    """
    bad = np.empty(len(fit.score), dtype=np.bool_)
    tolerated = min(TOLERATED_PX, TOLERATED_SHARE * abs(float(fit.motion[0])) + TOLERATED_LEAST_PX)
    _quarrelling(fit.score, fit.information, centred_times(fit.score.shape[1]), tolerated, bad)
    return bad


@kernel
def _quarrelling(score: Array, information: Array, times: Array, tolerated: float, bad: Mask) -> None:
    """See :func:`quarrelling`; scores (s, n) and information (s, n, n), times (n,) of the frames [periods]."""
    strips = score.shape[0]
    own, step, deviation = np.zeros(strips), np.zeros(strips), np.empty(strips)
    for s in range(strips):
        for i in range(score.shape[1]):
            step[s] += times[i] * score[s, i]
            for j in range(score.shape[1]):
                own[s] += times[i] * information[s, i, j] * times[j]
        step[s] /= max(own[s], TINY)
    usual_step = _median(step)
    for s in range(strips):
        deviation[s] = abs(step[s] - usual_step) * np.sqrt(max(own[s], TINY) / WINDOW_VARIANCE)
    usual = min(max(_median(deviation) / MEDIAN_OF_NORMAL, 1.0), MAX_USUAL)
    for s in range(strips):
        far = deviation[s] > FAR * usual and abs(step[s] - usual_step) > tolerated
        bad[s] = far or own[s] <= 0.0


@kernel
def _median(values: Array) -> float:
    """Median of a few numbers (n,)."""
    count = values.shape[0]
    ordered = _sorted(values)
    return float(0.5 * (ordered[(count - 1) // 2] + ordered[count // 2]))


@kernel
def _sorted(values: Array) -> Array:
    """A few numbers (n,), the smallest first."""
    ordered = values.copy()
    for k in range(1, ordered.shape[0]):
        at, value = k, ordered[k]
        while at > 0 and ordered[at - 1] > value:
            ordered[at] = ordered[at - 1]
            at -= 1
        ordered[at] = value
    return ordered


def middle(values: list[float]) -> float:
    """Median of a few numbers, without the overhead of numpy's."""
    ordered = sorted(values)
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])


def disturbed(fit: Fit, products: Products) -> Mask:
    """Strips with clearly more power that does not move with the wall than the usual strip, shape (s,).

    Something fixed to the camera leaves the windows that follow the wall, and is noise to them; in a strip of its own
    it costs less left out than carried along.
    """
    bad = np.empty(len(products.power), dtype=np.bool_)
    whole = products.power.reshape(len(bad), -1) @ fit.weight.ravel()
    _disturbed(whole, fit.coherence, products.rows, products.frames, bad)
    return bad


@kernel
def _disturbed(whole: Plane, coherence: Array, rows: Array, frames: int, bad: Mask) -> None:
    """See :func:`disturbed`; weighted power (s,) and coherence (s, p) of ``rows`` (s, c) rows."""
    strips = whole.shape[0]
    alien, texture = np.empty(strips), np.empty(strips)
    for s in range(strips):
        shared, unit = 2.0 * np.sum(coherence[s]), (frames - 1) * np.sum(rows[s])
        alien[s] = (whole[s] - (whole[s] + shared) / frames) / unit
        texture[s] = shared / (frames * unit)
    ordered = _sorted(alien)
    usual = _median(ordered[: (strips + 1) // 2 + 1])
    least = ordered[max(strips - MAX_LOST_STRIPS, 0)]
    for s in range(strips):
        more = alien[s] - usual
        bad[s] = alien[s] >= least and alien[s] > MAX_ALIEN * usual and more > MAX_ALIEN_SHARE * texture[s]


def white(fit: Fit, rows: Array) -> bool:
    """Whether what repeats is as strong in its fine part as a pixel pattern is, and nothing behind a lens can be.

    No where the fine part does not stand out from its own noise.  ``rows`` (c,) are the rows behind the spectra.
    """
    power, count = fit.coherent.sum(axis=0), fit.coherent.shape[1]
    first = int(FINE_FROM * count)
    fine, middle = power[first:], power[int(MIDDLE[0] * count) : int(MIDDLE[1] * count)]
    level = float(fine.mean())
    if level <= MAX_WHITENESS * max(float(middle.mean()), TINY):
        return False
    frames = fit.score.shape[1]
    spread = np.sqrt(np.sum(np.mean(fit.noise[:, first:], axis=1) ** 2 / rows) / len(fine)) / frames
    return level >= FAR * float(spread)
