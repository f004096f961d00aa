"""Composite and single exposure: lengths from spectra alone."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.estimate import MotionReason, estimate_motion
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered


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
