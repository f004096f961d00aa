"""What the search alone refuses: posterior mass elsewhere, rivals, too little above noise, the prior's border."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.integrity import choose
from axialnav.estimators.measure import JointOptions, doubt_search, search_grid
from axialnav.estimators.result import MotionReason
from axialnav.estimators.search import HANN_VARIANCE, LEAST_REACH, NEAR_PX, SOFTENING, Profiles, search_weights
from axialnav.estimators.spectrum import Band
from axialnav.estimators.texture import matched_weight, sharp_family

GRID_PX = search_grid(400, 5, None)
EVERY = np.ones(5, dtype=np.bool_)


def profiles(*hills: tuple[float, float], bands: int = 5, spread: float = 1.0) -> Profiles:
    """Bands that all have hills of these heights at these places [px], one pixel wide."""
    gain = sum(height * np.exp(-0.5 * ((GRID_PX - place) / 0.7) ** 2) for place, height in hills)
    return Profiles(GRID_PX, np.repeat(gain[None], bands, axis=0).astype(np.float32), np.full(bands, spread))


def doubt(found: Profiles, prior_px: tuple[float, float] | None = None) -> str:
    options = JointOptions(1.0 / 30.0, prior_px=prior_px)
    return doubt_search(found, choose(found), options)


def test_mass_elsewhere_is_that_of_the_softened_posterior() -> None:
    found = profiles((5.0, 8.0), (8.0, 7.0))
    index = choose(found).index
    total = found.gain.sum(axis=0)
    posterior = np.exp(total / SOFTENING)
    far = np.abs(GRID_PX - GRID_PX[index]) > NEAR_PX
    mass, share = found.rivals(index, EVERY)
    assert GRID_PX[index] == 5.0
    assert mass == pytest.approx(posterior[far].sum() / posterior.sum(), rel=1e-6)
    assert share < 0.01


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (profiles((5.0, 30.0)), ""),
        (profiles((5.0, 8.0), (8.0, 7.5)), MotionReason.AMBIGUOUS),  # mass further than 1 px away
        (profiles((5.0, 60.0), (20.0, 50.0)), MotionReason.PERIODIC),  # no mass to speak of, but nearly as high
        (profiles((5.0, 60.0), (20.0, 40.0)), ""),
        (profiles((5.0, 30.0), spread=12.0), MotionReason.AMBIGUOUS),  # unrelated frames are as high now and then
    ],
)
def test_a_search_is_believed_where_one_displacement_stands_out(found: Profiles, reason: str) -> None:
    assert doubt(found) == reason


@pytest.mark.parametrize(("elsewhere", "reason"), [(2, ""), (3, MotionReason.BANDS)])
def test_three_of_five_bands_have_to_agree(elsewhere: int, reason: str) -> None:
    """Bands that firmly prefer places of their own are outvoted, and refused when they are too many."""
    gain = profiles((5.0, 60.0)).gain
    for b in range(elsewhere):
        gain[b] = profiles((-20.0 + 5.0 * b, 60.0)).gain[b]
    assert doubt(Profiles(GRID_PX, gain, np.ones(5))) == reason


def test_a_prior_cuts_the_grid_and_its_border_is_no_answer() -> None:
    grid = search_grid(400, 5, (10.0, 0.5))
    assert grid[0] <= 10.0 - 5 * 0.5 - 1.0 < grid[1]
    assert grid[-2] < 10.0 + 5 * 0.5 + 1.0 <= grid[-1]
    rising = Profiles(grid, np.repeat(40.0 * np.exp(grid - grid[-1])[None], 5, axis=0), np.ones(5))
    assert doubt(rising, (10.0, 0.5)) == MotionReason.PRIOR_BORDER


def test_the_whole_range_is_searched_without_a_prior() -> None:
    """As far as half of the content stays in view over the window: w / (2 (N - 1)), and w / 4 for two frames."""
    for frames, reach in ((2, 100.0), (3, 100.0), (5, 50.0), (11, 20.0)):
        grid = search_grid(400, frames, None)
        assert (grid[0], grid[-1]) == (-reach, reach)


def test_weights_are_the_matched_ones() -> None:
    rng = np.random.default_rng(3)
    (q, s), found = rng.uniform(0.1, 9.0, (2, 50)), np.empty(50, dtype=np.float32)
    matched_weight(q, s, 5, 0.7, found)
    np.testing.assert_allclose(found, 0.7 * q / (s * (s + 5 * q)), rtol=1e-6)


def test_the_weights_of_a_search_are_those_of_the_spectra_that_made_it() -> None:
    """Their spread is that of unrelated frames, and they end where the texture drowns."""
    rng, band, rows = np.random.default_rng(4), Band(400), np.full((5, 1), 9.0)
    shapes, _, _ = sharp_family(band.first, band.count, band.length)
    q, s = 300.0 * shapes[9], np.full(band.count, 2.0)
    power = (q + s) * rng.gamma(9.0, 1.0, (4, 5, band.count))
    slots = np.array([3, 0, 2])
    weight, spread, reach = search_weights(power.astype(np.float32), slots, 3, rows, band)
    matched = q / (s * (s + 3 * q))
    np.testing.assert_allclose(weight[0, :20], matched[:20], rtol=0.1)
    variance = np.sum((weight * power[slots].sum(axis=0)) ** 2 / rows, axis=1)
    np.testing.assert_allclose(spread, np.sqrt(HANN_VARIANCE * 2.0 / 3.0 * variance), rtol=1e-4)
    information = np.cumsum(matched * q * band.omega() ** 2)
    enough = band.frequency()[np.searchsorted(information, 0.98 * information[-1])]
    assert enough < reach <= max(1.4 * enough + 0.04, LEAST_REACH)


def test_the_border_of_a_coarse_grid_is_interpolated() -> None:
    gain = np.array([[0.0, 1.0, 5.0, 9.0, 2.0]], dtype=np.float32)
    found = Profiles(0.5 * np.arange(5), gain, np.ones(1))
    for index, reach_px, near in ((1, 0.75, 7.0), (1, 1.0, 9.0), (0, 0.75, 3.0), (4, 0.75, 9.0)):
        assert [float(top[0]) for top in found.highest(index, reach_px)] == [9.0, near]
