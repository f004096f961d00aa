"""An autopilot's attitude that is half a degree off for seconds must not cost speed that the camera sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.motion_truth import true_motion
from axialnav.replay.run import replay
from axialnav.replay.simulate.flight import fly_mission, sensed
from axialnav.replay.simulate.scenarios import mission_of

PERIOD_S, SIGMA_PX = 1.0 / 30.0, 0.06
LEAN_RAD, LEAN_S = 0.02, 12.0  # amplitude and period: twice the sigma that the sensor states
SEEDS = range(4)


def flight_with_true_motion(seed: int) -> Flight:
    """A straight flight without UWB whose camera tells the truth, as noisy as the gyro makes it."""
    flight = sensed(fly_mission(mission_of("straight", duration_s=20.0, uwb="none"), seed), Path("unused"), frames=True)
    assert flight.truth is not None
    t_ns = flight.truth.t_ns[40:-40:7]
    period = np.full(t_ns.size, PERIOD_S)
    noise = SIGMA_PX * np.random.default_rng(seed).normal(size=(2, t_ns.size))
    columns = {"window_s": period, "sigma_px": np.full(t_ns.size, SIGMA_PX)}
    for name, axis, one in zip(("dx_px", "dy_px"), "xy", noise, strict=True):
        truth = true_motion(flight, "cam0", t_ns, period, period, None, axis)
        assert truth is not None
        columns[name] = truth.displacement_px + one
    attitude = flight.tables["att0"]
    lean = LEAN_RAD * np.sin(2.0 * np.pi * attitude.t_ns * 1e-9 / LEAN_S + seed)
    leaning = replace(attitude, columns={**attitude.columns, "pitch_rad": attitude.columns["pitch_rad"] + lean})
    return replace(flight, tables={**flight.tables, "att0": leaning, "cam0": SensorTable(t_ns, columns)})


def error(flight: Flight, params: dict[str, str]) -> NDArray[np.float64]:
    """Axial errors of a flight [m/s], smoothed over a second: what adds up to way."""
    assert flight.truth is not None
    track = replay(flight, params=params).track
    wrong = track.velocity_m_s[:, 0] - np.interp(track.t_ns, flight.truth.t_ns, flight.truth.velocity_m_s[:, 0])
    return np.convolve(wrong[600:], np.full(200, 1.0 / 200.0), mode="valid")


def test_slow_errors_of_the_attitude_do_not_add_up_to_a_wrong_way() -> None:
    flights = [flight_with_true_motion(seed) for seed in SEEDS]
    believed = np.concatenate([error(flight, {"attitude.correlation_time_s": "0"}) for flight in flights])
    slow = np.concatenate([error(flight, {}) for flight in flights])
    assert np.sqrt((slow**2).mean()) < 0.85 * np.sqrt((believed**2).mean())
