"""Recordings that are shipped with the package, each with the licence it came under."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

DEFAULT = "copter_px4flow"


def sample_flight_path(name: str = DEFAULT) -> Path:
    """Folder of a shipped flight, ready for :func:`axialnav.load_flight`.

    ``copter_px4flow``: the first 80 s of an outdoor flight of a multicopter with an optical-flow chip, a range finder
    and GPS as the reference: 3 s standing, take-off, then about 2.8 m/s at 3 m height.

    Raises
    ------
    FileNotFoundError
        There is no shipped flight of that name; the message lists those that exist.
    """
    with as_file(files(__name__)) as home:
        if not (home / name / "mav0").is_dir():
            known = ", ".join(sorted(folder.parent.name for folder in home.glob("*/mav0")))
            raise FileNotFoundError(f"no sample flight named {name!r}; there are: {known or 'none'}")
        return Path(home / name)
