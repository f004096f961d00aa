"""Anchors surveyed with the y axis on the wrong side: noticed, used, and told in the user's own frame."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from axialnav.fusion.batch import LEFT_HANDED_EVIDENCE, run_batch
from axialnav.fusion.config import Config, Corridor, Initial, Section
from axialnav.fusion.handedness import MIRROR, explains_better, is_undecided, mirror_config, mirror_tables, mirror_track
from axialnav.models.rig import Surface
from tests.fusion.made_flights import ANCHORS, MadeFlight, Scene, fly

MIRRORED = {name: (x, -y, z) for name, (x, y, z) in ANCHORS.items()}


def surveyed(anchors: dict[str, tuple[float, float, float]], seed: int = 1) -> MadeFlight:
    """A flight that turns, its start unknown, its anchors as surveyed by somebody."""
    scene = Scene(seed=seed, duration_s=40.0, sensors=("uwb0", "range0"), still_s=3.0, yaw_rate_rad_s=0.4)
    flight = fly(scene)
    uwb = msgspec.structs.replace(flight.config.sensor["uwb0"], anchors=anchors)
    config = msgspec.structs.replace(flight.config, initial=None, sensor={**flight.config.sensor, "uwb0": uwb})
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("anchors", "expected"), [(ANCHORS, "right"), (MIRRORED, "left")], ids=["right", "left"])
def test_the_handedness_of_the_survey_is_found(anchors, expected: str, seed: int) -> None:
    flight = surveyed(anchors, seed)
    assert run_batch(flight.config, flight.tables).handedness == expected


def test_the_track_comes_back_in_the_frame_of_the_survey() -> None:
    flight = surveyed(MIRRORED)
    config = msgspec.structs.replace(flight.config, handedness="left")
    result = run_batch(config, flight.tables)
    assert result.handedness == "left"
    late = flight.t_s > 25.0
    miss = np.linalg.norm(result.track.position_m - flight.truth.position_m * MIRROR, axis=1)[late]
    assert np.median(miss) < 0.3
    assert np.median(np.linalg.norm(result.track.position_m - flight.truth.position_m, axis=1)[late]) > 0.5


def test_told_the_wrong_hand_the_filter_explains_the_readings_worse() -> None:
    flight = surveyed(MIRRORED)
    logs = {}
    for hand in ("left", "right"):
        config = msgspec.structs.replace(flight.config, handedness=hand)
        logs[hand] = run_batch(config, flight.tables).log
    mine = logs["left"].source == logs["left"].sensors.index("uwb0")
    assert (logs["left"].weight[mine] > 0.5).mean() > 0.8
    assert explains_better(logs["left"], logs["right"]) > LEFT_HANDED_EVIDENCE


def test_a_flight_that_names_its_start_or_its_hand_has_nothing_to_decide() -> None:
    open_question = surveyed(ANCHORS).config
    assert is_undecided(open_question)
    assert not is_undecided(msgspec.structs.replace(open_question, handedness="right"))
    assert not is_undecided(msgspec.structs.replace(open_question, initial=Initial(position_m=(0.0, 0.0, 1.0))))
    assert not is_undecided(open_question.without(("uwb0",)))


def test_mirroring_twice_changes_nothing() -> None:
    flight = fly(Scene(seed=1, duration_s=2.0, sensors=("uwb0", "fix0", "flow0")))
    flow = msgspec.structs.replace(flight.config.sensor["flow0"], surface="wall")
    config = msgspec.structs.replace(
        flight.config,
        corridor=Corridor(axis=(0.6, 0.8, 0.0), section=(Section(kind="corner", start=(1, 2, 3), end=(4, 5, 6)),)),
        surface={"wall": Surface(normal=(0.0, -1.0, 0.0), offset_m=-2.0)},
        sensor={**flight.config.sensor, "flow0": flow},
    )
    assert mirror_config(mirror_config(config)) == config
    assert mirror_config(config) != config
    twice = mirror_tables(mirror_tables(flight.tables))
    for name, table in flight.tables.items():
        for column, values in table.columns.items():
            np.testing.assert_array_equal(twice[name].columns[column], values)
    track = run_batch(flight.config, flight.tables).track
    back = mirror_track(mirror_track(track))
    for field in ("position_m", "velocity_m_s", "position_covariance", "velocity_covariance"):
        np.testing.assert_array_equal(getattr(back, field), getattr(track, field))


def test_a_mirrored_start_is_a_mirrored_start() -> None:
    config = Config(initial=Initial(position_m=(1.0, 2.0, 3.0), velocity_m_s=(0.1, 0.2, 0.3), yaw_rad=0.4))
    initial = mirror_config(config).initial
    assert initial is not None
    assert (initial.position_m, initial.velocity_m_s, initial.yaw_rad) == ((1.0, -2.0, 3.0), (0.1, -0.2, 0.3), -0.4)
