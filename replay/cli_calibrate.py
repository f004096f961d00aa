"""The verbs ``calibrate`` and ``allan``."""

from __future__ import annotations

import os
from pathlib import Path

from axialnav.fusion.errors import ConfigError
from axialnav.replay.cli_output import emit, progress_bar
from axialnav.replay.cli_tune import load_all, refuse_inputs, write_text


def calibrate(
    *logs: Path,
    config: Path | None = None,
    out: Path | None = None,
    workers: int | None = None,
    mapping: Path | None = None,
) -> int:
    """Find blur scale, focal length, range offset and the delays of the sensors' stamps from recorded flights.

    Image motion and ranges are compared with the ground truth, or where there is none with a smoothed replay in which
    the sensor itself takes no part; delays are those under which the innovations are most likely. Also the paper's
    line: speed over length. Exit code 3: nothing could be calibrated.

    Parameters
    ----------
    logs
        Flights, one or more.
    config
        TOML file with settings to start from.
    out
        TOML file to write, for replay --config: what stands out of its standard error in the first flight.
    workers
        Replays at a time; the number of cores if not given.
    mapping
        TOML file that says which topics and fields of the logs are which sensor; for logs of one kind.
    """
    from axialnav.fusion.config import Config
    from axialnav.replay.calibration.calibrate import calibrate as run_calibrate
    from axialnav.replay.calibration.calibrate_table import config_text, summary

    if not logs:
        raise ConfigError("calibrate needs a flight or more, got none: axialnav calibrate LOG... [--out TOML]")
    if workers is not None and workers < 1:
        raise ConfigError(f"--workers must be 1 or more, got {workers}")
    if out is not None:
        refuse_inputs(out, (config,))
    start = Config.from_toml(config) if config else None
    flights = load_all(logs, mapping)
    found = []
    for flight in flights:
        with progress_bar(f"calibrate {flight.name}") as progress:
            found.append(run_calibrate(flight, start, workers=workers or os.cpu_count() or 1, progress=progress))
    if out is not None:
        write_text(out, config_text(found[0], start, flights[0]))
    emit(summary(found))
    if out is not None:
        emit(f"written    {out}")
    something = any(one.images or one.ranges or any(d.sigma_s is not None for d in one.delays) for one in found)
    return 0 if something else 3


def allan(log: Path, /, *, out: Path | None = None, mapping: Path | None = None) -> int:
    """Find the noise densities of an inertial unit from a recording at rest.

    Overlapping Allan deviation, densities in the convention of Kalibr. A recording that is too short is refused, and
    how long it has to be is said.

    Parameters
    ----------
    log
        Recording of at least a minute at rest; hours for the walk of the biases.
    out
        YAML file to write, with the keys of Kalibr's imu.yaml.
    mapping
        TOML file that says which topics and fields of the log are which sensor.
    """
    from axialnav.replay.calibration.allan import allan as run_allan
    from axialnav.replay.calibration.allan import imu_yaml, summary
    from axialnav.replay.flight import load_flight

    if out is not None:
        refuse_inputs(out, ())
    found = run_allan(load_flight(log, mapping=mapping))
    if out is not None:
        write_text(out, imu_yaml(found))
    emit(summary(found))
    if out is not None:
        emit(f"written    {out}")
    return 0
