"""From frames to spectra: sums, levels, noise of unit power, strips and codecs that do not belong."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from axialnav.estimators.spectral.blocks import block_notches
from axialnav.estimators.spectral.composite import fit_composite
from axialnav.estimators.spectral.copies import copies_of, transformed, wall_copies
from axialnav.estimators.spectral.picture import FIRST_BIN, composite_rows, level_and_window, row_window, spectra_of
from axialnav.estimators.spectral.strips import odd_strips, wall_rows, wall_spectra
from tests.estimators.scenes import PERIOD_S, rendered, texture


def test_the_composite_is_the_sum_of_all_frames_with_rows_in_bins() -> None:
    rng = np.random.default_rng(1)
    stack = list(rng.integers(0, 4096, (3, 900, 640)).astype(np.uint16))  # three rows to a bin
    brute = np.sum(np.array(stack, dtype=np.uint32), axis=0).reshape(300, 3, 640).sum(axis=1)
    np.testing.assert_array_equal(composite_rows(stack), brute)


def test_what_stands_in_a_whole_column_is_gone() -> None:
    rows = np.random.default_rng(2).integers(0, 99, (40, 60)).astype(np.uint32)
    out = np.empty(rows.shape, np.float32)
    level_and_window(rows, np.ones(60, np.float32), out)
    np.testing.assert_allclose(out, rows - rows.mean(axis=0), atol=1e-4)


def test_white_noise_of_unit_variance_has_unit_power() -> None:
    rows = np.random.default_rng(3).poisson(400.0, (360, 640)).astype(np.uint32)
    spectra = spectra_of(rows, 400.0)
    assert spectra.mean.mean() == pytest.approx(1.0, abs=0.02)
    assert spectra.rows.sum() == 360
    assert spectra.frequency[-1] < 0.45


def test_a_composite_is_told_apart_from_its_frames() -> None:
    """Brute force: transforms of the frames and of their sum, rows in bins, less the columns' means, windowed."""
    stack = list(np.random.default_rng(7).integers(0, 4096, (3, 900, 640)).astype(np.uint16))  # three rows to a bin
    packed, thin = transformed(stack)
    copies = copies_of(packed, 3.0)
    rows = np.array(stack, dtype=np.float64).reshape(3, 300, 3, 640).sum(axis=2)
    np.testing.assert_allclose(thin, rows.sum(axis=0)[::4], rtol=1e-6)
    window = row_window(640)[0].astype(np.float64)
    spectra = np.fft.rfft((rows - rows.mean(axis=1, keepdims=True)) * window) / np.sqrt(3.0 * np.sum(window**2))
    used = slice(FIRST_BIN, FIRST_BIN + copies.together.shape[1])
    together, apart = copies.means
    np.testing.assert_allclose(together, np.mean(np.abs(spectra.sum(axis=0)) ** 2, axis=0)[used] / 3.0, rtol=1e-3)
    np.testing.assert_allclose(apart, np.mean(np.abs(spectra) ** 2, axis=(0, 1))[used], rtol=1e-3)


def test_strips_that_show_something_else_are_left_out() -> None:
    rows = texture(360, 640, 4).astype(np.uint32)
    assert not odd_strips(spectra_of(rows, 1.0)).any()
    rows[60:120] = 100 + 60 * (np.arange(640) // 5 % 2)[None] + 30 * (np.arange(60) % 2)[:, None] * (np.arange(640) % 3)
    odd = odd_strips(spectra_of(rows, 1.0))
    assert set(np.flatnonzero(odd)) == {2, 3}
    assert len(wall_rows(rows, odd)) == 300
    kept = wall_spectra(rows, 1.0)
    assert kept is not None
    assert kept.rows.sum() == 300


def test_a_codec_is_recognised_by_its_blocks_and_its_comb_left_out() -> None:
    frames = rendered(6.0, 6, bright=True).frames
    coded = [cv2.imdecode(cv2.imencode(".jpg", f, [cv2.IMWRITE_JPEG_QUALITY, 60])[1], 0) for f in frames]
    assert wall_copies(list(frames))[1].all()
    assert not wall_copies(coded)[1].all()
    frequency = np.arange(4, 288) / 640
    usable = block_notches(frequency, 640)
    assert not usable[np.isclose(frequency % 0.125, 0.0)].any()
    assert usable.mean() > 0.5


@pytest.mark.parametrize("displacement_px", [2.3, 31.0])
def test_without_its_notches_a_codec_silences_the_composite(
    displacement_px: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = rendered(displacement_px, 1, bright=True, contrast=0.1, camera={"jpeg_quality": 80}).frames
    estimate = fit_composite(frames, PERIOD_S)
    assert estimate.displacement_px == pytest.approx(displacement_px, abs=0.08)
    monkeypatch.setattr("axialnav.estimators.spectral.copies.blocky", lambda rows: False)
    assert not fit_composite(frames, PERIOD_S).accepted
