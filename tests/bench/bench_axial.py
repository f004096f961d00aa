"""The axial estimator: real flights with a made attitude, and wrong UWB: ``python -m tests.bench.bench_axial``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from axialnav.fusion.axial_estimator import run_axial
from axialnav.fusion.outcome import Health
from axialnav.models.rig import AttitudeSource
from axialnav.replay.flight import Flight, SensorTable, load_flight
from axialnav.replay.run import replay
from tests.bench.flights import CASES, FLIGHTS
from tests.bench.markdown import machine, table
from tests.fusion.made_attitude import logged_attitude
from tests.fusion.made_axial import AxialFlight, axial_corridor
from tests.fusion.made_corridor import FAULTS, WINDOWS_S, Corridor

SEEDS = 3
EVERY_NS = 20_000_000
NAMED = {"axial.heading_rad": "0.0"}
FLIGHT_HEAD = ("flight", "corridor estimator (no attitude)", "axial, accelerometer and attitude", "attitude alone")
FAULT_HEAD = (
    "driven by", "UWB as", "fault", "velocity on [m/s]", "off", "position on [m]", "off", "suspect", "resets",
)  # fmt: skip


def with_attitude(flight: Flight) -> Flight:
    """Add attitudes: those of the motion capture with a tilt error that wanders."""
    truth = flight.truth
    if truth is None:
        raise ValueError(f"{flight.name} has no ground truth to make an attitude from")
    due = np.arange(truth.t_ns[0], truth.t_ns[-1], EVERY_NS)
    rows = np.unique(np.searchsorted(truth.t_ns, due))
    attitude = Rotation.from_quat(truth.quaternion_WB[rows], scalar_first=True)
    made = logged_attitude(truth.t_ns[rows], attitude, 0)
    config = msgspec.structs.replace(flight.config, sensor={**flight.config.sensor, "att0": AttitudeSource()})
    return replace(flight, config=config, tables={**flight.tables, "att0": SensorTable(made.t_ns, made.columns)})


def flight_rows() -> Iterator[list[str]]:
    """RMSE of axial velocity, and for the axial estimator mean sigma and share inside 3 sigma."""
    for case in CASES:
        if case.axial_m_s is None or not (FLIGHTS / case.flight / "mav0").is_dir():
            continue
        flight = load_flight(FLIGHTS / case.flight)
        full = replay(flight, without=case.without).metrics["axial_velocity_m_s"]["rmse"]
        cells = [case.label, f"{full:.3f}"]
        for without in (case.without, (*case.without, "imu0")):
            run = replay(with_attitude(flight), without=without, estimator="axial", params=NAMED)
            axial = run.metrics["axial_velocity_m_s"]
            cells.append(f"{axial['rmse']:.3f} ({axial['mean_sigma']:.3f}, {100 * axial['in_3_sigma']:.1f} %)")
        yield cells


def fault_rows(faults: tuple[str, ...] = FAULTS, seeds: int = SEEDS) -> Iterator[list[str]]:
    """One line per driver, kind of UWB and fault; the same flights with the supervisor and without."""
    for imu in (True, False):
        for uwb in ("fix", "range", "tdoa"):
            for fault in faults:
                corridors = [Corridor(seed=seed, uwb=uwb, fault=fault, duration_s=65.0) for seed in range(seeds)]
                flights = [axial_corridor(corridor, imu=imu) for corridor in corridors]
                on, off = (
                    np.mean([score(f, fault, {"supervisor.enabled": word}) for f in flights], axis=0)
                    for word in ("true", "false")
                )
                driver = "accelerometer" if imu else "attitude"
                values = (on[0] ** 0.5, off[0] ** 0.5, on[1] ** 0.5, off[1] ** 0.5, on[2], on[3])
                yield [driver, uwb, fault, *(f"{v:.{d}f}" for v, d in zip(values, (3, 3, 2, 2, 3, 2), strict=True))]


def score(flight: AxialFlight, fault: str, params: Mapping[str, str]) -> tuple[float, float, float, float]:
    """Mean squared errors of axial velocity and position in the event's window, share suspect, resets."""
    track = run_axial(flight.config.with_params(dict(params)), flight.tables).track
    t_s = (track.t_ns - flight.made.tables["imu0"].t_ns[0]) * 1e-9
    start, end = WINDOWS_S[fault]
    window = (t_s >= start) & (t_s < end)
    errors = flight.error_m_s(track), flight.error_m(track)
    velocity, position = (float((error[window] ** 2).mean()) for error in errors)
    return velocity, position, float(((track.flags & Health.UWB_SUSPECT) > 0).mean()), float(track.resets[-1])


def main() -> None:
    """Print both tables."""
    sys.stdout.write(f"{machine()}; a tilt error of 0.6 degrees\n\n{table(FLIGHT_HEAD, flight_rows())}\n\n")
    sys.stdout.write(f"{SEEDS} flights a row\n\n{table(FAULT_HEAD, fault_rows())}\n")


if __name__ == "__main__":
    main()
