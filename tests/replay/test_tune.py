"""Tuning: known noise is found again, what cannot be known is said, and nothing that was read is changed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.rehearsal import Rehearsal
from axialnav.replay import cli
from axialnav.replay.flight_writer import write_flight
from axialnav.replay.run import replay
from axialnav.replay.tuning.cost import Cost, Subject
from axialnav.replay.tuning.evidence import collect, counts_of
from axialnav.replay.tuning.optimise import describe, standard_errors
from axialnav.replay.tuning.parameters import apply, default_names, parameter, read
from axialnav.replay.tuning.scoring import Expansion, minimise
from axialnav.replay.tuning.tune import tune
from axialnav.replay.tuning.tune_table import config_text, summary
from tests.replay.made_recordings import flown

NAMES = ["imu.accel_noise_scale", "imu.accel_walk_scale", "sensor.uwb0.sigma_m", "sensor.flow0.sigma_px"]


def quadratic(hessian: np.ndarray, at: np.ndarray):  # type: ignore[no-untyped-def]
    def batch(points: list[np.ndarray]) -> list[float]:
        return [float((x - at) @ hessian @ (x - at)) / 2.0 + 7.0 for x in points]

    return batch


def bowl(hessian: np.ndarray, at: np.ndarray):  # type: ignore[no-untyped-def]
    def expand(x: np.ndarray) -> Expansion:
        return Expansion(quadratic(hessian, at)([x])[0], hessian @ (x - at), hessian)

    return expand


def test_the_minimum_of_a_badly_scaled_bowl_and_its_errors() -> None:
    """Twice a negative log-likelihood with covariance C has the Hessian 2 C^-1."""
    covariance = np.array([[1e-4, 2e-3, 0.0], [2e-3, 9e-2, 0.0], [0.0, 0.0, 1e-2]])
    at = np.array([0.7, -1.2, 0.1])
    batch, bounds = quadratic(2.0 * np.linalg.inv(covariance), at), [(-3.0, 3.0)] * 3
    found, cost = minimise(batch, bowl(2.0 * np.linalg.inv(covariance), at), np.zeros(3), bounds)
    sigma = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(found - at) < 0.2 * sigma)
    assert cost == pytest.approx(7.0, abs=0.1)
    minimum = describe(batch, at, bounds)
    assert minimum.sigma == pytest.approx(sigma, rel=1e-3)
    assert minimum.correlation[0, 1] == pytest.approx(covariance[0, 1] / sigma[0] / sigma[1], rel=1e-3)
    assert not minimum.at_bound.any()
    assert not minimum.unidentifiable.any()


def test_bounds_and_flat_directions_are_named() -> None:
    hessian, at = np.diag([200.0, 1e-6, 200.0]), np.array([5.0, 0.0, 0.2])
    batch = quadratic(hessian, at)
    found, _ = minimise(batch, bowl(hessian, at), np.zeros(3), [(-1.0, 1.0)] * 3)
    minimum = describe(batch, found, [(-1.0, 1.0)] * 3)
    assert minimum.at_bound.tolist() == [True, False, False]
    assert minimum.unidentifiable.tolist() == [False, True, False]


def test_a_sum_that_is_known_leaves_its_parts_unknown() -> None:
    sigma, _ = standard_errors(np.array([[200.0, 200.0, 0.0], [200.0, 200.0, 0.0], [0.0, 0.0, 200.0]]))
    assert np.isinf(sigma[:2]).all()
    assert sigma[2] == pytest.approx(0.1)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.08])
def test_four_noise_values_are_found_from_starts_four_times_off(share: float) -> None:
    """A vibrating quadrotor for 120 s; with and without 3 m reflections in 8 % of the ranges."""
    flight = flown(3, 120.0, outlier_share=share)
    true = {name: read(flight.config, name) for name in NAMES}
    wrong = {name: true[name] * factor for name, factor in zip(NAMES, (4.0, 0.25, 4.0, 0.25), strict=True)}
    tuning = tune([flight], apply(flight.config, wrong), free=NAMES)
    ratio = {t.parameter.name: t.value / true[t.parameter.name] for t in tuning.tuned}
    assert ratio["imu.accel_walk_scale"] == pytest.approx(1.0, abs=0.35)
    for name in (NAMES[0], *NAMES[2:]):
        assert ratio[name] == pytest.approx(1.0, abs=0.10), name
    for found in tuning.tuned:
        assert 0.002 < found.sigma < 0.4
        assert abs(np.log(ratio[found.parameter.name])) < 4.0 * found.sigma or share
    (score,) = tuning.scores
    assert score.gain_nats > 1000.0
    assert score.after["axial_velocity_m_s"]["rmse"] < score.before["axial_velocity_m_s"]["rmse"]


def test_more_threads_do_not_change_the_cost() -> None:
    flight = flown(4, 8.0)
    subject = Subject("x", flight.config, Rehearsal(flight.config, flight.tables))
    parameters = [parameter(flight.config, name) for name in NAMES]
    rng = np.random.default_rng(1)
    points = [np.zeros(4), *(rng.normal(0, 0.3, 4) for _ in range(7))]
    alone, together = Cost([subject], parameters, 1), Cost([subject], parameters, 4)
    assert alone(points) == together(points)


def test_the_innovations_of_a_rehearsal_are_those_of_a_replay() -> None:
    flight = flown(5, 6.0)
    log = Rehearsal(flight.config, flight.tables).run(flight.config).log
    np.testing.assert_array_equal(log.innovation, replay(flight, flight.config).log.innovation)


def test_a_reading_that_turns_blind_is_charged_its_gate() -> None:
    flight = flown(5, 6.0)
    terms = Rehearsal(flight.config, flight.tables).run(flight.config).terms
    nothing = type(terms)(np.zeros_like(terms.used), 0 * terms.nis, 0 * terms.log_det, 0 * terms.gate, terms.weight)
    assert nothing.cost(terms).sum() > terms.cost(terms).sum() + 5.0 * terms.used.sum()


def test_a_lever_arm_is_found() -> None:
    flight = flown(6, 25.0, shake=False)
    start = apply(flight.config, {"sensor.uwb0.lever_x_m": 0.35})
    tuning = tune([flight], start, free=["sensor.uwb0.lever_x_m"])
    assert tuning.tuned[0].value == pytest.approx(0.05, abs=max(4.0 * tuning.tuned[0].sigma, 0.02))


def test_what_a_flight_cannot_tell_is_said_and_left_alone() -> None:
    """The height of a barometer that is not there."""
    flight = flown(7, 6.0)
    tuning = tune([flight], free=["height.sigma_m", "sensor.flow0.sigma_px"])
    assert tuning.tuned[0].unidentifiable
    assert list(tuning.values) == ["sensor.flow0.sigma_px"]
    assert "not determined" in summary(tuning)
    text = config_text(tuning, None, [flight])
    assert "height" not in text.replace("# height", "")


def test_the_verb_writes_what_replay_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flight, held = (write_flight(flown(seed, 12.0), tmp_path / f"f{seed}") for seed in (1, 2))
    before = {path: path.read_bytes() for path in flight.rglob("*") if path.is_file()}
    out = tmp_path / "tuned.toml"
    options = ["--free", "range.sigma_m,sensor.range0.sigma_m", "--free", "delay.late_s.uwb0", "--workers", "1"]
    assert cli.main(["tune", str(flight), *options, "--hold-out", str(held), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "held out" in printed
    assert "delay.late_s.uwb0" in printed
    assert {path: path.read_bytes() for path in flight.rglob("*") if path.is_file()} == before
    config = Config.from_toml(out)
    assert abs(config.delay.late_s["uwb0"]) < 0.05
    assert config.sensor["range0"].sigma_m == pytest.approx(0.02, rel=0.3)  # type: ignore[union-attr]
    assert cli.main(["replay", str(flight), "--config", str(out), "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    assert cli.main(["tune", str(flight), "--config", str(out), "--out", str(out)]) == 2
    assert "never edited in place" in capsys.readouterr().err


def test_the_default_frees_what_decides_the_noise_of_each_sensor() -> None:
    flight = flown(1, 4.0)
    names = default_names(flight.config, flight.tables)
    assert names == [*NAMES[:2], "sensor.range0.sigma_m", "sensor.flow0.sigma_px", "sensor.uwb0.sigma_m"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("uwb.sigma", "no setting named"),
        ("handedness", "not a number"),
        ("sensor.none.lever_x_m", "no sensor named none"),
        ("delay.late_s.none", "no sensor named none"),
    ],
)
def test_a_name_that_is_no_setting_is_refused(name: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        parameter(flown(1, 2.0).config, name)


def test_wrong_use_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path / "t.toml")]
    for arguments, code in (
        ([], 2),
        (["x"], 2),
        ([*out], 2),
        ([str(tmp_path / "none"), *out], 3),
        (["x", "--workers", "0", *out], 2),
        (["x", "--out", str(tmp_path)], 2),
        (["x", "--out", "flight.toml"], 2),
    ):
        assert cli.main(["tune", *arguments]) == code, arguments
        assert capsys.readouterr().err.count("\n") == 1


def test_evidence_stands_in_the_same_place_whatever_the_delay() -> None:
    """A shift moves a sensor's readings past those of others; each is still compared with itself."""
    flight = flown(5, 6.0)
    rehearsal = Rehearsal(flight.config, flight.tables)
    trials = [rehearsal.run(apply(flight.config, {"delay.late_s.uwb0": late})) for late in (0.0, 0.123)]
    assert not np.array_equal(*(trial.log.source for trial in trials))
    counts = counts_of(trials[0])
    here, shifted = (collect(trial, counts) for trial in trials)
    logs = [trial.log for trial in trials]
    for number in range(len(logs[0].sensors)):
        first = int(counts[:number].sum())
        mine = slice(first, first + int(counts[number]))
        for evidence, log in zip((here, shifted), logs, strict=True):
            np.testing.assert_array_equal(evidence.innovation[mine], log.innovation[log.source == number])
    margin = collect(trials[0], counts, 1.0)
    assert 0 < margin.terms.used.sum() < 0.75 * here.terms.used.sum()  # two of six seconds are left out


def test_the_expected_curvature_is_that_of_the_cost_where_the_noise_is_told_right() -> None:
    """Fisher's information against second differences of the same cost, for the noise of UWB and image motion."""
    flight = flown(6, 20.0, shake=False)
    parameters = [parameter(flight.config, name) for name in NAMES[2:]]
    cost = Cost([Subject("x", flight.config, Rehearsal(flight.config, flight.tables))], parameters, 1)
    here, step = np.zeros(2), 0.1
    cost.refer_to(here)
    expected = np.diag(cost.expand(here).curvature)
    for i in range(2):
        ends = cost([here, here - step * np.eye(2)[i], here + step * np.eye(2)[i]])
        second = (ends[1] + ends[2] - 2.0 * ends[0]) / step**2
        assert expected[i] == pytest.approx(second, rel=0.25)
