"""How every command of the package ends: exit codes, and one line on stderr instead of a traceback."""

from __future__ import annotations

import os
import sys

from axialnav.fusion.errors import AxialnavError, ConfigError

PASSED, FAILED, USAGE, UNUSABLE, INTERRUPTED = 0, 1, 2, 3, 130
DEBUG = "AXIALNAV_DEBUG"


def shows_tracebacks() -> bool:
    """Whether the person at the terminal asked for tracebacks (``AXIALNAV_DEBUG=1``)."""
    return bool(os.environ.get(DEBUG))


def complain(text: str) -> None:
    """Write one line on stderr, whatever ``text`` contains."""
    sys.stderr.write(f"axialnav: {' '.join(text.split())}\n")


def explain(error: Exception) -> tuple[str, int]:
    """One line for a person and the exit code that goes with an error."""
    if isinstance(error, AxialnavError):
        return str(error), USAGE if isinstance(error, ConfigError) else UNUSABLE
    if isinstance(error, OSError):
        return f"{error.filename or 'input'}: {error.strerror or error}", UNUSABLE
    return (
        f"stopped by a defect of axialnav: {type(error).__name__}: {error}; {DEBUG}=1 shows where, please report it",
        UNUSABLE,
    )
