"""The smoother on simulated flights: better than the filter, as sure as it should be, and a pure function."""

from __future__ import annotations

import functools
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from axialnav.fusion.batch import run_batch
from axialnav.fusion.outcome import Health, Track
from axialnav.fusion.smoother import Pass, run_smoothed
from tests.fusion.made_flights import MadeFlight, Scene, fly, textbook
from tests.fusion.test_lockout import lost

FLIGHTS = 40
BAND = (0.025 / 6, 1.0 - 0.025 / 6)  # six bands are looked at (Bonferroni)
RIGS = {
    "range differences": ("range0", "flow0", "tdoa0", "attitude0"),
    "ranges": ("range0", "flow0", "uwb0"),
    "fixes": ("flow0", "fix0"),
}


def errors(track: Track, flight: MadeFlight) -> dict[str, np.ndarray]:
    """Estimate minus truth, (n, 3) each."""
    attitude = Rotation.from_quat(track.quaternion_WB, scalar_first=True)
    return {
        "position": track.position_m - flight.truth.position_m,
        "velocity": track.velocity_m_s - flight.truth.velocity_m_s,
        "attitude": (attitude.inv() * flight.truth.attitude).as_rotvec(),
    }


def rms(error: np.ndarray) -> float:
    return float(np.sqrt((error**2).sum(axis=1).mean()))


@functools.cache
def both(rig: str) -> list[tuple[MadeFlight, Track, Track]]:
    """Flights of 12 s with the filtered and the smoothed track."""
    out = []
    for seed in range(FLIGHTS):
        flight = fly(Scene(seed=seed, sensors=RIGS[rig], duration_s=12.0))
        config = textbook(flight.config)
        out.append((flight, run_batch(config, flight.tables).track, run_smoothed(config, flight.tables).track))
    return out


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_smoothed_errors_are_smaller(rig: str) -> None:
    """At the end both are the same by construction, so the whole flight is compared."""
    ratio: dict[str, list[float]] = {"position": [], "velocity": [], "attitude": []}
    for flight, filtered, smoothed in both(rig):
        before, after = errors(filtered, flight), errors(smoothed, flight)
        for name, ratios in ratio.items():
            ratios.append(rms(after[name]) / rms(before[name]))
    assert np.median(ratio["velocity"]) < 0.6
    assert np.median(ratio["position"]) < 0.75
    assert np.median(ratio["attitude"]) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("what", ["position", "velocity"])
def test_smoothed_errors_are_as_large_as_their_covariance_says(rig: str, what: str) -> None:
    """One instant a flight, in its middle, so that the samples are independent."""
    total = 0.0
    for flight, _, smoothed in both(rig):
        middle = len(smoothed.t_ns) // 2
        error = errors(smoothed, flight)[what][middle]
        total += float(error @ np.linalg.solve(getattr(smoothed, f"{what}_covariance")[middle], error))
    low, high = chi2.ppf(BAND, 3 * FLIGHTS)
    assert low < total < high


@pytest.mark.slow
@pytest.mark.parametrize("rig", RIGS)
def test_smoothing_never_makes_less_sure(rig: str) -> None:
    for _, filtered, smoothed in both(rig):
        for field in ("position_covariance", "velocity_covariance"):
            before, after = (np.linalg.eigvalsh(getattr(track, field)) for track in (filtered, smoothed))
            assert (after > 0.0).all()
            assert (after[:, 2] <= before[:, 2] * (1 + 1e-9)).all()


def test_the_forward_pass_is_the_filter_to_the_last_bit() -> None:
    flight = sick()
    pass_ = Pass.begin(flight.config, flight.tables)
    pass_.forward()
    track, expected = pass_.track(), run_batch(flight.config, flight.tables).track
    for field in Track.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(track, field), getattr(expected, field), err_msg=field)


def sick() -> MadeFlight:
    """An accelerometer that goes wrong by 2 m/s^2 over four seconds, from the eighth second on."""
    flight = fly(Scene(seed=1, duration_s=14.0, sensors=("flow0", "fix0")))
    flight.tables["imu0"].columns["accel_m_s2"][:, 0] -= 2.0 * np.clip((flight.t_s - 8.0) / 4.0, 0.0, 1.0)
    return flight


