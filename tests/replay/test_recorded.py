"""What was flown replays to the same digest; a recording cut anywhere gives everything before the cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.live.recorder.recorder import Recorder
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.flight_cut import cut_flight
from axialnav.replay.run import replay, resolve
from axialnav.replay.sample_flights import sample_flight_path
from tests.fusion.made_readings import known_ns


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Flight, Path, np.ndarray]:
    """Eight seconds pushed through the streaming estimator, late and shuffled, and recorded as they came."""
    flight = cut_flight(load_flight(sample_flight_path()), 0.0, 8.0)
    config = resolve(None, flight)
    estimator = CorridorEstimator(config)
    path = tmp_path_factory.mktemp("flown") / "flight.mcap"
    rng = np.random.default_rng(4)
    end_ns = int(flight.tables["imu0"].t_ns[-1])  # what is known later is not in the last row of a replay
    readings = [r for r in flight.readings() if known_ns(r) <= end_ns]
    arrival = np.argsort([r.t_ns + int(rng.integers(0, 80_000_000)) for r in readings], kind="stable")
    with Recorder(path, config=config, about={"name": flight.name}) as recorder:
        for order in arrival.tolist():
            outcome = estimator.push(readings[order])
            recorder.write(readings[order].sensor, readings[order].t_ns + 80_000_000, readings[order])
            if outcome.sensor != "imu0":
                recorder.write("outcome", readings[order].t_ns + 80_000_000, outcome)
        state = estimator.state()
        recorder.write("state", state.t_ns, state)
    assert recorder.status().dropped == {}
    return flight, path, np.concatenate([state.position_m, state.velocity_m_s])


def test_what_was_flown_replays_to_the_same_bits(flown: tuple[Flight, Path, np.ndarray]) -> None:
    flight, path, last = flown
    recorded, original = replay(path), replay(flight)
    assert recorded.metrics["digest"] == original.metrics["digest"]
    track = recorded.track
    assert np.array_equal(np.concatenate([track.position_m[-1], track.velocity_m_s[-1]]), last)


def test_a_cut_costs_nothing_that_stood_before_it(flown: tuple[Flight, Path, np.ndarray], tmp_path: Path) -> None:
    """Every message lies whole before its cut or is lost: the rows grow with the file, without steps of a chunk."""
    _, path, _ = flown
    data = path.read_bytes()
    whole = sum(map(len, load_flight(path).tables.values()))
    summary = 20_000
    cuts = np.linspace(40_000, len(data) - summary, 40).astype(int).tolist()
    counts = []
    for cut in cuts:
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        flight = load_flight(tmp_path / "cut.mcap")
        counts.append(sum(map(len, flight.tables.values())))
        assert any("it was cut" in drop.reason for drop in flight.drops)
    assert counts == sorted(counts)
    share = np.array(counts) / whole
    assert np.diff(share).max() < 0.06  # a chunk that had to be whole would be 0.12 of this file
    assert counts[-1] > 0.9 * whole
