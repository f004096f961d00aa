"""What was flown replays to the same digest; a recording cut anywhere gives everything before the cut."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from axialnav.fusion.config import Config
from axialnav.fusion.corridor import CorridorEstimator
from axialnav.fusion.live.recorder.recorder import Recorder
from axialnav.fusion.live.recording import FlightRecording
from axialnav.fusion.outcome import AxialState, Verdict
from axialnav.fusion.readings import ImuSample, PixelMotion, Reading
from axialnav.models.rig import Camera, Flow
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.flight_cut import cut_flight
from axialnav.replay.run import replay, resolve
from axialnav.replay.sample_flights import sample_flight_path
from tests.fusion.made_readings import known_ns
from tests.replay.made_recordings import flown as simulated


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


def fly(
    config: Config, arrivals: Iterable[tuple[int, Reading]], folder: Path
) -> tuple[Path, AxialState, Counter[Verdict]]:
    """Push readings as they arrive, recorded as on board: the file, the last state, and what became of them."""
    recording = FlightRecording(folder, False, lambda: 0)
    recording.restarted(config)
    estimator, verdicts = CorridorEstimator(config), Counter[Verdict]()
    for arrival_ns, reading in sorted(arrivals, key=lambda pair: pair[0]):
        outcome = estimator.push(reading)
        recording.pushed(reading, outcome, arrival_ns)
        verdicts[outcome.verdict] += 1
    recording.close()
    return folder / "flight_0001.mcap", estimator.state(), verdicts


def test_what_came_too_late_in_flight_is_not_known_to_the_replay_either(tmp_path: Path) -> None:
    """Some image motion, ranges and even inertial samples 2.5 s late, when the filter reaches back one second."""
    flight = cut_flight(load_flight(sample_flight_path()), 0.0, 8.0)
    end_ns = int(flight.tables["imu0"].t_ns[-1])
    readings = [r for r in flight.readings() if known_ns(r) <= end_ns]
    rng = np.random.default_rng(7)
    late = [rng.uniform() < (0.02 if isinstance(r, ImuSample) else 0.2) for r in readings]
    late[-1] = False
    arrivals = [(r.t_ns + (2_500_000_000 if is_late else 0), r) for r, is_late in zip(readings, late, strict=True)]
    path, state, verdicts = fly(resolve(None, flight), arrivals, tmp_path)
    assert verdicts[Verdict.LATE] > 20
    recorded = load_flight(path)
    told = [drop for drop in recorded.drops if "too late" in drop.reason]
    assert {drop.sensor for drop in told} >= {"/imu0", "/flow0"}
    assert sum(drop.count for drop in told) == verdicts[Verdict.LATE]
    run = replay(recorded)
    assert run.track.velocity_m_s[-1].tobytes() == state.velocity_m_s.tobytes()
    assert run.track.position_m[-1].tobytes() == state.position_m.tobytes()
    assert run.metrics["digest"] != replay(flight).metrics["digest"]  # or the readings would not have mattered


def test_what_a_camera_measured_on_board_is_replayed_as_it_was(tmp_path: Path) -> None:
    """The filter got image motion, not pictures; the recording may hold no picture at all."""
    flight = simulated(2, 6.0)
    flow = flight.config.sensor["flow0"]
    assert isinstance(flow, Flow)
    fu, fv = flow.focal_px
    camera = Camera(
        T_BS=flow.T_BS,
        rate_hz=flow.rate_hz,
        resolution=(640, 480),
        intrinsics=(fu, fv, 320.0, 240.0),
        surface=flow.surface,
    )
    sensors = {**flight.config.sensor, "cam0": camera}
    del sensors["flow0"]
    config = msgspec.structs.replace(flight.config, sensor=sensors)
    readings = [
        msgspec.structs.replace(r, sensor="cam0", sigma_px=0.8) if isinstance(r, PixelMotion) else r
        for r in flight.readings()
        if known_ns(r) < int(flight.tables["imu0"].t_ns[-1]) or isinstance(r, ImuSample)
    ]
    path, state, verdicts = fly(config, [(known_ns(r), r) for r in readings], tmp_path)
    assert verdicts[Verdict.FUSED] > 300
    run = replay(path)
    assert run.metrics["sensors"]["cam0"]["fused"] > 100
    assert run.track.velocity_m_s[-1].tobytes() == state.velocity_m_s.tobytes()
    assert run.write(tmp_path / "run").is_dir()
