"""Past an open door range finder and camera look into another room; the filter is not told of the door."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion import sources
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.run import Run, replay
from axialnav.replay.simulate.flight import simulate
from axialnav.replay.simulate.mission import CameraPlan, Mission, Opening, SectionPlan, UwbPlan, VehiclePlan
from axialnav.replay.simulate.mission_checks import check_mission

pytestmark = pytest.mark.slow
DOOR_START_M, DOOR_LENGTH_M, DEPTH_M = 1.2, 1.2, 1.5


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """Past one open door on the camera's side, without UWB."""
    door = Opening(side="left", start_m=DOOR_START_M, length_m=DOOR_LENGTH_M, depth_m=DEPTH_M)
    mission = Mission(
        name="door",
        section=(SectionPlan(kind="straight", length_m=3.5, opening=(door,)),),
        vehicle=VehiclePlan(speed_m_s=1.0, still_s=1.5),
        camera=CameraPlan(width_px=160, height_px=120, focal_px=120.0),
        uwb=UwbPlan(condition="none"),
        faults=(),
    )
    check_mission(mission)
    folder = tmp_path_factory.mktemp("door") / "flight"
    simulate(mission, folder, seed=3)
    return load_flight(folder)


def in_front_of_the_door(run: Run) -> np.ndarray:
    """Axial errors from the door's first post to half a second after its last one [m/s]."""
    truth = run.flight.truth
    assert truth is not None
    x = np.interp(run.track.t_ns, truth.t_ns, truth.position_m[:, 0])
    error = run.track.velocity_m_s[:, 0] - np.interp(run.track.t_ns, truth.t_ns, truth.velocity_m_s[:, 0])
    return error[(x > DOOR_START_M) & (x < DOOR_START_M + DOOR_LENGTH_M + 0.5)]


def test_an_open_door_is_seen_by_the_range_finder(flight: Flight) -> None:
    beam = flight.tables["tof0"].columns["range_m"]
    deep = beam > 0.5 * DEPTH_M + np.median(beam)
    assert deep.sum() == pytest.approx(50.0 * DOOR_LENGTH_M, rel=0.2)
    assert beam[deep].mean() == pytest.approx(np.median(beam) + DEPTH_M, abs=0.1)


def test_the_gate_keeps_the_depth_of_a_doorway_out_of_the_speed(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    protected = replay(flight)
    assert protected.metrics["sensors"]["tof0"]["gated"] > 40
    assert np.abs(in_front_of_the_door(protected)).max() < 0.1
    monkeypatch.setattr(sources, "chi_square_threshold", lambda axes, probability: 1e12)
    open_gate = replay(flight, params={"range.gate.soft_sigma": "1e7"})
    assert open_gate.metrics["sensors"]["tof0"]["gated"] == 0
    assert np.abs(in_front_of_the_door(open_gate)).max() > 0.3
