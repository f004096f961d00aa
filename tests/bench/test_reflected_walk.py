"""A real walk with a reflection added to two of five anchors: what the supervisor is worth there."""

from __future__ import annotations

from pathlib import Path

import pytest

from axialnav.replay.flight import load_flight
from tests.bench.flights import DEFAULT, NO_SUPERVISOR
from tests.bench.wrong_uwb import ASKED_M, WALK, one_reflection

ANCHORS_TAKEN_AS_THEY_COME = {"supervisor.jump_m": "1e9", "supervisor.anchor_m": "1e9"}  # steps, or is elsewhere
PAIRS = ((0, 1), (1, 2), (1, 4), (2, 1), (4, 1))  # those that hurt most without it


@pytest.mark.flights
def test_a_reflection_of_two_anchors_costs_little_and_much_without_the_supervisor(shared: Path) -> None:
    flight = load_flight(shared / "flights" / WALK)
    assert max(one_reflection(flight, pair, DEFAULT) for pair in PAIRS) <= ASKED_M
    assert min(one_reflection(flight, pair, NO_SUPERVISOR) for pair in PAIRS) > ASKED_M


@pytest.mark.flights
def test_it_is_the_exclusion_of_single_anchors_that_helps(shared: Path) -> None:
    """The rest of the supervisor goes on: source as a whole, stuck and copied values, recovery."""
    flight = load_flight(shared / "flights" / WALK)
    alone = one_reflection(flight, (4, 1), ANCHORS_TAKEN_AS_THEY_COME)
    assert alone > 1.5 * ASKED_M
    assert one_reflection(flight, (4, 1), DEFAULT) < 0.6 * alone
