"""The filter's keeper: when it starts anew, from where, and that it never lets a defect through."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.live.core import FilterCore
from axialnav.fusion.outcome import Outcome
from axialnav.fusion.readings import ImuSample, Reading, WallRange
from tests.fusion.made_flights import MadeFlight, Scene, fly, motion
from tests.fusion.made_readings import readings

SCENE = Scene(seed=7, duration_s=12.0, sensors=("range0", "flow0", "uwb0"))
S = 1_000_000_000


@pytest.fixture(scope="module")
def flight() -> MadeFlight:
    return fly(SCENE)


class Tap:
    def __init__(self) -> None:
        self.configs: list[Config] = []
        self.seen: list[Reading] = []

    def restarted(self, config: Config) -> None:
        self.configs.append(config)

    def pushed(self, reading: Reading, outcome: Outcome, arrival_ns: int) -> None:
        self.seen.append(reading)


def errors_after(core: FilterCore, flight: MadeFlight, gap: tuple[float, float], shift_ns: int = 0) -> list[float]:
    """Fly with the inertial samples between two instants missing; axial errors from a second after them on."""
    t0, wrong = int(flight.tables["imu0"].t_ns[0]), []
    for reading in readings(flight):
        t = (reading.t_ns - t0) * 1e-9
        if gap[0] <= t < gap[1]:
            continue
        core.push(reading, reading.t_ns)
        if reading.sensor == "imu0":
            snapshot = core.snapshot(reading.t_ns)
            if t > gap[1] + 2.0 and snapshot is not None:
                wrong.append(snapshot.state.velocity_m_s[0] - motion(SCENE, np.array([t])).velocity_m_s[0, 0])
    return wrong


def test_a_short_gap_is_bridged(flight: MadeFlight) -> None:
    core = FilterCore(lambda: flight.config)
    wrong = errors_after(core, flight, (5.0, 5.7))
    assert core.restarts == {}
    assert np.sqrt(np.mean(np.square(wrong))) < 0.1


def test_after_a_long_gap_it_starts_anew_near_where_it_was_and_recovers(flight: MadeFlight) -> None:
    tap = Tap()
    core = FilterCore(lambda: flight.config, tap=tap)
    wrong = errors_after(core, flight, (5.0, 6.5))
    assert core.restarts == {"no inertial samples for more than 1 s": 1}
    assert len(tap.configs) == 2
    again = tap.configs[1].initial
    assert again is not None
    assert np.linalg.norm(np.array(again.position_m) - motion(SCENE, np.array([5.0])).position_m[0]) < 0.3
    assert again.sigma_position_m == pytest.approx(2.0, abs=0.02)
    assert len(wrong) > 500
    assert np.abs(wrong[-300:]).max() < 0.4


def test_a_reading_of_no_sensor_is_refused_and_counted(flight: MadeFlight) -> None:
    core = FilterCore(lambda: flight.config)
    assert core.push(WallRange(t_ns=0, sensor="elsewhere", range_m=1.0), 0) is None
    assert core.refused == {"elsewhere: not a reading of a configured sensor": 1}


def test_a_start_that_cannot_be_is_tried_again(flight: MadeFlight) -> None:
    """The vehicle falls for a second and a half: no gravity to level with."""
    core = FilterCore(lambda: flight.config)

    def sample(k: int, force: float) -> Any:
        accel = (0.0, 0.0, force + 1e-3 * (k % 7))
        return ImuSample(t_ns=k * S // 100, sensor="imu0", gyro_rad_s=(0.0, 0.0, 0.0), accel_m_s2=accel)

    for k in range(150):
        core.push(sample(k, 0.1), 0)
    assert core.snapshot(2 * S) is None
    assert any(reason.startswith("cannot start") for reason in core.restarts)
    for k in range(150, 500):
        core.push(sample(k, 9.81), 0)
    assert core.snapshot(5 * S) is not None


def test_an_estimate_that_ran_away_is_given_up(flight: MadeFlight) -> None:
    core = FilterCore(lambda: flight.config)
    thrown = 0
    for k in range(2000):
        force = (0.0, 0.0, 9.81) if k < 300 else (500.0, 0.0, 9.81)
        core.push(
            ImuSample(t_ns=k * S // 200, sensor="imu0", gyro_rad_s=(1e-4 * (k % 3), 0.0, 0.0), accel_m_s2=force), 0
        )
        thrown += core.snapshot(k * S // 200) is None and k > 300
    assert core.restarts["the estimate ran away"] >= 1
    assert thrown >= 1


def test_states_come_from_any_thread_while_another_pushes(flight: MadeFlight) -> None:
    import threading

    core, done, bad = FilterCore(lambda: flight.config), threading.Event(), []

    def look() -> None:
        while not done.is_set():
            snapshot = core.snapshot(0)
            if snapshot is not None and not np.isfinite(snapshot.state.covariance).all():
                bad.append(snapshot)

    watchers = [threading.Thread(target=look) for _ in range(2)]
    for watcher in watchers:
        watcher.start()
    for reading in readings(flight)[:1500]:
        core.push(reading, reading.t_ns)
    done.set()
    for watcher in watchers:
        watcher.join()
    alone = FilterCore(lambda: flight.config)
    for reading in readings(flight)[:1500]:
        alone.push(reading, reading.t_ns)
    assert bad == []
    mine, other = core.snapshot(0), alone.snapshot(0)
    assert mine is not None
    assert other is not None
    assert mine.state.covariance.tobytes() == other.state.covariance.tobytes()
