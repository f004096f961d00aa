"""Composite and single exposure: lengths from spectra alone."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.estimate import MotionReason, estimate_motion
from axialnav.estimators.whittle import fitted_spectrum, transfer, whittle_costs
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered


def test_the_transfer_of_a_composite_is_that_of_its_frames() -> None:
    """Oracle: the mean of N shifted and box-blurred impulses, transformed."""
    frequency, d, frames, ratio = np.linspace(0.01, 0.45, 50), 7.3, 5, 0.3
    shift = np.exp(-2j * np.pi * frequency[None] * d * np.arange(frames)[:, None]).mean(axis=0)
    inside = np.linspace(-0.5, 0.5, 4001) * d * ratio
    box = np.exp(-2j * np.pi * frequency[None] * inside[:, None]).mean(axis=0)
    expected = np.abs(shift * box) ** 2
    np.testing.assert_allclose(transfer(np.array([d]), frequency, frames, ratio)[0], expected, atol=5e-4)


def test_whittles_cost_is_lowest_where_the_spectrum_was_made() -> None:
    frequency = np.linspace(0.01, 0.45, 300)
    shape = frequency**-2.0
    lengths = np.arange(4.0, 12.0, 0.5)
    tables = transfer(lengths, frequency, 1, 1.0)
    rng = np.random.default_rng(3)
    power = (2.0 * shape * tables[7] + 5.0) * rng.gamma(50.0, 1.0 / 50.0, 300)
    cost = np.empty(len(lengths))
    whittle_costs(power, tables, shape[None], cost, np.empty(len(lengths), dtype=np.int64))
    assert int(np.argmin(cost)) == 7
    np.testing.assert_allclose(fitted_spectrum(power, tables[7], shape), 2.0 * shape * tables[7] + 5.0, rtol=0.2)


@pytest.mark.parametrize("displacement_px", [1.5, -6.7, 20.7, 40.0])
def test_the_composite_reads_any_speed_without_its_sign(displacement_px: float) -> None:
    picture = rendered(displacement_px, 1, bright=True, contrast=0.1)
    estimate = estimate_motion(picture.frames, method="composite", frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert estimate.displacement_px == pytest.approx(abs(displacement_px), rel=0.02)
    assert not estimate.signed


@pytest.mark.parametrize("displacement_px", [20.0, 40.0])
def test_one_exposure_reads_fast_motion(displacement_px: float) -> None:
    picture = rendered(displacement_px, 2, bright=True, contrast=0.1, frames=1)
    estimate = estimate_motion(picture.frames, method="single", frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert estimate.displacement_px == pytest.approx(displacement_px, rel=0.15)
    assert estimate.window_s == EXPOSURE_S


@pytest.mark.parametrize("displacement_px", [0.5, 3.0])
def test_one_exposure_says_nothing_about_slow_motion(displacement_px: float) -> None:
    picture = rendered(displacement_px, 3, bright=True, contrast=0.1, frames=1)
    estimate = estimate_motion(picture.frames, method="single", frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert not estimate.accepted


def test_one_exposure_of_unknown_length_says_nothing() -> None:
    picture = rendered(20.0, 4, frames=1)
    estimate = estimate_motion(picture.frames, method="single", frame_period_s=PERIOD_S)
    assert estimate.reason == MotionReason.NO_EXPOSURE


@pytest.mark.parametrize("method", ["stripes", "darkline", "dct", "cepstrum"])
def test_published_methods_run_under_their_names(method: str) -> None:
    picture = rendered(25.0, 5, bright=True, contrast=0.1)
    estimate = estimate_motion(picture.frames, method=method, frame_period_s=PERIOD_S, exposure_s=EXPOSURE_S)
    assert estimate.method == method
    assert not estimate.signed
    assert estimate.accepted == np.isfinite(estimate.displacement_px)
