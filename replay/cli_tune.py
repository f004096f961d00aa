"""The verb ``tune``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError
from axialnav.replay.cli_output import emit, progress_bar

if TYPE_CHECKING:
    from axialnav.replay.flight import Flight

Names = Annotated[list[str] | None, Parameter(negative=(), consume_multiple=False)]
Paths = Annotated[list[Path] | None, Parameter(negative=(), consume_multiple=False)]


def tune(
    *logs: Path,
    out: Path,
    free: Names = None,
    config: Path | None = None,
    hold_out: Paths = None,
    workers: int | None = None,
    mapping: Path | None = None,
) -> int:
    """Find the noise settings under which the innovations of recorded flights are most likely.

    Prints every setting before and after with its standard error, what the flights do not determine, and mean NIS,
    whiteness and errors before and after; writes a TOML file for replay --config. No input file is changed.

    Parameters
    ----------
    logs
        Flights to tune on, one or more.
    out
        TOML file to write.
    free
        Settings to tune, separated by commas, e.g. uwb.sigma_m,delay.late_s.uwb0,sensor.uwb0.lever_x_m; if not given,
        the noise of the accelerometer and of all sensors that were read, but not of barometers and attitudes.
    config
        TOML file with settings to start from.
    hold_out
        A flight that is only scored, before and after; may be repeated.
    workers
        Replays at a time; the number of cores if not given.
    mapping
        TOML file that says which topics and fields of the logs are which sensor; for logs of one kind.
    """
    from axialnav.fusion.config import Config
    from axialnav.replay.tuning.tune import tune as run_tune
    from axialnav.replay.tuning.tune_table import config_text, summary

    if not logs:
        raise ConfigError("tune needs a flight or more, got none: axialnav tune LOG... --out TOML")
    if workers is not None and workers < 1:
        raise ConfigError(f"--workers must be 1 or more, got {workers}")
    refuse_inputs(out, (config,))
    start = Config.from_toml(config) if config else None
    names = [name.strip() for item in free or () for name in item.split(",") if name.strip()]
    flights, held = load_all(logs, mapping), load_all(hold_out or (), mapping)
    with progress_bar("tune") as progress:
        tuning = run_tune(
            flights, start, free=names, hold_out=held, workers=workers or os.cpu_count() or 1, progress=progress
        )
    write_text(out, config_text(tuning, start, flights))
    emit(summary(tuning))
    emit(f"written    {out}")
    return 0


def load_all(paths: Sequence[Path], mapping: Path | None) -> list[Flight]:
    """Recordings, all read with the same mapping."""
    from axialnav.replay.flight import load_flight

    return [load_flight(path, mapping=mapping) for path in paths]


def refuse_inputs(out: Path, inputs: tuple[Path | None, ...], example: str = "tuned.toml") -> None:
    """Never write over a file that was read; ``example`` is what a file may be called.

    Raises
    ------
    ConfigError
        ``out`` is one of ``inputs``, a folder, or part of a recorded flight.
    """
    if any(path is not None and path.exists() and out.exists() and path.samefile(out) for path in inputs):
        raise ConfigError(f"--out {out} is also an input; settings are never edited in place, choose another file")
    if out.is_dir():
        raise ConfigError(f"--out {out} is a folder; name a file in it, like {out / example}")
    if out.name in {"flight.toml", "sensor.yaml", "data.csv"}:
        raise ConfigError(f"--out {out} would replace a part of a recorded flight; choose another name")


def write_text(path: Path, text: str) -> None:
    """Write a file.

    Raises
    ------
    ConfigError
        It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {path}: cannot be written ({error.strerror or error})") from None
