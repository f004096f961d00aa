"""The verb ``motion``."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.replay.cli_output import emit, progress_bar
from axialnav.replay.cli_tune import refuse_inputs, write_text

NOT_EVALUATED = 3


def motion_command(
    flight: Path | None = None,
    /,
    *,
    method: str = "joint",
    frames: int = 5,
    camera: str = "cam0",
    axis: str = "x",
    distance_m: float | None = None,
    undistort: Annotated[bool | None, Parameter(negative="--raw")] = None,
    out: Path | None = None,
    experiment: str | None = None,
    seed: int | None = None,
    trials: int | None = None,
) -> int:
    """Measure image motion in the frames of a flight and score it against the truth.

    Exit code 3 means that no window was accepted.

    Parameters
    ----------
    flight
        Flight folder with camera frames; not needed for an experiment.
    method
        joint (default), composite, single, or a published baseline: stripes, darkline, dct, cepstrum.
    frames
        Frames per window.
    camera
        Camera folder.
    axis
        Image axis of the motion: x or y.
    distance_m
        Distance of the wall along the optical axis in metres, for the score; from the surface that the camera names
        if not given.
    undistort
        Remove the lens' distortion first; by default only if the camera names a surface. --raw: use the pixels as
        recorded.
    out
        CSV file to write, one line per window; for an experiment the folder of its table and figure.
    experiment
        Run one of the paper's experiments on rendered walls instead: single-vs-composite, frames, calibration,
        field.
    seed
        Of the experiment's random numbers; 1 if not given.
    trials
        Windows per condition of the experiment; its own number if not given.
    """
    options: dict[str, Any] = {
        "method": method, "frames": frames, "camera": camera, "axis": axis, "distance_m": distance_m,
        "undistort": undistort,
    }  # fmt: skip
    if experiment is not None:
        _refuse_options(experiment, flight, options)
        return _experiment(experiment, out or Path("runs") / experiment, 1 if seed is None else seed, trials)
    if flight is None:
        raise ConfigError("motion needs a flight folder, or --experiment NAME")
    if seed is not None or trials is not None:
        raise ConfigError("--seed and --trials belong to an experiment; leave them out, or add --experiment NAME")
    return _measure(flight, out, **options)


def _refuse_options(experiment: str, flight: Path | None, options: dict[str, Any]) -> None:
    """An experiment brings its own methods and pictures: what was asked for besides would be ignored."""
    if flight is not None:
        raise ConfigError(f"--experiment {experiment} renders its own walls and takes no flight; leave out {flight}")
    usual = signature(motion_command).parameters
    other = [f"--{name.replace('_', '-')}" for name, value in options.items() if value != usual[name].default]
    if other:
        raise ConfigError(
            f"--experiment {experiment} brings its own methods and pictures; leave out {', '.join(other)}"
        )


def _measure(flight: Path, out: Path | None, **options: Any) -> int:
    from axialnav.estimators.estimate import FrameError
    from axialnav.replay.flight import load_flight
    from axialnav.replay.motion import run_motion
    from axialnav.replay.motion_table import motion_summary

    if out is not None:
        refuse_inputs(out, (flight,), "motion.csv")
    recording = load_flight(flight)
    try:
        with progress_bar(f"motion {recording.name}") as progress:
            run = run_motion(recording, progress=progress, **options)
    except FrameError as error:
        raise _sorted_error(error) from error
    emit(motion_summary(run))
    if out is not None:
        write_text(out, run.to_csv())
        emit(f"written    {out}")
    return 0 if run.accepted().any() else NOT_EVALUATED


def _experiment(name: str, out: Path, seed: int, trials: int | None) -> int:
    from axialnav.replay.experiments.command import experiment_command

    result = experiment_command(name, out, seed, trials)
    emit("\n".join([result.text.rstrip("\n"), *(f"written    {file}" for file in result.files)]))
    return 0


def _sorted_error(error: ValueError) -> ConfigError | FlightError:
    """A wrong option is a usage error; a frame that cannot be used is a fault of the recording."""
    text = str(error)
    words = ("method", "axis", "roi", "distortion model")
    return (
        ConfigError(text) if any(text.startswith(word) or f"no {word}" in text for word in words) else FlightError(text)
    )
