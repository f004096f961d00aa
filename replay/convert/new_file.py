"""Files that must not replace others."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from axialnav.fusion.errors import FlightError


def write_new(path: Path, pieces: Iterable[bytes]) -> Path:
    """Write ``pieces`` one after another into a file that must not exist yet; return its path.

    Raises
    ------
    FlightError
        The file exists or cannot be written.
    """
    try:
        with path.open("xb") as file:
            file.writelines(pieces)
    except FileExistsError:
        raise FlightError(f"{path}: exists already; remove it or choose another name") from None
    except OSError as error:
        raise FlightError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path
