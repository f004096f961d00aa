"""A real walk with a reflection added to two of five anchors: what the supervisor is worth there."""

from __future__ import annotations

from pathlib import Path

import pytest

from axialnav.replay.flight import load_flight
from tests.bench.flights import DEFAULT, NO_SUPERVISOR
from tests.bench.wrong_uwb import ASKED_M, WALK, one_reflection

PAIRS = ((0, 1), (1, 2), (1, 4), (2, 1), (4, 1))  # those that hurt most without it


@pytest.mark.flights
def test_a_reflection_of_two_anchors_costs_little_and_much_without_the_supervisor(shared: Path) -> None:
    flight = load_flight(shared / "flights" / WALK)
    assert max(one_reflection(flight, pair, DEFAULT) for pair in PAIRS) <= ASKED_M
    assert min(one_reflection(flight, pair, NO_SUPERVISOR) for pair in PAIRS) > ASKED_M
