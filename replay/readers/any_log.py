"""One door for all recordings: finds out the format and hands the path to its reader."""

from __future__ import annotations

import struct
from pathlib import Path

from axialnav.fusion.errors import FlightError
from axialnav.replay.flight import Flight
from axialnav.replay.readers.detect import Format, detect
from axialnav.replay.readers.dropped import one_line


def read_log(path: Path, mapping: Path | None = None) -> Flight:
    """Read any recording; see :func:`axialnav.replay.flight.load_flight`.

    Raises
    ------
    FlightError
        One line: what cannot be used, why, and the way out.
    """
    try:
        form = detect(path)
        if form is Format.FOLDER:
            return _read(path, form, mapping)
        return _read_binary(path, form, mapping)
    except FlightError as error:
        raise FlightError(one_line(str(error))) from error.__cause__
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror or error}") from None


def _read_binary(path: Path, form: Format, mapping: Path | None) -> Flight:
    """Read a binary log; one whose lengths, counts or texts contradict each other is damaged."""
    try:
        return _read(path, form, mapping)
    except (struct.error, LookupError, ValueError, OverflowError) as error:
        raise FlightError(
            f"{path}: damaged {form.value}: {type(error).__name__}: {error}; copy the log again"
        ) from error


def _read(path: Path, form: Format, mapping: Path | None) -> Flight:
    if form is Format.FOLDER:
        from axialnav.replay.readers.flight_folder import read_flight_folder

        if mapping is not None:
            raise FlightError(f"{path}: a flight folder needs no mapping; leave out {mapping}")
        return read_flight_folder(path)
    if form is Format.MCAP:
        from axialnav.replay.readers.mcap_log import read_mcap_log

        return read_mcap_log(path, mapping)
    if form is Format.ULOG:
        from axialnav.replay.readers.ulog import read_ulog

        return read_ulog(path, mapping)
    if form is Format.DATAFLASH:
        from axialnav.replay.readers.dataflash import read_dataflash

        return read_dataflash(path, mapping)
    if form is Format.TLOG:
        from axialnav.replay.readers.tlog import read_tlog

        return read_tlog(path, mapping)
    if form is Format.NOOPLOOP:
        from axialnav.replay.readers.nooploop_dump import read_nooploop_dump

        return read_nooploop_dump(path, mapping)
    if form is Format.VIDEO:
        from axialnav.replay.readers.video import read_video_log

        return read_video_log(path, mapping)
    from axialnav.replay.readers.bags import read_bag

    return read_bag(path, mapping)
