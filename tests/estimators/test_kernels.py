"""The compiled passes against plain numpy and brute force."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest

from axialnav.estimators.extra import extra_step
from axialnav.estimators.kappa import blur_transfers
from axialnav.estimators.layout import BANDS, STRIPS, RowLayout, binned_coefficients, remove_level
from axialnav.estimators.occlusion import OccluderFinder
from axialnav.estimators.positions import (
    climb,
    coherent_power,
    free_positions,
    motion_basis,
    parameter_covariance,
    position_gains,
    position_scores,
)
from axialnav.estimators.products import Products
from axialnav.estimators.roll import unrolled
from axialnav.estimators.rows import bin_columns, fast_length, padded_length, row_sums, sum_rows
from axialnav.estimators.search import LagTransform
from axialnav.estimators.spectrum import Band, add_power, pair_count, pair_frames, pair_products, row_spectra
from axialnav.estimators.texture import sharp_family, smooth_noise, texture_power
from axialnav.estimators.window import FrameWindow
from tests.estimators.scenes import texture

FRAMES = 4


def _coefficients(frame: np.ndarray, layout: RowLayout, height: int, first_row: int = 0) -> np.ndarray:
    out = np.full((layout.used, frame.shape[1]), np.nan, dtype=np.float32)
    sums, work = row_sums(frame.shape[1], height, frame.dtype), np.zeros((1 << layout.levels, frame.shape[1]))
    kept = np.empty_like(frame) if first_row == 0 else frame[:0]
    binned_coefficients(frame, first_row, height, layout.levels, layout.place, sums, work.astype(np.float32), kept, out)
    np.testing.assert_array_equal(kept, frame[: len(kept)])
    return out


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_coefficients_are_haars_of_row_sums(dtype: type) -> None:
    """Brute force: an orthonormal matrix on blocks of binned rows."""
    frame = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, (180, 40)).astype(dtype)
    layout = RowLayout(60)
    haar = np.array([[1.0]])
    for _ in range(layout.levels):
        fine = np.kron(np.eye(len(haar)), [1.0, -1.0])
        haar = np.concatenate([np.kron(haar, [1.0, 1.0]), fine]) / np.sqrt(2.0)
    blocks = frame.reshape(60, 3, 40).sum(axis=1)[: layout.used].reshape(-1, len(haar), 40)
    expected = np.einsum("ij,bjc->bic", haar, blocks).reshape(-1, 40)
    np.testing.assert_allclose(_coefficients(frame, layout, 3)[layout.place], expected, rtol=1e-5, atol=1e-2)


def test_the_level_of_a_column_is_the_median_of_five_bands() -> None:
    layout = RowLayout(60)
    rows = np.random.default_rng(1).normal(size=(layout.used, 40)).astype(np.float32)
    smooth = [np.arange(first, end) for first, end in layout.smooth]
    bands = [rows[np.concatenate(smooth[k : k + 2])].mean(axis=0) for k in range(0, STRIPS, STRIPS // BANDS)]
    expected = rows.copy()
    expected[np.concatenate(smooth)] -= np.median(bands, axis=0)
    remove_level(rows, layout.smooth, np.empty((BANDS, 40), dtype=np.float32))
    np.testing.assert_allclose(rows, expected, atol=1e-5)


def test_an_object_in_one_band_leaves_the_other_rows_alone() -> None:
    """GIVEN a bright block in the lowest fifth WHEN columns are levelled THEN rows above do not see it."""
    frame = np.full((160, 50), 90, dtype=np.uint8)
    frame[140:, 10:20] = 200
    layout = RowLayout(80)
    out = _coefficients(frame, layout, 2)
    remove_level(out, layout.smooth, np.empty((BANDS, 50), dtype=np.float32))
    last_band = layout.strip_edges[STRIPS - STRIPS // BANDS]
    assert np.abs(out[:last_band]).max() == 0.0
    assert np.abs(out[last_band:, 15]).max() > 100.0


def test_rows_outside_the_frame_repeat_its_border() -> None:
    frame = texture(40, 64, 0)
    out, sums = np.empty(64, dtype=np.float32), row_sums(64, 4, frame.dtype)
    sum_rows(frame, 38, 4, sums, out)
    np.testing.assert_array_equal(out, frame[38].astype(float) + 3.0 * frame[39])
    sum_rows(frame, -2, 4, sums, out)
    np.testing.assert_array_equal(out, 3.0 * frame[0].astype(float) + frame[1])


def test_binned_columns_are_sums_about_their_mean() -> None:
    frame = texture(48, 90, 2)
    out = np.empty((5, 48), dtype=np.float32)
    bin_columns(frame, 3, 10, 1, out)
    sums = np.array([frame[:, 3 + 10 * c : 11 + 10 * c].sum(axis=1) for c in range(5)], dtype=np.float64)
    np.testing.assert_allclose(out, sums - sums.mean(axis=1, keepdims=True), atol=0.05)
    every_third = np.empty((5, 16), dtype=np.float32)
    bin_columns(frame, 3, 10, 3, every_third)
    np.testing.assert_allclose(every_third, sums[:, ::3] - sums[:, ::3].mean(axis=1, keepdims=True), atol=0.05)


@pytest.mark.parametrize("rows", [17, 45, 100, 270])
def test_the_layout_keeps_strips_and_classes_apart(rows: int) -> None:
    layout = RowLayout(rows)
    assert sorted(layout.place.tolist()) == list(range(layout.used))
    assert layout.count.sum() == layout.used
    assert layout.count.shape == (STRIPS, layout.classes)
    coarse = layout.coarse_count.shape[1]
    np.testing.assert_array_equal(layout.coarse_count, layout.count[:, :coarse].reshape(BANDS, -1, coarse).sum(axis=1))
    assert len(set(layout.coarse_rows.tolist())) == layout.coarse_edges[-1] == layout.coarse_count.sum()
    np.testing.assert_array_equal(np.diff(layout.smooth, axis=1)[:, 0], layout.count[:, 0])


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
    squares = np.zeros((4, band.count), dtype=np.float32)
    add_power(re[0], im[0], edges, squares)
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


def _ring(planes: np.ndarray) -> np.ndarray:
    """Products by pair (1, p, f) as products by slots (n, n, 1, f)."""
    ring = np.zeros((FRAMES, FRAMES, 1, planes.shape[-1]), dtype=np.float32)
    for p, (i, j) in enumerate(pair_frames(FRAMES)):
        ring[i, j, 0] = planes[0, p]
    return ring


def test_score_and_information_are_derivatives_of_the_brute_force_likelihood() -> None:
    re, im, band = _spectra(6)
    omega, rng = 2.0 * np.pi * band.frequency(), np.random.default_rng(7)
    weight, x = rng.uniform(0.5, 1.5, band.count), rng.normal(size=FRAMES)
    p_re, p_im = _weighted_products(re, im, weight)
    score, information = np.empty((1, FRAMES)), np.empty((1, FRAMES, FRAMES))
    coherence = np.empty((1, pair_count(FRAMES)))
    one = np.ones((1, band.count), dtype=np.float32)
    position_scores(p_re[None], p_im[None], np.arange(len(p_re[0])), one, omega, x, score, information, coherence)

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


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0])  # the lags reach round the end of the longer ones' spectra
def test_coherent_power_and_the_search_agree_with_brute_force(step: float) -> None:
    """The profile by inverse transforms is the likelihood of positions ``d k``."""
    re, im, band = _spectra(8)
    omega, weight = 2.0 * np.pi * band.frequency(), np.ones(band.count, dtype=np.float32)
    p_re, p_im = _weighted_products(re, im, weight)
    grid = np.arange(-3.0, 3.1, step)
    search = LagTransform(1, band)
    found = search.profiles(_ring(p_re), _ring(p_im), np.arange(FRAMES), weight[None], grid, np.ones(1))
    brute = [_likelihood(re, im, omega, weight, d * np.arange(FRAMES)) for d in grid]
    np.testing.assert_allclose(found.gain[0], brute, rtol=1e-3, atol=1e-3 * np.abs(brute).max())
    out = np.empty((1, band.count), dtype=np.float32)
    coherent_power(p_re, p_im, omega, 1.5 * np.arange(FRAMES), out)
    assert 2.0 * out.sum() == pytest.approx(_likelihood(re, im, omega, weight, 1.5 * np.arange(FRAMES)), rel=1e-3)


def test_gains_of_positions_are_the_brute_force_likelihood() -> None:
    re, im, band = _spectra(12)
    omega, rng = band.omega(), np.random.default_rng(13)
    weight, positions, gain = rng.uniform(0.5, 1.5, band.count), rng.normal(size=(7, FRAMES)), np.empty(7)
    p_re, p_im = _weighted_products(re, im, np.ones(band.count))
    halves = [np.concatenate([0.5 * p, 0.5 * p]) for p in (p_re, p_im)]  # two classes of rows
    position_gains(*halves, np.tile(weight.astype(np.float32), (2, 1)), omega, positions, gain)
    brute = np.array([_likelihood(re, im, omega, weight, x) for x in positions])
    np.testing.assert_allclose(2.0 * gain, brute, rtol=1e-3, atol=1e-4 * np.abs(brute).max())


def test_products_without_roll_are_those_of_spectra_without_it() -> None:
    """GIVEN spectra turned as a roll turns them WHEN it is taken out THEN the products of the others are left."""
    band, rng, height = Band(128), np.random.default_rng(14), np.array([-0.8, 0.1, 0.7])
    y = rng.normal(size=(3, FRAMES, band.count)) + 1j * rng.normal(size=(3, FRAMES, band.count))
    shift = np.array([0.4, -0.2, 0.0, 0.3])
    rolled = y * np.exp(-1j * band.omega() * height[:, None, None] * shift[:, None])
    i, j = pair_frames(FRAMES).T
    level, seen = (z[:, i] * z[:, j].conj() for z in (y, rolled))
    products = Products(
        seen.real.astype(np.float32)[:, None], seen.imag.astype(np.float32)[:, None],
        np.zeros((3, 1, band.count), dtype=np.float32), np.zeros(FRAMES), band, 128, np.ones((3, 1)), height,
        np.arange(len(i)),
    )  # fmt: skip
    found = unrolled(products, shift)
    np.testing.assert_allclose(found.re[:, 0] + 1j * found.im[:, 0], level, atol=1e-4)


@pytest.mark.parametrize("accelerated", [False, True])
def test_covariance_of_the_parameters_is_the_shrunk_sandwich(accelerated: bool) -> None:
    rng, basis = np.random.default_rng(15), motion_basis(5, accelerated)
    root, score = rng.normal(size=(9, 5, 5)), rng.normal(size=(9, 5))
    information, found = np.einsum("sij,skj->sik", root, root), np.empty((basis.shape[1],) * 2)
    assert parameter_covariance(score, information, basis, np.array([6.0, 1.6]), found)
    J = basis.T @ information.sum(axis=0) @ basis
    meat = 9.0 * np.atleast_2d(np.cov((score @ basis).T))
    inverse = np.linalg.inv(J)
    np.testing.assert_allclose(found, inverse @ ((8.0 * meat + 6.0 * 1.6 * J) / 14.0) @ inverse, rtol=1e-9)
    assert not parameter_covariance(score, -information, basis, np.array([6.0, 1.6]), found)


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
    padded = padded_length(length)
    assert padded % 2 == 0
    assert length <= padded <= 1.12 * length + 2
    assert cv2.getOptimalDFTSize(padded) == padded


def test_the_ring_gives_the_same_products_whatever_was_in_it_before() -> None:
    frames = [texture(64, 96, k) for k in range(6)]
    fresh, used = (FrameWindow(64, 96, 3, np.dtype(np.uint8)) for _ in range(2))
    for frame in frames[3:]:
        fresh.push(frame)
    for frame in frames:
        used.push(frame)
    grid = np.arange(-5.0, 5.0, 0.25)
    np.testing.assert_array_equal(*(w.coarse.profiles(w.order, grid).gain for w in (fresh, used)))
    np.testing.assert_array_equal(fresh.following(2.0).im, used.following(2.0).im)


@pytest.mark.parametrize("accelerated", [False, True])
def test_the_climb_ends_at_the_top_of_the_brute_force_likelihood(accelerated: bool) -> None:
    band, rng = Band(128), np.random.default_rng(9)
    omega, x = band.omega(), motion_basis(FRAMES, accelerated) @ np.array([0.31, -0.2][: 1 + accelerated])
    wall = rng.standard_normal((2, 30, band.count)) @ np.diag(1.0 / (1.0 + np.arange(band.count)))
    y = (wall[0] + 1j * wall[1]) * np.exp(-1j * omega * x[:, None, None])
    y += 0.02 * (rng.standard_normal(y.shape) + 1j * rng.standard_normal(y.shape))
    p_re, p_im = _weighted_products(y.real, y.imag, np.ones(band.count))
    basis, one = motion_basis(FRAMES, accelerated), np.ones((1, band.count), dtype=np.float32)
    motion = np.zeros(1 + accelerated)
    assert climb(p_re, p_im, one, omega, basis, np.zeros(FRAMES), motion, np.array([0.3, 1e-6, 20.0]))

    def value(at: np.ndarray) -> float:
        return _likelihood(y.real, y.imag, omega, np.ones(band.count), basis @ at)

    for step in 0.003 * np.vstack([np.eye(len(motion)), -np.eye(len(motion))]):
        assert value(motion + step) < value(motion)


def test_extra_parameters_step_as_the_dense_solution_says() -> None:
    rng = np.random.default_rng(10)
    strips, known, free = 4, motion_basis(5, False), free_positions(5, 0)
    root = rng.normal(size=(strips, 5, 5))
    information, score = np.einsum("sij,skj->sik", root, root), rng.normal(size=(strips, 5))
    height, step = np.linspace(-1.0, 1.0, strips), np.zeros(4)
    chi2 = extra_step(score, information, height, known, free, step)
    designs = [np.hstack([known, h * free]) for h in height]
    J = sum(d.T @ i @ d for d, i in zip(designs, information, strict=True))
    g = sum(d.T @ s for d, s in zip(designs, score, strict=True))
    solved, covariance = np.linalg.solve(J, g), np.linalg.inv(J)
    np.testing.assert_allclose(step, solved[1:], rtol=1e-9)
    assert chi2 == pytest.approx(float(solved[1:] @ np.linalg.solve(covariance[1:, 1:], solved[1:])))


def test_smooth_noise_and_texture_find_what_made_the_power() -> None:
    band, rng = Band(512), np.random.default_rng(11)
    shapes, family, starts = sharp_family(band.first, band.count, band.length)
    truth, noise = 40.0 * shapes[9], np.full(band.count, 2.0)
    power = (truth + noise) * rng.gamma(100.0, 0.01, band.count)
    found, level = np.empty(band.count), np.empty(band.count)
    texture_power(power, noise, 100.0, shapes, family, starts, found)
    np.testing.assert_allclose(found, truth, rtol=0.1)
    smooth_noise(noise * rng.gamma(100.0, 0.01, band.count), 0.0, level)
    np.testing.assert_allclose(level, noise, rtol=0.06)


def test_an_object_that_stands_still_is_found_where_it_is() -> None:
    rng = np.random.default_rng(12)
    wall = rng.normal(size=(40, 300)).astype(np.float32)
    planes = np.stack([wall[:, 3 * k : 3 * k + 256] for k in range(4)]) + rng.normal(size=(4, 40, 256))
    planes[:, 8:12, 64:96] += 9.0 * np.sign(rng.normal(size=(4, 32)))
    finder = OccluderFinder(256, np.stack([np.arange(0, 40, 4), np.arange(4, 41, 4)], axis=1))
    hidden = finder.hidden(planes.astype(np.float32), np.arange(4), -3 * np.arange(4))
    assert np.argwhere(hidden).tolist() == [[2, 4], [2, 5]]
    assert not finder.hidden(planes.astype(np.float32), np.arange(4), np.zeros(4, dtype=np.int64)).any()


def test_an_object_goes_on_where_its_edge_runs_along_the_motion() -> None:
    """GIVEN a smooth stick along the rows WHEN cells are looked at THEN it is hidden between its ends, too."""
    rng = np.random.default_rng(13)
    wall = rng.normal(size=(40, 300)).astype(np.float32)
    planes = np.stack([wall[:, 3 * k : 3 * k + 256] for k in range(4)]) + rng.normal(size=(4, 40, 256))
    planes[:, 9, 56:168] = 9.0 + 0.1 * rng.normal(size=(4, 112))
    finder = OccluderFinder(256, np.stack([np.arange(0, 40, 4), np.arange(4, 41, 4)], axis=1))
    hidden = finder.hidden(planes.astype(np.float32), np.arange(4), -3 * np.arange(4))
    assert np.argwhere(hidden).tolist() == [[2, b] for b in range(3, 11)]


def test_transfers_of_blurs_are_squared_sincs() -> None:
    omega, length_px = Band(640).omega()[7:], np.array([2.5, 9.0, 31.0])
    found = np.empty((3, len(omega) // 4))
    blur_transfers(length_px, omega, 4, found)
    exact = np.sinc(length_px[:, None] * omega / (2.0 * np.pi)) ** 2
    expected = exact[:, : 4 * found.shape[1]].reshape(3, -1, 4).mean(axis=2)
    np.testing.assert_allclose(found, expected, atol=1e-6)
