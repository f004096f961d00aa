"""All readings of a flight: instants, truth at them, and what each sensor makes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import AnySensor
from axialnav.replay.flight import SensorTable, Truth
from axialnav.replay.simulate.course import smoothstep
from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.rig import ANTENNA_M, anchors_of
from axialnav.replay.simulate.sensors.aiding import ATTITUDE_HZ, BARO_HZ, read_attitude, read_barometer
from axialnav.replay.simulate.sensors.imu import ImuSheet, read_imu
from axialnav.replay.simulate.sensors.tof import TofSheet, read_tof
from axialnav.replay.simulate.sensors.uwb import DROPOUT, Links, noise, observe, powers
from axialnav.replay.simulate.sensors.uwb_conditions import disturb, event_start_s
from axialnav.replay.simulate.streams import Streams, stamps
from axialnav.replay.simulate.vehicle import Motion, Trajectory
from axialnav.replay.simulate.world import World

Array = NDArray[np.float64]
RUNAWAY_M_S2, RUNAWAY_S = -2.5, 3.0  # a sick accelerometer: how far, and how long it takes
JITTER_SHARE = 0.02  # of a period: standard deviation of the instants of sampling
FIX_GEOMETRY = 1.5  # a position fix is worse than a range by the geometry of its anchors


@dataclass(frozen=True)
class Readings:
    """Tables by sensor name and the truth at the inertial samples."""

    tables: dict[str, SensorTable]
    truth: Truth


def read_all(
    mission: Mission,
    world: World,
    trajectory: Trajectory,
    rig: dict[str, AnySensor],
    sheets: tuple[ImuSheet, TofSheet],
    streams: Streams,
) -> Readings:
    """What every sensor but the camera reads on a flight."""
    imu_sheet, tof_sheet = sheets
    imu_motion = trajectory.at(np.arange(round(trajectory.duration_s * imu_sheet.rate_hz) + 1) / imu_sheet.rate_hz)
    imu = read_imu(
        imu_sheet,
        imu_motion,
        imu_motion.force(trajectory.gravity_m_s2),
        _vibration(mission, imu_motion),
        _runaway(mission, imu_motion.t_s, trajectory.duration_s),
        streams.of("imu0"),
    )
    tables = {"imu0": imu.table}
    for name in ("tof0", "tof1"):
        rng = streams.of(name)
        mounting = np.array(rig[name].T_BS).reshape(4, 4)
        motion = trajectory.at(_instants(trajectory.duration_s, tof_sheet.rate_hz, rng))
        tables[name] = read_tof(tof_sheet, world, motion, mounting, mission.faults, rng)
    rng = streams.of("att0")
    motion = trajectory.at(_instants(trajectory.duration_s, ATTITUDE_HZ, rng, jitter=0.0))
    tables["att0"] = read_attitude(motion, "attitude_drift" in mission.faults, rng)
    rng = streams.of("baro0")
    motion = trajectory.at(_instants(trajectory.duration_s, BARO_HZ, rng, jitter=0.0))
    tables["baro0"] = read_barometer(motion, "baro_doors" in mission.faults, rng)
    if "uwb0" in rig:
        tables["uwb0"] = _read_uwb(mission, world, trajectory, streams.of("uwb0"))
    truth = Truth(
        stamps(imu_motion.t_s),
        imu_motion.position_m,
        imu_motion.rotation_WB.as_quat(scalar_first=True),
        imu_motion.velocity_m_s,
        imu.gyro_bias,
        imu.accel_bias,
    )
    return Readings(tables, truth)


def _instants(duration_s: float, rate_hz: float, rng: np.random.Generator, jitter: float = JITTER_SHARE) -> Array:
    """When a sensor with a clock of its own samples [s]."""
    count = int((duration_s - 1.0 / rate_hz) * rate_hz)
    return np.asarray((np.arange(count) + rng.uniform(0.2, 0.8) + jitter * rng.normal(size=count)) / rate_hz)


def _vibration(mission: Mission, motion: Motion) -> Array:
    """Standard deviation of the frame's vibration: a third while it stands, all of it when it flies [m/s^2]."""
    flying = smoothstep((motion.t_s - 0.7 * mission.vehicle.still_s) / 1.0)
    return mission.vehicle.vibration_m_s2 * (0.1 + 0.9 * flying)


