"""The likelihood behind the ratio of blur to displacement."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.estimators.whittle import amplitudes, parabola, whittle_costs


def test_whittles_cost_is_lowest_where_the_spectrum_was_made() -> None:
    frequency = np.linspace(0.01, 0.45, 300)
    shape = frequency**-2.0
    tables = np.sinc(np.arange(4.0, 12.0, 0.5)[:, None] * frequency) ** 2
    rng = np.random.default_rng(3)
    power = (2.0 * shape * tables[7] + 5.0) * rng.gamma(50.0, 1.0 / 50.0, 300)
    cost, model = np.empty(len(tables)), np.empty(300)
    whittle_costs(power, tables, shape[None], cost, np.empty(len(tables), dtype=np.int64))
    assert int(np.argmin(cost)) == 7
    assert amplitudes(power, shape * tables[7], model) == pytest.approx((2.0, 5.0), rel=0.1)
    np.testing.assert_allclose(model, 2.0 * shape * tables[7] + 5.0, rtol=0.1)


def test_a_parabola_is_found_from_three_points_and_a_hill_is_none() -> None:
    x = np.array([1.0, 1.5, 2.0])
    assert parabola(x, 3.0 * (x - 1.6) ** 2) == pytest.approx((1.6, 6.0))
    assert parabola(x, -3.0 * (x - 1.6) ** 2) == (1.5, 0.0)
