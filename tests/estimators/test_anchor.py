"""Windows of a stream are cut once: what that must not change, and when they are cut anew."""

from __future__ import annotations

import math

import numpy as np
import pytest

from axialnav.estimators.anchor import EDGE_PX, OFF_PX, SPARE_SHARE, Anchor
from axialnav.estimators.cuts import WallCuts
from axialnav.estimators.estimate import MotionEstimator
from axialnav.estimators.products import Products
from axialnav.estimators.spectrum import LAST_FREQUENCY
from axialnav.estimators.window import FrameWindow
from tests.estimators.scenes import EXPOSURE_S, PERIOD_S, rendered

WIDTH, FRAMES = 960, 5


def _walk(displacements: list[float]) -> tuple[list[tuple[list[int], list[int]]], int]:
    """Starts and serial numbers after every frame, oldest first, and how often the section was chosen anew."""
    anchor, order, seen, length, begun = Anchor(WIDTH, FRAMES), list(range(FRAMES)), [], 0, 0
    for k, displacement in enumerate(displacements):
        if k:
            order = order[1:] + order[:1]
            anchor.release(order[-1])
        before = [anchor.serial[slot] for slot in order[:-1]]
        anchor.aim(order, displacement)
        starts, serials = [anchor.start[slot] for slot in order], [anchor.serial[slot] for slot in order]
        begun += serials[:-1] != before
        length = anchor.length
        assert min(starts) >= 0
        assert max(starts) + length <= WIDTH
        seen.append((starts, serials))
    return seen, begun


@pytest.mark.parametrize("displacement", [0.0, 0.3, -0.7, 6.1, -6.1, 44.0])
def test_the_section_follows_the_wall_and_is_seldom_chosen_anew(displacement: float) -> None:
    rng = np.random.default_rng(3)
    many = 300
    seen, begun = _walk([displacement + 0.05 * x for x in rng.normal(size=many)])
    times = np.arange(FRAMES) - 0.5 * (FRAMES - 1)
    for starts, _ in seen:
        off = np.array(starts) - displacement * times
        assert np.abs(off - off.mean()).max() <= OFF_PX + 0.5
    common = WIDTH - (FRAMES - 1) * abs(displacement)
    lasting = max(1.0, SPARE_SHARE * common / max(abs(displacement), 0.5))
    assert begun <= 2 + many / lasting * 1.3


def test_the_first_window_shares_all_that_its_frames_have_and_later_ones_a_little_less() -> None:
    anchor, order = Anchor(WIDTH, FRAMES), list(range(FRAMES))
    anchor.aim(order, 4.0)
    assert anchor.length == WIDTH - 16
    assert anchor.offsets(order).tolist() == [-8, -4, 0, 4, 8]
    anchor.release(0)
    anchor.aim([1, 2, 3, 4, 0], 4.0)
    spare = math.floor(SPARE_SHARE * (WIDTH - 16) / 4.0) * 4
    assert anchor.length == WIDTH - 16 - spare - 2 * EDGE_PX
    for slot in order:
        anchor.release(slot)
    anchor.aim(order, -4.0)
    assert anchor.length == WIDTH - 16


def test_another_motion_chooses_another_section() -> None:
    _, begun = _walk([3.0] * 7 + [5.0] * 5)
    assert begun == 3  # the first one, the first of a stream, and the change


def _pushed(window: FrameWindow, frames: np.ndarray, displacement_px: float) -> Products:
    for frame in frames:
        window.push(frame)
        if window.full:
            products = window.following(displacement_px, 0.0, LAST_FREQUENCY)
    return products


@pytest.mark.parametrize("frames", [2, 3, 5])
def test_products_kept_in_the_ring_are_those_of_the_same_windows_cut_anew(frames: int) -> None:
    picture = rendered(2.4, 5, frames=9)
    height, width = picture.frames[0].shape
    window = FrameWindow(height, width, frames, picture.frames.dtype)
    products = _pushed(window, picture.frames, 2.4)
    cut = window._cut
    assert cut is not None
    again = WallCuts(window.layout, width, frames).products(cut, LAST_FREQUENCY)
    for name in ("re", "im"):
        kept, new = (getattr(p, name)[:, :, p.place] for p in (products, again))
        np.testing.assert_array_equal(kept, new)
        np.testing.assert_array_equal(getattr(products.total, name), getattr(again.total, name))
    np.testing.assert_array_equal(products.power, again.power)
    np.testing.assert_allclose(products.total.re, products.re[:, :, products.place].sum(axis=0), rtol=1e-3, atol=1e-1)


def test_a_stream_tells_what_windows_cut_anew_tell() -> None:
    """GIVEN a long stream WHEN windows are kept THEN answers differ by a fraction of sigma, and sigma by 3 %."""
    for motion, seed in ((1.3, 8), (-7.0, 9)):
        picture = rendered(motion, seed, frames=16)
        kept, anew = MotionEstimator(frames=5), MotionEstimator(frames=5)
        for k, frame in enumerate(picture.frames):
            one, other = (estimator.push(round(k * PERIOD_S * 1e9), frame, EXPOSURE_S) for estimator in (kept, anew))
            if anew._window is not None:
                for slot in range(5):
                    anew._window._anchor.release(slot)
            if one is not None and other is not None:
                assert one.accepted
                assert abs(one.displacement_px - other.displacement_px) < 1.0 * other.sigma_px
                assert one.sigma_px == pytest.approx(other.sigma_px, rel=0.15)
