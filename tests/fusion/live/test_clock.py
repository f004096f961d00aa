"""The autopilot's clock on ours: drift, asymmetric and slow answers, reboots, and no answers at all."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.live.clock import BootClock

S, MS, US = 1_000_000_000, 1_000_000, 1_000
OFFSET_NS = 77 * S


def remote(t_ns: int, drift: float, offset_ns: int = OFFSET_NS) -> int:
    return round((t_ns - offset_ns) * (1.0 + drift))


def exchanges(clock: BootClock, t_s: np.ndarray, drift: float, rng: np.random.Generator, offset_ns: int = OFFSET_NS):
    """Answered questions with a floor of 2 ms each way and a tail on either side; yields the time after each."""
    for t in t_s:
        sent = round(t * 1e9)
        there, back = (2 * MS + round(rng.exponential(1.5e6)) for _ in range(2))
        clock.exchange(sent, remote(sent + there, drift, offset_ns), sent + there + back)
        yield sent + there + back


@pytest.mark.parametrize("drift", [-80e-6, 0.0, 40e-6])
def test_stamps_are_right_to_half_a_millisecond_after_ten_seconds(drift: float) -> None:
    rng = np.random.default_rng(1)
    clock, wrong = BootClock(), []
    for after in exchanges(clock, np.arange(100.0, 160.0, 0.25), drift, rng):
        if after > 110 * S:
            mapped = clock.to_companion_ns(remote(after, drift))
            assert mapped is not None
            wrong.append((mapped - after) * 1e-9)
    assert len(wrong) > 150
    assert np.abs(wrong).max() < 0.5e-3
    assert clock.drift_ppm == pytest.approx(-drift * 1e6, abs=10.0)
    assert clock.epoch == 0


def test_stamps_keep_their_distances_while_the_clock_is_corrected() -> None:
    """Samples that are 5 ms apart stay within 1 % of it: the filter integrates over these steps."""
    rng = np.random.default_rng(2)
    clock, steps = BootClock(), []
    before = None
    for after in exchanges(clock, np.arange(10.0, 40.0, 0.1), 50e-6, rng):
        for k in range(20):
            mapped = clock.to_companion_ns(remote(after, 50e-6) + 5 * MS * k)
            if before is not None and k:
                steps.append(mapped - before)
            before = mapped
    assert np.abs(np.array(steps) / (5 * MS) - 1.0).max() <= 0.0101


def test_a_reboot_is_noticed_by_answers_and_by_stamps() -> None:
    rng = np.random.default_rng(3)
    by_answers, by_stamps = BootClock(), BootClock()
    for clock in (by_answers, by_stamps):
        list(exchanges(clock, np.arange(100.0, 110.0, 0.1), 0.0, rng))
    list(exchanges(by_answers, np.arange(111.0, 112.0, 0.1), 0.0, rng, offset_ns=109 * S))
    for k in range(700):
        by_stamps.notice(2 * S + k * 5 * MS, 111 * S + k * 5 * MS)
    for clock in (by_answers, by_stamps):
        assert clock.epoch == 1
        mapped = clock.to_companion_ns(3 * S)
        assert mapped == pytest.approx(112 * S, abs=5 * MS)


def test_a_backlog_that_is_let_go_at_once_is_no_reboot() -> None:
    """The link hung for two seconds; then 400 old messages come within 20 ms, and life goes on."""
    clock = BootClock()
    list(exchanges(clock, np.arange(100.0, 110.0, 0.1), 0.0, np.random.default_rng(6)))
    for k in range(400):
        clock.notice(remote(110 * S + k * 5 * MS, 0.0), 112 * S + k * 50 * US)
    clock.notice(remote(112 * S, 0.0), 112 * S + 21 * MS)
    assert clock.epoch == 0


def test_one_wild_answer_changes_nothing() -> None:
    rng = np.random.default_rng(4)
    clock = BootClock()
    list(exchanges(clock, np.arange(100.0, 110.0, 0.1), 0.0, rng))
    before = clock.to_companion_ns(40 * S)
    clock.exchange(110 * S, 5 * S, 110 * S + 4 * MS)
    assert clock.to_companion_ns(40 * S) == before
    assert clock.epoch == 0


def test_without_answers_the_fastest_message_sets_the_clock() -> None:
    rng = np.random.default_rng(5)
    clock = BootClock()
    for k in range(2000):
        arrival = 100 * S + k * 5 * MS
        clock.notice(remote(arrival, 0.0) - MS - round(rng.exponential(3e6)), arrival)
    mapped = clock.to_companion_ns(remote(110 * S, 0.0))
    assert not clock.synchronised
    assert mapped is not None
    assert MS <= mapped - 110 * S < 1.2 * MS  # the shortest delay stays in it: nobody can know that


def test_an_answer_before_its_question_is_ignored() -> None:
    clock = BootClock()
    clock.exchange(10 * S, 3 * S, 10 * S - US)
    assert clock.to_companion_ns(3 * S) is None
    assert clock.round_trip_ns is None
