"""Replay of a recorded flight: the same filter as in flight, fed from tables instead of drivers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.outcome import InnovationLog, Track
from axialnav.models.rig import AttitudeSource, Imu
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.frames import with_pixel_motion
from axialnav.replay.fused import Column, digest, fused_columns

if TYPE_CHECKING:
    from axialnav.fusion.batch import BatchResult

ESTIMATORS = ("corridor", "axial")
MIN_IMU_SAMPLES = 2


@dataclass(frozen=True, slots=True)
class Run:
    """A replayed flight.

    Attributes
    ----------
    flight
        What was replayed.
    config
        Fully resolved; replaying with it gives the same digest.
    track, log
        The estimate at every IMU sample, and one record per other reading.
    columns
        Columns of ``fused.csv`` in file order.
    metrics
        The dictionary of ``metrics.json``.
    handedness
        ``"left"`` where the survey was found to be left-handed: the track is then mirrored, its attitude is not.
    """

    flight: Flight
    config: Config
    track: Track
    log: InnovationLog
    columns: dict[str, Column]
    metrics: dict[str, Any]
    handedness: str = "right"

    @property
    def table(self) -> str:
        """The summary that the command line prints."""
        from axialnav.replay.table import summary

        return summary(self)

    def write(self, folder: str | Path) -> Path:
        """Write the run folder; see :func:`axialnav.replay.run_folder.write_run_folder`."""
        from axialnav.replay.run_folder import write_run_folder

        return write_run_folder(self, folder)


def replay(
    flight: Flight | str | Path,
    config: Config | None = None,
    *,
    without: Sequence[str] = (),
    estimator: str = "corridor",
    params: Mapping[str, str] | None = None,
    smooth: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Run the filter over a recorded flight and score it where there is a reference.

    Parameters
    ----------
    flight
        A loaded flight, or the path of one.
    config
        Settings; what it leaves open (sensors, surfaces, corridor, first state) comes from the flight.  None: the
        settings that a recording made on board was flown with, the defaults for any other flight.
    without
        Names of sensors to switch off.
    estimator
        ``"corridor"``: the 18-state filter.  ``"axial"``: four states, for flights with the autopilot's attitude.
    params
        Single settings by dotted name, values as TOML text: ``{"uwb.sigma_m": "0.4"}``.
    smooth
        Go back over the flight afterwards, so that every estimate knows the readings that came later; corridor only.
    progress
        Called with the share done, 0 .. 1.

    Raises
    ------
    ConfigError
        Unknown setting, sensor or estimator, or an estimator that cannot smooth.
    FlightError
        The flight cannot be replayed: unreadable, or without IMU samples (for "axial": without attitudes).
    """
    from numba.core.event import install_timer  # numba takes half a second, which those who only import can spare

    from axialnav.replay.metrics import score

    _refuse_unknown(estimator, smooth)
    loaded = flight if isinstance(flight, Flight) else load_flight(flight)
    started = time.perf_counter()
    resolved = resolve(config, loaded, without=without, params=params)
    compiled_s: list[float] = []
    with install_timer("numba:compile", compiled_s.append):
        result = _filter(loaded, resolved, estimator, smooth, progress)
    track, log = result.track, result.log
    columns = fused_columns(track, resolved.corridor)
    scores = score(track, log, loaded, resolved)
    head = {"flight": loaded.name, "estimator": estimator, "smoothed": smooth, "digest": digest(columns)}
    timing = _timing(track, result.kernel_s, time.perf_counter() - started, sum(compiled_s))
    return Run(loaded, resolved, track, log, columns, {**head, **scores, "timing": timing}, result.handedness)


def resolve(
    config: Config | None, flight: Flight, *, without: Sequence[str] = (), params: Mapping[str, str] | None = None
) -> Config:
    """Settings as the filter will see them: those of ``config`` where there is one, else those that the flight was
    flown with (recordings made on board tell, others have the defaults); then ``params`` and ``without``.

    Rig and world, which ``config`` need not hold, come from the flight.
    """
    resolved = (config or flight.config).with_defaults_from(flight.config)
    if params:
        resolved = resolved.with_params(dict(params))
    return resolved.without(tuple(without)) if without else resolved


def _refuse_unknown(estimator: str, smooth: bool) -> None:
    if estimator not in ESTIMATORS:
        raise ConfigError(f"no estimator named {estimator!r}; there are {', '.join(ESTIMATORS)}")
    if smooth and estimator != "corridor":
        raise ConfigError(f"estimator {estimator!r} cannot smooth; leave out smooth or choose 'corridor'")


def _filter(
    flight: Flight, config: Config, estimator: str, smooth: bool, progress: Callable[[float], None] | None
) -> BatchResult:
    from axialnav.fusion.axial_estimator import run_axial
    from axialnav.fusion.batch import run_batch
    from axialnav.fusion.smoother import run_smoothed

    _require_samples(flight, config, estimator)
    tables = with_pixel_motion(flight, config, flight.tables_for(config))
    run = run_axial if estimator == "axial" else run_smoothed if smooth else run_batch
    return run(config, tables, progress)


def _require_samples(flight: Flight, config: Config, estimator: str) -> None:
    """The axial estimator is driven by attitudes where there is no inertial unit."""
    inertial = [name for name, spec in config.sensor.items() if isinstance(spec, Imu)]
    if estimator == "axial" and not inertial:
        inertial = [name for name, spec in config.sensor.items() if isinstance(spec, AttitudeSource)]
    samples = max((len(flight.tables.get(name, ())) for name in inertial), default=0)
    if samples < MIN_IMU_SAMPLES:
        there = ", ".join(flight.tables) or "nothing"
        needed = "att0" if estimator == "axial" else "imu0"
        raise FlightError(
            f"flight {flight.name}: {samples} IMU samples, at least {MIN_IMU_SAMPLES} are needed to replay; "
            f"it holds {there}, the filter needs {needed}"
        )


def _timing(track: Track, kernel_s: float, wall_s: float, compiled_s: float) -> dict[str, float]:
    """Compiling happens once after installation and says nothing of how fast the filter is."""
    flight_s = float(track.t_ns[-1] - track.t_ns[0]) * 1e-9
    return {
        "wall_s": wall_s,
        "compiled_s": compiled_s,
        "flight_s": flight_s,
        "real_time_factor": flight_s / (wall_s - compiled_s),
        "kernel_us_per_imu": kernel_s * 1e6 / track.t_ns.size,
    }
