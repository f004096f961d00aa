"""When the aids fall silent: how soon the state says so, and that it says the truth about its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.batch import run_batch
from axialnav.fusion.outcome import Health
from tests.fusion.made_flights import MadeFlight, Scene, Table, fly

SILENT_S = 8.0


def silenced(sensors: tuple[str, ...], names: tuple[str, ...], seed: int = 1) -> MadeFlight:
    """A flight in which some sensors stop at eight seconds."""
    flight = fly(Scene(seed=seed, sensors=sensors))
    tables = dict(flight.tables)
    end_ns = flight.tables["imu0"].t_ns[0] + round(SILENT_S * 1e9)
    for name in names:
        keep = tables[name].t_ns <= end_ns
        tables[name] = Table(tables[name].t_ns[keep], {k: v[keep] for k, v in tables[name].columns.items()})
    return MadeFlight(tables, flight.config, flight.truth, flight.gyro_bias, flight.accel_bias)


def flag_time(flight: MadeFlight, flag: Health) -> float | None:
    flags = run_batch(flight.config, flight.tables).track.flags & flag
    return float(flight.t_s[np.argmax(flags > 0)]) if flags.any() else None


def test_after_one_second_dead_reckoning_after_five_invalid() -> None:
    flight = silenced(("range0", "flow0", "uwb0"), ("flow0", "uwb0"))
    assert flag_time(flight, Health.DEAD_RECKONING) == pytest.approx(SILENT_S + 1.0, abs=0.05)
    assert flag_time(flight, Health.VELOCITY_INVALID) == pytest.approx(SILENT_S + 5.0, abs=0.05)


@pytest.mark.parametrize("left", ["flow0", "uwb0"])
def test_one_axial_aid_is_enough(left: str) -> None:
    silent = {"flow0", "uwb0"} - {left}
    flight = silenced(("range0", "flow0", "uwb0"), tuple(silent))
    assert flag_time(flight, Health.DEAD_RECKONING) is None


def test_heights_and_attitudes_are_no_axial_aid() -> None:
    flight = silenced(("range0", "flow0", "baro0", "attitude0"), ("flow0",))
    assert flag_time(flight, Health.DEAD_RECKONING) == pytest.approx(SILENT_S + 1.0, abs=0.05)


def test_the_limits_are_those_of_the_configuration() -> None:
    flight = silenced(("flow0", "range0"), ("flow0",))
    config = flight.config.with_params({"supervisor.dead_reckoning_s": "0.4", "supervisor.invalid_s": "2.0"})
    changed = MadeFlight(flight.tables, config, flight.truth, flight.gyro_bias, flight.accel_bias)
    assert flag_time(changed, Health.DEAD_RECKONING) == pytest.approx(SILENT_S + 0.4, abs=0.05)
    assert flag_time(changed, Health.VELOCITY_INVALID) == pytest.approx(SILENT_S + 2.0, abs=0.05)


def test_the_flags_clear_when_the_aid_speaks_again() -> None:
    flight = fly(Scene(seed=1, sensors=("range0", "flow0")))
    flow = flight.tables["flow0"]
    t = (flow.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9
    keep = (t < 8.0) | (t > 10.5)
    tables = {**flight.tables, "flow0": Table(flow.t_ns[keep], {k: v[keep] for k, v in flow.columns.items()})}
    flags = run_batch(flight.config, tables).track.flags & Health.DEAD_RECKONING
    assert (flags[(flight.t_s > 9.05) & (flight.t_s < 10.45)] > 0).all()
    assert not flags[flight.t_s > 10.6].any()


def test_the_uncertainty_of_a_filter_left_alone_grows_and_covers_the_error() -> None:
    inside, sigmas = [], []
    for seed in range(20):
        flight = silenced(("range0", "flow0", "uwb0", "attitude0"), ("flow0", "uwb0"), seed)
        track = run_batch(flight.config, flight.tables).track
        at = np.searchsorted(flight.t_s, SILENT_S + 5.0)
        sigma = np.sqrt(np.diag(track.velocity_covariance[at]))
        inside.append(np.abs(track.velocity_m_s[at] - flight.truth.velocity_m_s[at]) < 3.0 * sigma)
        sigmas.append(sigma[0] / np.sqrt(track.velocity_covariance[np.searchsorted(flight.t_s, SILENT_S), 0, 0]))
    assert np.mean(inside) > 0.97
    assert min(sigmas) > 2.0
