"""Plain words: every way in which an autopilot does not follow has a sentence of its own."""

from __future__ import annotations

import re
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as mavlink
import pytest

from axialnav.fusion.live.watch import PATIENCE_NS, Watch, delay_advice

S = 1_000_000_000
NAVIGATING = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_POS_HORIZ_REL
WAITING = mavlink.EKF_ATTITUDE | mavlink.EKF_CONST_POS_MODE


def ekf(flags: int, velocity: float = 0.1, position: float = 0.1) -> Any:
    return mavlink.MAVLink_ekf_status_report_message(flags, velocity, position, 0.0, 0.0, 0.0)


def px4(flags: int, velocity: float = 0.1) -> Any:
    return mavlink.MAVLink_estimator_status_message(0, flags, velocity, 0.1, 0.0, 0.0, 0.0, 0.0, 0.1, 0.1)


def say(watch: Watch, now_ns: int, **changes: Any) -> str:
    how = {"sending": True, "why_not": "", "heard": True, "bad_signatures": 0} | changes
    return watch.sentence(now_ns, **how)


def after(report: Any, profile: Any = "ardupilot", seconds: float = 0.0) -> tuple[Watch, str]:
    """What is said of a report, some time after sending began."""
    watch = Watch(profile, delay_advice(profile, None)[0])
    say(watch, S)
    now = S + round(seconds * 1e9)
    if report is not None:
        watch.take(report, now)
    return watch, say(watch, now)


@pytest.mark.parametrize(
    ("report", "profile", "seconds", "using", "words"),
    [
        (ekf(NAVIGATING), "ardupilot", 1.0, True, "navigates with our estimate"),
        (ekf(WAITING), "ardupilot", 3.0, None, "has not begun to use it yet"),
        (ekf(WAITING), "ardupilot", 13.0, False, "ignored: .*EK3_SRC1_VELXY 6"),
        (ekf(NAVIGATING, velocity=1.4), "ardupilot", 1.0, True, "velocity test is at 1.4 .* check VISO_DELAY_MS"),
        (ekf(NAVIGATING, position=1.2), "ardupilot", 1.0, True, "position test is at 1.2 .* output.heading_deg"),
        (None, "ardupilot", 1.0, None, "no EKF_STATUS_REPORT"),
        (px4(mavlink.ESTIMATOR_VELOCITY_HORIZ), "px4", 1.0, True, "navigates with our estimate"),
        (px4(mavlink.ESTIMATOR_ATTITUDE), "px4", 13.0, False, "ignored: .*EKF2_EV_CTRL"),
        (px4(mavlink.ESTIMATOR_VELOCITY_HORIZ, velocity=2.0), "px4", 1.0, True, "check EKF2_EV_DELAY"),
        (None, "px4", 1.0, None, "no ESTIMATOR_STATUS"),
    ],
)
def test_each_answer_of_the_autopilot_has_its_sentence(report, profile, seconds, using, words: str) -> None:
    watch, sentence = after(report, profile, seconds)
    assert re.search(words, sentence), sentence
    assert watch.using is using
    assert "\n" not in sentence


def test_silence_and_wrong_keys_are_told_apart() -> None:
    watch = Watch("ardupilot", "VISO_DELAY_MS")
    assert say(watch, S, heard=False).startswith("silence: ")
    assert say(watch, S, heard=False, bad_signatures=3).startswith("signing: ")


def test_our_own_silence_comes_with_its_reason() -> None:
    watch, _ = after(ekf(NAVIGATING))
    assert say(watch, 2 * S, sending=False, why_not="no fresh inertial samples") == (
        "not sending: no fresh inertial samples"
    )
    assert watch.using is False


def test_patience_begins_again_when_sending_does() -> None:
    watch, _ = after(ekf(WAITING), seconds=20.0)
    assert watch.using is False
    say(watch, 22 * S, sending=False, why_not="x")
    watch.take(ekf(WAITING), 23 * S)
    assert "not begun" in say(watch, 23 * S)
    watch.take(ekf(WAITING), 23 * S + PATIENCE_NS + S)
    assert "ignored" in say(watch, 23 * S + PATIENCE_NS + S)


def test_an_old_report_is_none() -> None:
    watch, _ = after(ekf(NAVIGATING))
    assert "no EKF_STATUS_REPORT" in say(watch, 6 * S)
    assert watch.using is None


@pytest.mark.parametrize(
    ("profile", "trip_ms", "advice"),
    [
        ("ardupilot", 6.0, ("VISO_DELAY_MS", 6)),
        ("ardupilot", None, ("VISO_DELAY_MS", 2)),
        ("px4", 6.0, ("EKF2_EV_DELAY", 0)),
    ],
)
def test_the_delay_to_set_is_the_way_to_the_autopilot(profile, trip_ms, advice) -> None:
    assert delay_advice(profile, None if trip_ms is None else round(trip_ms * 1e6)) == advice
