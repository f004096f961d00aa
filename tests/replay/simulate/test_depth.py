"""The compiled depth of flat pieces against one ray per pixel."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.replay.simulate.kernels import bring_nearer

FOCAL_PX, ROWS, COLS = 60.0, 48, 64


def slopes() -> np.ndarray:
    """Rays (x, y, 1) of all pixels, shape (rows, cols, 3)."""
    v, u = np.mgrid[:ROWS, :COLS]
    x, y = (u - 0.5 * (COLS - 1)) / FOCAL_PX, (v - 0.5 * (ROWS - 1)) / FOCAL_PX
    return np.stack([x, y, np.ones_like(x)], axis=2)


def lines_of(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Linear forms and height of a piece in camera axes, corners (4, 3) counter-clockwise as seen from free space."""
    along = np.roll(corners, -1, axis=0) - corners
    normal = np.cross(along[0], along[1])
    normal /= np.linalg.norm(normal)
    height = float(-normal @ corners[0])
    inward = np.cross(normal, along)
    return np.vstack([-normal, -np.sum(inward * corners, axis=1)[:, None] * -normal + height * inward]), height


@pytest.mark.parametrize("seed", range(8))
def test_a_piece_is_as_deep_as_its_rays_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    across, down = rng.normal(size=(2, 3))
    down -= across * (across @ down) / (across @ across)
    middle = np.array([*rng.uniform(-1, 1, 2), rng.uniform(2.0, 4.0)])
    corners = np.array([middle + a * across + b * down for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    lines, height = lines_of(corners)
    if height < 0.0:
        lines, height = lines_of(corners[::-1])
    depth = np.full((ROWS, COLS), np.inf, dtype=np.float32)
    bring_nearer(lines, height, FOCAL_PX, depth)
    rays = slopes()
    normal = np.cross(across, down)
    with np.errstate(divide="ignore"):
        there = (normal @ middle) / (rays @ normal)
    hit = rays * there[..., None] - middle
    a, b = hit @ across / (across @ across), hit @ down / (down @ down)
    inside = (there > 0.0) & (np.abs(a) <= 1.0) & (np.abs(b) <= 1.0)
    near_rim = (np.abs(np.abs(a) - 1.0) < 1e-6) | (np.abs(np.abs(b) - 1.0) < 1e-6)
    assert inside.any()
    assert np.array_equal(np.isfinite(depth)[~near_rim], inside[~near_rim])
    np.testing.assert_allclose(depth[inside & ~near_rim], there[inside & ~near_rim], rtol=1e-5)


def test_what_is_nearer_stays() -> None:
    lines, height = lines_of(np.array([[-9.0, -9.0, 3.0], [-9.0, 9.0, 3.0], [9.0, 9.0, 3.0], [9.0, -9.0, 3.0]]))
    assert height == pytest.approx(3.0)
    depth = np.full((ROWS, COLS), 5.0, dtype=np.float32)
    depth[:, :10] = 2.0
    bring_nearer(lines, height, FOCAL_PX, depth)
    assert (depth[:, :10] == 2.0).all()
    assert (depth[:, 10:] == 3.0).all()
