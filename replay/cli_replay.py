"""The verbs ``replay`` and ``demo``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from axialnav.fusion.errors import ConfigError
from axialnav.replay.cli_output import emit, progress_bar

if TYPE_CHECKING:
    from axialnav.replay.run import Run

Names = Annotated[list[str] | None, Parameter(negative=(), consume_multiple=False)]


def replay(
    log: Path,
    /,
    *,
    config: Path | None = None,
    out: Path | None = None,
    without: Names = None,
    estimator: str = "corridor",
    smooth: Annotated[bool, Parameter(negative=())] = False,
    param: Names = None,
    mapping: Path | None = None,
    viewer: Annotated[bool, Parameter(negative=())] = False,
) -> int:
    """Run the filter over a recorded flight, print the table and write the run folder.

    A flight without a reference is replayed too: the scores say NOT_EVALUATED and the exit code stays 0.

    Parameters
    ----------
    log
        Flight folder, or any other log that axialnav reads.
    config
        TOML file with settings; what it leaves open comes from the flight. The config.toml of a run folder repeats
        that run to the last bit.
    out
        Run folder to write; runs/<flight name> if not given.
    without
        Sensors to switch off, separated by commas.
    estimator
        Which filter: corridor, or axial for flights that carry the autopilot's attitude.
    smooth
        Go back over the flight after filtering, so that every estimate knows the readings that came later.
    param
        One setting as NAME=VALUE, e.g. uwb.sigma_m=0.4; may be repeated.
    mapping
        TOML file that says which topics and fields of the log are which sensor.
    viewer
        Also write recording.rrd for the Rerun viewer; needs the extra viewer.
    """
    from axialnav.fusion.config import Config
    from axialnav.replay.flight import load_flight
    from axialnav.replay.run import replay as run_replay

    _require_viewer(viewer)
    params = dict(map(_parameter, param or ()))
    settings = Config.from_toml(config) if config else None
    flight = load_flight(log, mapping=mapping)
    folder = out or Path("runs") / _file_name(flight.name)
    _refuse_flight_folder(folder)
    with progress_bar(f"replay {flight.name}") as progress:
        run = run_replay(
            flight,
            settings,
            without=_names(without),
            estimator=estimator,
            params=params,
            smooth=smooth,
            progress=progress,
        )
    return _finish(run, folder, viewer=viewer)


def demo(*, out: Path = Path("runs/demo")) -> int:
    """Fly a simulated corridor with camera frames (straight, stairs, a reflecting corner), replay and report it.

    It ends with the verdict of `axialnav check` with its own limits, after what is not passed; so is the exit code.

    Parameters
    ----------
    out
        Run folder to write; the flight itself goes into its folder flight.
    """
    from axialnav.replay.checks import EXIT_CODES, Judgement, check_metrics, verdict
    from axialnav.replay.flight import load_flight
    from axialnav.replay.limits_file import read_limits
    from axialnav.replay.run import replay as run_replay
    from axialnav.replay.simulate.demo import NO_MARGIN, fly_demo, rehearsed

    _refuse_flight_folder(out)
    with progress_bar("demo: fly") as progress, rehearsed():
        fly_demo(out / "flight", progress)
    with progress_bar("demo: replay") as progress:
        run = run_replay(load_flight(out / "flight"), params=NO_MARGIN, progress=progress)
    _finish(run, out)
    checks = check_metrics(run.metrics, read_limits())
    for bad in (c for c in checks if c.judgement in (Judgement.WARN, Judgement.FAIL)):
        emit(f"{bad.judgement:<10} {bad.name} is {bad.value:.3g}, {bad.limit}: {bad.reason}")
    overall = verdict(checks)
    emit(f"verdict    {overall}   every check: axialnav check {out}")
    return EXIT_CODES[overall]


def _finish(run: Run, folder: Path, *, viewer: bool = False) -> int:
    """Write everything first, then print: the files are there even when nobody reads the table."""
    from axialnav.replay.viewer import RECORDING, write_recording

    run.write(folder)
    if viewer:
        write_recording(run, folder / RECORDING)
    emit(run.table)
    emit(f"report     {folder / 'report.html'}")
    if viewer:
        emit(f"viewer     rerun {folder / RECORDING}")
    return 0


def _require_viewer(wanted: bool) -> None:
    """Say that the viewer's package is missing before any work is done."""
    from axialnav.replay.viewer import rerun_module

    if wanted:
        rerun_module()


def _names(lists: list[str] | None) -> tuple[str, ...]:
    return tuple(name.strip() for item in lists or () for name in item.split(",") if name.strip())


def _parameter(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name.strip() and equals and value.strip()):
        raise ConfigError(f"--param must be NAME=VALUE like uwb.sigma_m=0.4, got {text!r}")
    return name.strip(), value.strip()


def _file_name(name: str) -> str:
    safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in name).strip(".")
    return safe or "flight"


def _refuse_flight_folder(folder: Path) -> None:
    if (folder / "flight.toml").exists() or (folder / "mav0").exists():
        raise ConfigError(f"run folder {folder} holds a recorded flight; choose another with --out")