def lockout() -> MadeFlight:
    """A start that is metres wrong, found out by the UWB readings: the position is re-anchored after four seconds."""
    flight = lost("fix0")
    config = flight.config.with_params({"supervisor.reanchor_aided_s": "4.0"})
    return MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)


@pytest.mark.parametrize("made", [sick, lockout], ids=["accelerometer fault", "re-anchoring"])
def test_where_the_flight_is_cut_does_not_matter(made) -> None:
    """Same bits from many short stretches and from one: the second run of a stretch repeats the first."""
    flight, tracks, cuts = made(), [], []
    for stretch in (150, 10**9):
        pass_ = Pass.begin(flight.config, flight.tables)
        pass_.forward(stretch)
        pass_.backward()
        tracks.append(pass_.track())
        cuts.append(len(pass_.cuts))
    assert cuts[0] > 12
    assert cuts[1] == 2
    for field in Track.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(tracks[0], field), getattr(tracks[1], field), err_msg=field)


def test_the_rival_that_took_over_is_smoothed_as_if_it_had_flown_its_whole_trial() -> None:
    flight = sick()
    filtered, smoothed = (run(flight.config, flight.tables).track for run in (run_batch, run_smoothed))
    ill = (filtered.flags & int(Health.ACCELEROMETER_FAULT)) != 0
    assert 0.1 < ill.mean() < 0.9
    taken_over = int(np.flatnonzero(ill)[0])
    step = np.linalg.norm(np.diff(smoothed.velocity_m_s, axis=0), axis=1)
    jump = np.linalg.norm(np.diff(filtered.velocity_m_s, axis=0), axis=1)[taken_over - 1]
    assert step[taken_over - 1] < 0.2 * jump
    before, after = errors(filtered, flight)["velocity"], errors(smoothed, flight)["velocity"]
    assert rms(after[taken_over - 100 : taken_over]) < 0.5 * rms(before[taken_over - 100 : taken_over])


def test_positions_before_a_reanchoring_stay_in_their_own_frame() -> None:
    """The pass is split for the position; velocity is smoothed across."""
    flight = lockout()
    filtered, smoothed = (run(flight.config, flight.tables).track for run in (run_batch, run_smoothed))
    assert filtered.resets[-1] == smoothed.resets[-1] == 1
    at = int(np.flatnonzero(np.diff(filtered.resets))[0])
    jumps = [np.linalg.norm(track.position_m[at + 1] - track.position_m[at]) for track in (filtered, smoothed)]
    assert jumps[0] > 3.0
    assert jumps[1] == pytest.approx(jumps[0], rel=0.1)
    before, after = errors(filtered, flight)["velocity"], errors(smoothed, flight)["velocity"]
    assert rms(after[at - 400 : at]) < 0.9 * rms(before[at - 400 : at])
    assert rms(errors(smoothed, flight)["position"][at + 1 :]) < 0.2


def test_repeated_samples_and_progress_do_no_harm() -> None:
    """Every inertial sample twice: the same track, and the share done rises to 1."""
    flight, seen = fly(Scene(seed=5, duration_s=4.0)), []
    once = run_smoothed(flight.config, flight.tables, seen.append).track
    imu = flight.tables["imu0"]
    doubled = {k: np.repeat(v, 2, axis=0) for k, v in imu.columns.items()}
    twice = run_smoothed(flight.config, {**flight.tables, "imu0": type(imu)(np.repeat(imu.t_ns, 2), doubled)}).track
    # levelling takes the mean of the samples, whose rounding depends on their number
    np.testing.assert_allclose(twice.velocity_m_s[::2], once.velocity_m_s, atol=1e-9)
    np.testing.assert_array_equal(twice.velocity_m_s[1::2], twice.velocity_m_s[::2])
    assert seen[-1] == pytest.approx(1.0)
    assert all(a <= b for a, b in pairwise(seen))
