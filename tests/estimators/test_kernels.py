"""The compiled passes against plain numpy and brute force."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest

from axialnav.estimators.layout import STRIPS, RowLayout, haar_rows
from axialnav.estimators.positions import coherent_power, motion_basis, position_scores
from axialnav.estimators.rows import LEVEL_BANDS, bin_columns, bin_rows, fast_length
from axialnav.estimators.search import lag_sums, profiles
from axialnav.estimators.spectrum import Band, pair_count, pair_frames, pair_products, power, row_spectra
from axialnav.estimators.window import FrameWindow
from tests.estimators.scenes import texture

FRAMES = 4


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_binned_rows_are_sums_without_the_median_level_of_five_bands(dtype: type) -> None:
    frame = np.random.default_rng(1).integers(0, 255, (60, 40)).astype(dtype)
    out = np.empty((20, 40), dtype=np.float32)
    bin_rows(frame, 0, 3, out)
    sums = frame.reshape(20, 3, 40).sum(axis=1).astype(np.float64)
    level = np.median(sums.reshape(LEVEL_BANDS, -1, 40).mean(axis=1), axis=0)
    np.testing.assert_allclose(out, sums - level, atol=1e-3)


def test_an_object_in_one_band_leaves_the_other_rows_alone() -> None:
    """GIVEN a bright block in the lowest fifth WHEN columns are levelled THEN rows above do not see it."""
    frame = np.full((100, 50), 90, dtype=np.uint8)
    frame[85:, 10:20] = 200
    out = np.empty((50, 50), dtype=np.float32)
    bin_rows(frame, 0, 2, out)
    assert np.abs(out[:40]).max() == 0.0
    assert out[-1, 15] == 220.0


def test_rows_outside_the_frame_repeat_its_border() -> None:
    frame = texture(40, 64, 0)
    out = np.empty((10, 64), dtype=np.float32)
    bin_rows(frame, 20, 4, out)
    assert np.abs(np.diff(out[5:], axis=0)).max() == 0.0


def test_binned_columns_are_sums_about_their_mean() -> None:
    frame = texture(48, 90, 2)
    out = np.empty((5, 48), dtype=np.float32)
    bin_columns(frame, 3, 4, 10, out)
    sums = np.array([frame[:, 3 + 10 * c : 7 + 10 * c].sum(axis=1) for c in range(5)], dtype=np.float64)
    np.testing.assert_allclose(out, sums - sums.mean(axis=1, keepdims=True), atol=0.05)


@pytest.mark.parametrize("rows", [17, 45, 100, 270])
def test_the_haar_layout_is_orthonormal_and_keeps_strips_apart(rows: int) -> None:
    layout = RowLayout(rows)
    data = np.random.default_rng(3).standard_normal((layout.used, 7)).astype(np.float32)
    out = np.full_like(data, np.nan)
    haar_rows(data, layout.levels, layout.place, np.empty((1 << layout.levels, 7), dtype=np.float32), out)
    assert np.sum(out**2) == pytest.approx(np.sum(data**2), rel=1e-5)
    assert sorted(layout.place.tolist()) == list(range(layout.used))
    assert layout.count.sum() == layout.used
    assert layout.count.shape == (STRIPS, layout.classes)
    if layout.levels:
        size = 1 << layout.levels
        np.testing.assert_allclose(out[layout.place[0]], data[:size].sum(axis=0) / np.sqrt(size), rtol=1e-4, atol=1e-5)


def _spectra(seed: int) -> tuple[np.ndarray, np.ndarray, Band]:
    rng = np.random.default_rng(seed)
    band = Band(128)
    re, im = rng.standard_normal((2, FRAMES, 30, band.count)).astype(np.float32)
    return re, im, band


def test_row_spectra_are_numpys() -> None:
    rows = np.random.default_rng(4).standard_normal((6, 128)).astype(np.float32)
    band = Band(128)
    re, im = np.empty((2, 6, band.count), dtype=np.float32)
    row_spectra(rows, band, np.empty_like(rows), re, im)
    expected = np.fft.rfft(rows, axis=1)[:, band.first : band.last]
    np.testing.assert_allclose(re + 1j * im, expected, atol=1e-3)


def test_pair_products_and_power_are_the_sums_they_claim() -> None:
    re, im, band = _spectra(5)
    edges = np.linspace(0, 30, 5).astype(np.int64)
    a, b = re[0] + 1j * im[0], re[1] + 1j * im[1]
    out = np.empty((2, 4, band.count), dtype=np.float32)
    pair_products(re[0], im[0], re[1], im[1], edges, out[0], out[1])
    expected = [(a * b.conj())[i:j].sum(axis=0) for i, j in pairwise(edges)]
    np.testing.assert_allclose(out[0] + 1j * out[1], expected, atol=1e-3)
    squares = np.empty((4, band.count), dtype=np.float32)
    power(re[0], im[0], edges, squares)
    np.testing.assert_allclose(squares.sum(axis=0), (np.abs(a) ** 2).sum(axis=0), rtol=1e-4)


def _likelihood(re: np.ndarray, im: np.ndarray, omega: np.ndarray, weight: np.ndarray, x: np.ndarray) -> float:
    """Brute force: power of the aligned sum of all frames, cross terms only."""
    y = (re + 1j * im) * np.exp(1j * omega * x[:, None, None])
    return float(np.sum(weight * (np.abs(y.sum(axis=0)) ** 2 - (np.abs(y) ** 2).sum(axis=0))))


def _weighted_products(re: np.ndarray, im: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    y = re + 1j * im
    pairs = [np.sum(y[i] * y[j].conj(), axis=0) * weight for i, j in pair_frames(FRAMES)]
    stacked = np.array(pairs)[None]
    return stacked.real.astype(np.float32), stacked.imag.astype(np.float32)


def test_score_and_information_are_derivatives_of_the_brute_force_likelihood() -> None:
    re, im, band = _spectra(6)
    omega, rng = 2.0 * np.pi * band.frequency(), np.random.default_rng(7)
    weight, x = rng.uniform(0.5, 1.5, band.count), rng.normal(size=FRAMES)
    p_re, p_im = _weighted_products(re, im, weight)
    score, information = np.empty((1, FRAMES)), np.empty((1, FRAMES, FRAMES))
    coherence = np.empty((1, pair_count(FRAMES)))
    position_scores(p_re, p_im, omega, x, score, information, coherence)

    def value(at: np.ndarray) -> float:
        return _likelihood(re, im, omega, weight, at)

    assert 2.0 * coherence.sum() == pytest.approx(value(x), rel=1e-4)
    step, unit = 1e-3, np.eye(FRAMES)
    gradient = [(value(x + step * e) - value(x - step * e)) / (2 * step) for e in unit]
    np.testing.assert_allclose(score[0], gradient, rtol=1e-3, atol=1e-3 * np.abs(gradient).max())
    hessian = [
        [
            (
                value(x + step * (a + b))
                - value(x + step * (a - b))
                - value(x - step * (a - b))
                + value(x - step * (a + b))
            )
            / (4 * step**2)
            for a in unit
        ]
        for b in unit
    ]
    np.testing.assert_allclose(-information[0], hessian, rtol=1e-2, atol=5e-3 * np.abs(hessian).max())
    np.testing.assert_allclose(information[0].sum(axis=1), 0.0, atol=1e-6 * np.abs(information).max())


def test_coherent_power_and_the_search_agree_with_brute_force() -> None:
    """The profile by inverse transforms is the likelihood of positions ``d k``, up to interpolation."""
    re, im, band = _spectra(8)
    omega, weight = 2.0 * np.pi * band.frequency(), np.ones(band.count)
    p_re, p_im = _weighted_products(re, im, weight)
    grid = np.arange(-3.0, 3.1, 0.5)  # on the samples of the transform: no interpolation error
    found = profiles(lag_sums(p_re, p_im, FRAMES), band, grid, np.ones(1))
    brute = [_likelihood(re, im, omega, weight, d * np.arange(FRAMES)) for d in grid]
    np.testing.assert_allclose(found.gain[0], brute, rtol=1e-3, atol=1e-3 * np.abs(brute).max())
    out = np.empty((1, band.count))
    coherent_power(p_re, p_im, omega, 1.5 * np.arange(FRAMES), out)
    assert 2.0 * out.sum() == pytest.approx(_likelihood(re, im, omega, weight, 1.5 * np.arange(FRAMES)), rel=1e-3)


def test_motion_basis_is_centred_and_orthogonal() -> None:
    basis = motion_basis(5, True)
    np.testing.assert_allclose(basis.sum(axis=0), 0.0, atol=1e-12)
    assert basis[:, 0] @ basis[:, 1] == pytest.approx(0.0)


@pytest.mark.parametrize("length", [33, 240, 641, 1918])
def test_fast_lengths_are_even_close_and_fast(length: int) -> None:
    fast = fast_length(length)
    assert fast % 2 == 0
    assert 0.9 * length <= fast <= length
    assert cv2.getOptimalDFTSize(fast) == fast


def test_the_ring_gives_the_same_products_whatever_was_in_it_before() -> None:
    frames = [texture(64, 96, k) for k in range(6)]
    fresh, used = (FrameWindow(64, 96, 3, np.dtype(np.uint8)) for _ in range(2))
    for frame in frames[3:]:
        fresh.push(frame)
    for frame in frames:
        used.push(frame)
    np.testing.assert_array_equal(fresh.fixed().re, used.fixed().re)
    np.testing.assert_array_equal(fresh.following(2.0).im, used.following(2.0).im)
