"""Chooses the writer of a format by the name of the output."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from axialnav.fusion.errors import ConfigError
from axialnav.replay.flight import Flight

KNOWN = "a folder, FILE.mcap, FILE.tlog, FILE.bin, FILE.bag (ROS 1), FOLDER.ros2 (ROS 2 bag)"


def convert(flight: Flight, out: str | Path) -> Path:
    """Write a flight in the format that the name of ``out`` asks for, and return the path.

    ``.mcap``, ``.tlog``, ``.bin``, ``.bag`` and ``.ros2`` are files and bags; a name without ending is a flight folder.

    Raises
    ------
    ConfigError
        No format has that ending.
    FlightError
        The output exists already or cannot be written.
    """
    out = Path(out)
    return _writer(out)(flight, out)


def _writer(out: Path) -> Callable[[Flight, Path], Path]:
    suffix = out.suffix.lower()
    if suffix == ".mcap":
        from axialnav.replay.convert.mcap import write_mcap

        return write_mcap
    if suffix == ".tlog":
        from axialnav.replay.convert.tlog import write_tlog

        return write_tlog
    if suffix == ".bin":
        from axialnav.replay.convert.dataflash import write_dataflash

        return write_dataflash
    if suffix in {".bag", ".ros2"}:
        from axialnav.replay.convert.bags import write_bag

        return write_bag
    if suffix[1:].isalpha() and len(suffix) <= 5:
        raise ConfigError(f"no format has the ending {suffix!r}; there are {KNOWN}")
    from axialnav.replay.convert.folder import write_folder

    return write_folder
