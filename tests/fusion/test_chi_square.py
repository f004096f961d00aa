"""Gate thresholds against scipy."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from axialnav.fusion.chi_square import chi_square_threshold


@given(st.sampled_from([1, 2, 3]), st.floats(1e-6, 1.0 - 1e-12))
def test_thresholds_equal_scipys(dof: int, probability: float) -> None:
    assert chi_square_threshold(dof, probability) == pytest.approx(float(chi2.ppf(probability, dof)), rel=1e-6)


@pytest.mark.parametrize(("dof", "probability"), [(0, 0.5), (4, 0.5), (1, 0.0), (2, 1.0), (3, -1.0)])
def test_nonsense_is_refused(dof: int, probability: float) -> None:
    with pytest.raises(ValueError, match=r"dof 1\.\.3"):
        chi_square_threshold(dof, probability)
