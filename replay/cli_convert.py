"""The verb ``convert``."""

from __future__ import annotations

from pathlib import Path

from axialnav.replay.cli_output import emit


def convert(log: Path, out: Path, /, *, mapping: Path | None = None) -> int:
    """Write any readable log as a flight folder, MCAP, MAVLink .tlog, ArduPilot .bin or ROS bag.

    Parameters
    ----------
    log
        Any recording that axialnav reads.
    out
        What to write, told by its ending: FOLDER, FILE.mcap, FILE.tlog, FILE.bin, FILE.bag, FOLDER.ros2.
    mapping
        TOML file that says which topics and fields of the log are which sensor.
    """
    from axialnav.replay.convert.convert import convert as write
    from axialnav.replay.convert.summary import summary
    from axialnav.replay.flight import load_flight

    flight = load_flight(log, mapping=mapping)
    written = write(flight, out)
    emit(summary(flight))
    emit(f"written    {written}")
    return 0
