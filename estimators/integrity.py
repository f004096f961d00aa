"""Which row bands tell of the wall, and whether the frames fit one motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.joint import WINDOW_VARIANCE, Fit
from axialnav.estimators.positions import motion_basis
from axialnav.estimators.products import Products
from axialnav.estimators.search import SOFTENING, Profiles

Array = NDArray[np.float64]
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
    best = gain.max(axis=1)
    sure = best > SURE * profiles.spread

    def against(candidate: int) -> Mask:
        """Bands that oppose a grid point."""
        return np.asarray(sure & (best - profiles.highest(candidate, REACH_PX) > OPPOSED * SOFTENING))

    opposed = against(likeliest)
    if not opposed.any():
        return Choice(likeliest, ~opposed, opposed)  # no other can have fewer opponents or be more likely
    choices = []
    for candidate in sorted({likeliest, *gain[sure].argmax(axis=1).tolist()}):
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
    basis = motion_basis(fit.score.shape[1], len(fit.motion) == 2)[:, 0]
    own = (fit.information @ basis) @ basis
    positive = np.maximum(own, TINY)
    step = (fit.score @ basis) / positive
    apart = np.abs(step - middle(step))
    deviation = apart * np.sqrt(positive / WINDOW_VARIANCE)
    usual = min(max(middle(deviation) / MEDIAN_OF_NORMAL, 1.0), MAX_USUAL)
    tolerated = min(TOLERATED_PX, TOLERATED_SHARE * abs(float(fit.motion[0])) + TOLERATED_LEAST_PX)
    return np.asarray(((deviation > FAR * usual) & (apart > tolerated)) | (own <= 0.0))


def middle(values: Array) -> float:
    """Median of a few numbers (n,), without the overhead of numpy's."""
    ordered: list[float] = sorted(values.tolist())
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])


def disturbed(fit: Fit, products: Products) -> Mask:
    """Strips with clearly more power that does not move with the wall than the usual strip, shape (s,).

    Something fixed to the camera leaves the windows that follow the wall, and is noise to them; in a strip of its own
    it costs less left out than carried along.
    """
    strips, frames = len(products.power), products.frames
    whole = products.power.reshape(strips, -1) @ fit.weight.ravel()
    shared = 2.0 * fit.coherence.sum(axis=1)
    unit = (frames - 1) * products.rows.sum(axis=1)
    alien = (whole - (whole + shared) / frames) / unit
    usual = middle(np.sort(alien)[: (strips + 1) // 2 + 1])
    bad = np.asarray(alien > MAX_ALIEN * usual)
    if bad.any():
        bad &= alien - usual > MAX_ALIEN_SHARE * shared / (frames * unit)
        bad[np.argsort(alien)[: strips - MAX_LOST_STRIPS]] = False
    return bad


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
