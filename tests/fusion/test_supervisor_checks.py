"""Every check of the supervisor by itself: a story that ends well with it and badly when this one check is taken out.

Checks with a limit of their own are taken out by moving that limit out of reach.  What has none is not reachable from
the configuration, so the story is told with the whole supervisor off.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from axialnav.fusion.batch import BatchResult, run_batch
from axialnav.fusion.kernels.run import health
from axialnav.fusion.memory import build_settings, new_memory
from axialnav.fusion.outcome import Health, Reason, Verdict
from axialnav.fusion.sources import build_sources, fused_sensors
from axialnav.fusion.supervisor import SourceState
from tests.fusion.made_corridor import EVENT_S, Corridor, fly
from tests.fusion.made_flights import MadeFlight, Table

NEVER = "1e9"
OFF = {"supervisor.enabled": "false"}
NO_KINEMATICS = {"supervisor.kinematic_m": NEVER}
NO_JUMPS = {"supervisor.jump_m": NEVER}
NO_STUCK = {"supervisor.stuck_count": "1000000"}
SECONDS = 65.0


def corridor(**story) -> MadeFlight:
    return fly(Corridor(duration_s=SECONDS, **story))


def run(flight: MadeFlight, params: Mapping[str, str] | None = None) -> BatchResult:
    return run_batch(flight.config.with_params(dict(params or {})), flight.tables)


def during(flight: MadeFlight, start_s: float, end_s: float) -> np.ndarray:
    return (flight.t_s >= EVENT_S + start_s) & (flight.t_s < EVENT_S + end_s)


def drift_m(flight: MadeFlight, result: BatchResult, start_s: float, end_s: float) -> float:
    """Largest axial error of the position between two instants after the event began."""
    error = (result.track.position_m - flight.truth.position_m)[:, 0]
    return float(np.abs(error[during(flight, start_s, end_s)]).max())


def speed_rmse(flight: MadeFlight, result: BatchResult, start_s: float, end_s: float) -> float:
    error = (result.track.velocity_m_s - flight.truth.velocity_m_s)[:, 0]
    return float(np.sqrt((error[during(flight, start_s, end_s)] ** 2).mean()))


def states(result: BatchResult, sensor: str) -> np.ndarray:
    return result.track.source_states[:, result.log.sensors.index(sensor)]


def reasons(result: BatchResult, sensor: str) -> np.ndarray:
    return result.log.reason[result.log.source == result.log.sensors.index(sensor)]


def longer(flight: MadeFlight, sensor: str, metres: Mapping[int, float], start_s: float, end_s: float) -> MadeFlight:
    """The same flight with the paths to some anchors (by number) longer for a while."""
    table = flight.tables[sensor]
    t = (table.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9 - EVENT_S
    columns = dict(table.columns)
    value = "range_m" if "range_m" in columns else "difference_m"
    changed = columns[value].copy()
    for anchor, metre in metres.items():
        ends = {"anchor": 1.0, "anchor_b": 1.0, "anchor_a": -1.0}
        for column in ends.keys() & columns.keys():
            changed[(columns[column] == anchor) & (t >= start_s) & (t < end_s)] += ends[column] * metre
    tables = {**flight.tables, sensor: Table(table.t_ns, {**columns, value: changed})}
    return MadeFlight(tables, flight.config, flight.truth, flight.gyro_bias, flight.accel_bias)


def nearest(flight: MadeFlight, count: int) -> list[int]:
    """Anchors that are nearest to the vehicle five seconds into the event."""
    at = flight.truth.position_m[np.searchsorted(flight.t_s, EVENT_S + 5.0)]
    places = np.array(list(flight.config.sensor["uwb0"].anchors.values()))
    return np.argsort(np.linalg.norm(places - at, axis=1))[:count].tolist()


def test_ways_beside_the_shadow_catch_what_slides() -> None:
    flight = corridor(uwb="fix", fault="ramp")
    with_it, without = run(flight), run(flight, NO_KINEMATICS)
    assert (states(with_it, "uwb0")[during(flight, 3.0, 9.0)] >= SourceState.SUSPECT).all()
    assert (states(without, "uwb0")[during(flight, 0.0, 2.0)] == SourceState.OK).all()
    assert drift_m(flight, without, 0.0, 10.0) > 1.5 * drift_m(flight, with_it, 0.0, 10.0)


def test_spikes_are_refused_by_name_also_where_the_gate_is_wide() -> None:
    flight, clean = corridor(uwb="fix", fault="spikes"), corridor(uwb="fix")
    spike = np.abs(flight.tables["uwb0"].columns["position_m"] - clean.tables["uwb0"].columns["position_m"])[:, 0] > 1.0
    assert spike.sum() > 100
    fused = {}
    for name, params in (("with", {}), ("without", NO_JUMPS)):
        result = run(flight, params)
        mine = result.log.source == result.log.sensors.index("uwb0")
        fused[name] = (result.log.verdict[mine][spike] == Verdict.FUSED).mean()
    assert fused["with"] < 0.02
    assert fused["without"] > 0.1


def test_a_value_that_stands_still_is_not_believed() -> None:
    flight = corridor(uwb="range", fault="frozen")
    with_it, without = run(flight), run(flight, NO_STUCK)
    assert (reasons(with_it, "uwb0") == Reason.STUCK).sum() > 20
    assert (reasons(without, "uwb0") == Reason.STUCK).sum() == 0
    assert drift_m(flight, with_it, 0.0, 8.0) < drift_m(flight, without, 0.0, 8.0)


def test_pixel_motion_that_stands_still_is_not_believed() -> None:
    flight = corridor(uwb="range", motion_fault="stuck")
    with_it, without = run(flight), run(flight, NO_STUCK)
    assert (reasons(with_it, "motion0") == Reason.STUCK).sum() > 5
    assert (reasons(without, "motion0") == Reason.STUCK).sum() == 0
    assert speed_rmse(flight, with_it, 0.0, 8.0) < 0.5 * speed_rmse(flight, without, 0.0, 8.0)
    assert drift_m(flight, with_it, 0.0, 10.0) < 0.5 < drift_m(flight, without, 0.0, 10.0)


@pytest.mark.parametrize("uwb", ["range", "tdoa"])
def test_one_bad_anchor_is_excluded_and_the_others_go_on(uwb: str) -> None:
    clean = corridor(uwb=uwb)
    bad = nearest(clean, 1)[0]
    flight = longer(clean, "uwb0", {bad: 2.0}, 0.0, 15.0)
    with_it, without = run(flight), run(flight, OFF)
    assert (states(with_it, "uwb0")[during(flight, 2.0, 15.0)] == SourceState.OK).mean() > 0.9
    table, mine = flight.tables["uwb0"], with_it.log.source == with_it.log.sensors.index("uwb0")
    touched = np.zeros(len(table.t_ns), dtype=bool)
    for column in {"anchor", "anchor_a", "anchor_b"} & table.columns.keys():
        touched |= table.columns[column] == bad
    t = (table.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9 - EVENT_S
    fused, later = with_it.log.verdict[mine] == Verdict.FUSED, (t > 2.0) & (t < 15.0)
    assert fused[touched & later].mean() < 0.05
    assert fused[~touched & later].mean() > 0.7
    held = run(flight).log.reason[mine][touched & later]
    assert (held == Reason.SUPERVISOR).mean() > 0.5
    assert drift_m(flight, with_it, 0.0, 20.0) < 0.3
    assert drift_m(flight, with_it, 0.0, 20.0) < 1.5 * drift_m(flight, without, 0.0, 20.0)


def test_pixel_motion_with_a_wrong_scale_is_outvoted_by_uwb_and_inertia() -> None:
    flight = corridor(uwb="fix", motion_fault="scale")
    with_it, without = run(flight), run(flight, OFF)
    flags = with_it.track.flags[during(flight, 0.0, 8.0)]
    assert ((flags & (Health.MOTION_SUSPECT | Health.UWB_SUSPECT)) > 0).mean() > 0.3
    assert not (without.track.flags & Health.MOTION_SUSPECT).any()
    assert (states(with_it, "motion0")[flight.t_s > EVENT_S + 16.0] == SourceState.OK).all()


@pytest.mark.parametrize(
    ("uwb", "motion", "inertia_contradicts", "disagree"),
    [
        (SourceState.SUSPECT, SourceState.OK, False, False),
        (SourceState.OK, SourceState.SUSPECT, False, False),
        (SourceState.SUSPECT, SourceState.SUSPECT, False, True),
        (SourceState.SUSPECT, SourceState.OK, True, True),
        (SourceState.OK, SourceState.OK, True, False),
    ],
)
def test_two_that_contradict_each_other_are_said_to_disagree(
    uwb: SourceState, motion: SourceState, inertia_contradicts: bool, disagree: bool
) -> None:
    """Both suspect, or UWB suspect while inertia does not side with pixel motion either."""
    config = fly(Corridor(duration_s=2.0)).config
    sources, memory, now = build_sources(config), new_memory(5), 10_000_000_000
    memory.sources["state"] = SourceState.OK
    memory.sources["t_fused"] = memory.core["t_aid"] = now
    names = fused_sensors(config)
    memory.sources["state"][names.index("uwb0")] = uwb
    memory.sources["state"][names.index("motion0")] = motion
    if inertia_contradicts:
        memory.core["t_neither"] = now - 500_000_000
    flags = health(now, sources, memory.sources, memory.core[0], build_settings(config)[0])
    assert bool(flags & Health.DISAGREE) is disagree


def test_of_two_uwb_sources_the_one_that_slides_is_held_and_the_other_believed() -> None:
    clean, sliding = corridor(uwb="fix"), corridor(uwb="fix", fault="ramp")
    sensor = {**clean.config.sensor, "uwb1": clean.config.sensor["uwb0"]}
    config = type(clean.config)(initial=clean.config.initial, surface=clean.config.surface, sensor=sensor)
    tables = {**clean.tables, "uwb1": sliding.tables["uwb0"]}
    flight = MadeFlight(tables, config, clean.truth, clean.gyro_bias, clean.accel_bias)
    result = run(flight)
    held = during(flight, 3.5, 9.0)
    assert (states(result, "uwb1")[held] >= SourceState.SUSPECT).mean() > 0.8
    assert (states(result, "uwb0")[held] == SourceState.OK).mean() > 0.8
    assert result.track.resets[-1] == 0
    assert drift_m(flight, result, 0.0, 15.0) < 0.3
    assert drift_m(flight, run(flight, NO_KINEMATICS), 0.0, 15.0) > 0.6


def test_ranges_that_report_much_power_beside_the_first_path_count_less() -> None:
    """Half of the anchors are a metre too long for a while, too little to be excluded, and say so in their powers."""
    clean = corridor(uwb="range")
    bad = nearest(clean, 6)[::2]
    flight = longer(clean, "uwb0", dict.fromkeys(bad, 0.35), 0.0, 20.0)
    table = flight.tables["uwb0"]
    t = (table.t_ns - flight.tables["imu0"].t_ns[0]) * 1e-9 - EVENT_S
    behind = np.isin(table.columns["anchor"], bad) & (t >= 0.0) & (t < 20.0)
    noise = np.random.default_rng(4).normal(0.0, 0.3, len(t))
    powers = {"rssi_dbm": -80.0 + noise, "first_path_dbm": np.where(behind, -95.0, -83.0) + noise}
    told = Table(table.t_ns, {**table.columns, **powers})
    flight = MadeFlight({**flight.tables, "uwb0": told}, flight.config, flight.truth, clean.gyro_bias, clean.accel_bias)
    with_it, without = run(flight), run(flight, {"uwb.nlos_db": "1000.0"})
    errors = [np.linalg.norm(r.track.position_m - flight.truth.position_m, axis=1) for r in (with_it, without)]
    rmse = [float(np.sqrt((e[during(flight, 1.0, 20.0)] ** 2).mean())) for e in errors]
    assert rmse[0] < 0.8 * rmse[1]


def test_readings_that_a_receiver_repeats_are_counted_once() -> None:
    clean = corridor(uwb="range")
    table = clean.tables["uwb0"]
    powers = np.random.default_rng(4).normal(-80.0, 0.5, (2, len(table.t_ns)))
    once = {**table.columns, "rssi_dbm": powers[0], "first_path_dbm": powers[1]}
    again = np.repeat(np.arange(len(table.t_ns)), 2)
    stamps = table.t_ns[again] + np.tile([0, 10_000_000], len(table.t_ns))
    tables = {**clean.tables, "uwb0": Table(stamps, {name: column[again] for name, column in once.items()})}
    result = run(MadeFlight(tables, clean.config, clean.truth, clean.gyro_bias, clean.accel_bias))
    mine = reasons(result, "uwb0")
    assert (mine[1::2] == Reason.COPY).all()
    assert (mine[0::2] == Reason.COPY).sum() == 0
    assert set(result.log.verdict[result.log.reason == Reason.COPY].tolist()) == {Verdict.BLIND}