def _runaway(mission: Mission, t_s: Array, duration_s: float) -> Array:
    if "accel_runaway" not in mission.faults:
        return np.zeros(len(t_s))
    start = duration_s / 2.0
    return RUNAWAY_M_S2 * np.clip((t_s - start) / RUNAWAY_S, 0.0, 1.0)


def _read_uwb(mission: Mission, world: World, trajectory: Trajectory, rng: np.random.Generator) -> SensorTable:
    plan = mission.uwb
    t = _instants(trajectory.duration_s, plan.rate_hz, rng)
    motion = trajectory.at(t)
    antenna = motion.position_m + motion.rotation_WB.apply(ANTENNA_M)
    anchors = anchors_of(mission)
    names, places = tuple(anchors), np.array(list(anchors.values()))
    geometric = plan.condition != "clean"
    if plan.measurement == "tdoa":
        table = _differences(mission, world, t, antenna, places, geometric, rng)
    elif plan.measurement == "position":
        table = _fixes(mission, world, t, antenna, places, geometric, rng)
    else:
        table = _ranges(mission, world, t, antenna, places, geometric, rng)
    late_s = plan.latency_s if "uwb_late" in mission.faults else 0.0
    start = event_start_s(trajectory.duration_s)
    columns = _disturbed(plan.condition, t, table, start, rng)
    keep = columns.pop("keep")
    anchor_names = names if plan.measurement != "position" else ()
    return SensorTable(stamps(t + late_s)[keep], {n: c[keep] for n, c in columns.items()}, anchor_names)


def _ranges(
    mission: Mission, world: World, t: Array, antenna: Array, places: Array, geometric: bool, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    links = observe(world, places, t, antenna, geometric, rng)
    power, first_path = powers(links, rng)
    value = links.distance_m + links.bias_m + noise(t, mission.uwb.sigma_m, rng)
    return {
        "anchor": links.anchor,
        "range_m": np.maximum(np.round(value, 3), 0.0),
        "rssi_dbm": power,
        "first_path_dbm": first_path,
        "keep": _received(links, rng),
    }


def _received(links: Links, rng: np.random.Generator) -> NDArray[np.bool_]:
    return np.asarray(rng.random(len(links.anchor)) >= np.where(links.in_sight, DROPOUT[True], DROPOUT[False]))


def _differences(
    mission: Mission, world: World, t: Array, antenna: Array, places: Array, geometric: bool, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    """Range differences of neighbouring anchors, d(b) - d(a), each with its own reflection."""
    first = observe(world, places, t, antenna, geometric, rng)
    second = observe(world, np.roll(places, -1, axis=0), t, antenna, geometric, rng)
    value = second.distance_m + second.bias_m - first.distance_m - first.bias_m
    value = value + np.sqrt(2.0) * noise(t, mission.uwb.sigma_m, rng)
    return {
        "anchor_a": first.anchor,
        "anchor_b": (first.anchor + 1) % len(places),
        "difference_m": np.round(value, 3),
        "keep": _received(first, rng) & _received(second, rng),
    }


def _fixes(
    mission: Mission, world: World, t: Array, antenna: Array, places: Array, geometric: bool, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    """Positions as a receiver computes them: reflections push the fix away from the middle of the anchors."""
    links = observe(world, places, t, antenna, geometric, rng)
    away = antenna - places.mean(axis=0)
    away = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1.0)
    random = np.column_stack([noise(t, FIX_GEOMETRY * mission.uwb.sigma_m, rng) for _ in range(3)])
    position = antenna + links.bias_m[:, None] * away + random
    return {"position_m": np.round(position, 3), "keep": _received(links, rng)}


def _disturbed(
    condition: str, t: Array, table: dict[str, NDArray[np.generic]], start_s: float, rng: np.random.Generator
) -> dict[str, NDArray[np.generic]]:
    """The table with its values under a condition, receiver by receiver."""
    name = next(n for n in ("range_m", "difference_m", "position_m") if n in table)
    values = np.array(table[name], dtype=np.float64)
    groups = table.get("anchor", table.get("anchor_a", np.zeros(len(t), dtype=np.int64)))
    for group in np.unique(groups):
        own = groups == group
        values[own] = disturb(condition, t[own], values[own], start_s, rng)
    if name == "range_m":
        values = np.maximum(values, 0.0)
    return {**table, name: values}
