"""The ray to a plane against a walk along the ray."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from axialnav.models.ray import distance_along_ray
from axialnav.models.state import N_ERROR
from axialnav.models.wall_range import wall_range

NONE = np.zeros(3)


def unit(v):
    return v / np.linalg.norm(v)


def test_distance_is_where_a_walk_along_the_ray_meets_the_plane() -> None:
    rng = np.random.default_rng(21)
    met = 0
    for attitude in Rotation.random(300, rng=rng):
        position, lever = rng.normal(0, 3, 3), rng.normal(0, 0.2, 3)
        ray, normal = unit(rng.normal(size=3)), unit(rng.normal(size=3))
        offset = normal @ (position + attitude.apply(lever)) - rng.uniform(0.1, 5)  # the sensor is in free space
        out = np.empty(8)
        cosine = distance_along_ray(position, attitude.as_matrix(), lever, ray, normal, offset, out)
        assert cosine == pytest.approx(-normal @ attitude.apply(ray), abs=1e-12)
        if cosine < 0.05:
            continue

        def height(along, position=position, attitude=attitude, lever=lever, ray=ray, normal=normal, offset=offset):
            return normal @ (position + attitude.apply(lever + along * ray)) - offset

        assert out[0] == pytest.approx(brentq(height, 0.0, 1000.0), abs=1e-9)
        met += 1
    assert met > 100


def test_a_ray_away_from_the_plane_meets_nothing() -> None:
    up = np.array([0.0, 0.0, 1.0])
    cosine = distance_along_ray(np.array([0.0, 0.0, 1.0]), np.eye(3), NONE, up, up, 0.0, np.empty(8))
    assert cosine == pytest.approx(-1.0)


@pytest.mark.parametrize(("tilt_deg", "sees"), [(0, True), (59, True), (61, False), (120, False)])
def test_a_range_finder_is_blind_beyond_sixty_degrees(tilt_deg: float, sees: bool) -> None:
    R_BS = Rotation.from_euler("x", 180 + tilt_deg, degrees=True).as_matrix()  # the beam leaves the vertical
    H = np.zeros(N_ERROR)
    up = np.array([0.0, 0.0, 1.0])
    reading = wall_range(np.array([0.0, 0.0, 2.0]), np.eye(3), R_BS, NONE, up, 0.0, False, H, np.empty(8))
    if sees:
        assert reading == pytest.approx(2.0 / np.cos(np.radians(tilt_deg)))
    else:
        assert np.isnan(reading)
