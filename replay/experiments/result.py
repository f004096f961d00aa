"""What an experiment leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ExperimentResult:
    """Outcome of one experiment.

    Parameters
    ----------
    name
        Its name on the command line.
    text
        Table and remarks for the screen.
    files
        What was written: tables (CSV) and figures (SVG).
    """

    name: str
    text: str
    files: tuple[Path, ...]
