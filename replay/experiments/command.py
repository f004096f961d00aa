"""``axialnav motion --experiment NAME``: run one of the paper's experiments."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from axialnav.fusion.errors import ConfigError
from axialnav.replay.experiments.result import ExperimentResult

EXPERIMENTS = {
    "single-vs-composite": "axialnav.replay.experiments.single_vs_composite",
    "frames": "axialnav.replay.experiments.frame_count",
    "calibration": "axialnav.replay.experiments.calibration",
    "field": "axialnav.replay.experiments.field",
}
"""Name on the command line and the module whose ``run(out, seed, trials)`` does it."""


def experiment_command(name: str, out: Path, seed: int = 1, trials: int | None = None) -> ExperimentResult:
    """Run an experiment of the paper and write its table and figure.

    Parameters
    ----------
    name
        ``single-vs-composite`` (Fig. 5-7), ``frames`` (Fig. 8), ``calibration`` (Fig. 9) or ``field`` (Table 1 and
        Fig. 11).
    out
        Folder to write into; made if missing.
    seed
        Of every random number; equal seeds give equal tables.
    trials
        Windows per condition, for ``field`` seconds per flight; None for the experiment's own number.

    Returns
    -------
    ExperimentResult
        Text for the screen and the files written.

    Raises
    ------
    ConfigError
        If there is no such experiment, ``trials`` is not positive or ``out`` cannot be used.
    """
    if name not in EXPERIMENTS:
        raise ConfigError(f"there is no experiment named {name!r}; choose from {', '.join(EXPERIMENTS)}")
    if trials is not None and trials < 1:
        raise ConfigError(f"an experiment needs at least 1 trial per condition, got {trials}")
    if seed < 0:
        raise ConfigError(f"a seed must not be negative, got {seed}")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write into {out}: {error.strerror}; choose another folder with --out") from error
    run: Callable[[Path, int, int | None], ExperimentResult] = import_module(EXPERIMENTS[name]).run
    return run(out, seed, trials)
