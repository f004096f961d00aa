"""Streams and a mapping to a flight; rows go through the same sieve as those of a flight folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import AnySensor, Camera, Gps, Imu
from axialnav.replay.flight import Flight, SensorTable, Stamps
from axialnav.replay.readers import columns as c
from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.derived import DERIVED
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.expression import MissingFieldError, column, evaluate, holds
from axialnav.replay.readers.mapping import STAMP_NS, TRUTH, Mapping, Source
from axialnav.replay.readers.rows import usable_rows
from axialnav.replay.readers.streams import Stream
from axialnav.replay.readers.tables import gps_of, layout_of, sensor_table, truth_of
from axialnav.replay.readers.units import check_imu_units

SHOWN_STREAMS = 12


class Assembly:
    """Builds a flight out of streams.

    Parameters
    ----------
    path
        The log.
    streams
        All that it holds.
    mapping, asked
        What is what, and the sensors that the user's own mapping asks for: those have to be there.
    drops
        Log of what is left out.
    """

    def __init__(
        self, path: Path, streams: Sequence[Stream], mapping: Mapping, asked: frozenset[str], drops: DropLog
    ) -> None:
        self._path, self._streams, self._mapping, self._asked, self._drops = path, streams, mapping, asked, drops
        self._span: tuple[int, int] | None = None

    def flight(self) -> Flight:
        """The flight.

        Raises
        ------
        FlightError
            A stream or field that the user's mapping asks for is missing, or nothing can be used at all.
        """
        mapping = self._mapping
        specs: dict[str, AnySensor] = {}
        tables: dict[str, SensorTable] = {}
        gps, frames = None, {}
        for name in sorted(mapping.sensor, key=lambda n: (not isinstance(mapping.sensor[n], Imu), n)):
            spec = mapping.sensor[name]
            stream = self._stream(name)
            if stream is None:
                continue
            if isinstance(spec, Camera):
                if stream.pictures is not None:
                    specs[name], frames[name] = spec, stream.pictures
                    tables[name] = _picture_table(stream)
                continue
            rows = self._rows(name, stream, layout_of(spec))
            if rows is None or not len(rows.t_ns):
                continue
            specs[name] = spec
            if isinstance(spec, Gps):
                gps = gps_of(rows)
                continue
            tables[name] = sensor_table(spec, rows, name, self._drops)
            if isinstance(spec, Imu):
                check_imu_units(rows, tables[name], name, self._drops)
                self._span = self._span or (int(rows.t_ns[0]), int(rows.t_ns[-1]))
        if not tables and gps is None:
            raise FlightError(f"{self._path}: holds no sensor that the mapping knows; {self._there()}")
        truth_rows = self._truth_rows()
        return Flight(
            name=mapping.flight.name or self._path.stem,
            path=self._path,
            info=_info(mapping),
            config=Config(
                gravity_m_s2=mapping.world.gravity_m_s2,
                corridor=mapping.corridor,
                initial=mapping.initial,
                surface=_needed(mapping, specs),
                sensor=specs,
            ),
            tables=tables,
            truth=None if truth_rows is None else truth_of(truth_rows, self._drops, TRUTH),
            gps=gps,
            evaluation=(mapping.evaluation.start_s, mapping.evaluation.end_s),
            drops=self._drops.as_tuple(),
            frames=frames,
        )

    def _there(self) -> str:
        names = [stream.name for stream in self._streams if len(stream.t_ns)]
        more = f" and {len(names) - SHOWN_STREAMS} more" if len(names) > SHOWN_STREAMS else ""
        if not names:
            return "it has no messages at all; was it cut?"
        listed = ", ".join(names[:SHOWN_STREAMS]) + more
        return f"there are {listed}; say what is what in a mapping ({self._path.name}.toml)"

    def _stream(self, name: str) -> Stream | None:
        source = self._mapping.source.get(name)
        if source is None or any(self._named(better) for better in source.unless):
            return None
        for wanted in source.streams:
            stream = self._named(wanted)
            if stream is not None:
                return stream
        if name in self._asked:
            raise FlightError(f"{self._path}: no {' or '.join(source.streams)} for {name}; {self._there()}")
        return None

    def _named(self, wanted: str) -> Stream | None:
        """First stream of that name or type that is not empty."""
        return next((s for s in self._streams if s.matches(wanted) and len(s.t_ns)), None)

    def _truth_rows(self) -> Rows | None:
        stream = self._stream(TRUTH)
        return None if stream is None else self._rows(TRUTH, stream, c.TRUTH)

    def _rows(self, name: str, stream: Stream, layout: c.Layout) -> Rows | None:
        source = self._mapping.source[name]
        try:
            rows = _read_rows(name, stream, source, layout)
        except MissingFieldError as error:
            text = f"{stream.name} has no field {error.args[0]}; it has {', '.join(list(stream.columns)[:20])}"
            if name in self._asked:
                raise FlightError(f"{self._path}: {text}; correct [source.{name}]") from None
            self._drops.add(name, "a field is missing in the log: left out", len(stream.t_ns), text)
            return None
        except ValueError as error:
            raise FlightError(f"{self._path}: [source.{name}]: {error}") from None
        return usable_rows(rows, layout, name, self._drops, self._span if name != TRUTH else None)


def _read_rows(name: str, stream: Stream, source: Source, layout: c.Layout) -> Rows:
    """Rows of a sensor, unsifted, in the order of the log."""
    number = np.arange(1, len(stream.t_ns) + 1)
    if source.where is not None:
        kept = holds(source.where, stream.columns, len(stream.t_ns))
        stream, number = stream.take(kept), number[kept]
    t_ns = stream.t_ns if source.stamp is None else _stamps(column(stream.columns, source.stamp), source.stamp_unit)
    steps = np.diff(t_ns, prepend=t_ns[:1]) / 1e9
    if len(steps) > 1:
        steps[0] = float(np.median(steps[1:]))
    columns = {**stream.columns, "step_s": steps}
    known = {column_.target for column_ in layout} | set(DERIVED)
    strange = [target for target in source.fields if target not in known]
    if strange:
        raise ValueError(f"no field {strange[0]!r}; there are {', '.join(sorted(known))}")
    targets = dict(_targets(source, columns, layout, t_ns))
    values: dict[c.Column, NDArray[Any]] = {}
    seen: dict[str, int] = {}
    for one in layout:
        index = seen.get(one.target, 0)
        seen[one.target] = index + 1
        if one.target in targets and index < targets[one.target].shape[1]:
            array = targets[one.target][:, index]
            values[one] = array.astype(np.str_) if one.text else array.astype(np.float64)
        elif one.required:
            raise MissingFieldError(f"for {one.target}")
    return Rows(f"{name} ({stream.name})", t_ns, values, "", number)


def _targets(
    source: Source, columns: dict[str, NDArray[Any]], layout: c.Layout, t_ns: Stamps
) -> Iterator[tuple[str, NDArray[Any]]]:
    texts = {one.target for one in layout if one.text}
    for target, wanted in source.fields.items():
        several = (wanted,) if isinstance(wanted, str) else wanted
        if target in texts:
            yield target, np.stack([_names(column(columns, text)) for text in several], axis=1)
            continue
        array = np.stack([evaluate(text, columns, len(t_ns)) for text in several], axis=1)
        if target in DERIVED:
            yield from DERIVED[target](array, t_ns / 1e9).items()
        else:
            yield target, array


def _names(values: NDArray[Any]) -> NDArray[Any]:
    """Anchors as text; numbers without a decimal point."""
    if values.dtype.kind == "f":
        values = values.astype(np.int64)
    return np.array([str(value) for value in values.tolist()], dtype=np.str_)


def _stamps(values: NDArray[Any], unit: str) -> Stamps:
    factor = STAMP_NS[unit]
    if values.dtype.kind in "iu":
        return values.astype(np.int64) * factor
    return np.rint(np.nan_to_num(values.astype(np.float64)) * factor).astype(np.int64)


def _picture_table(stream: Stream) -> SensorTable:
    names = np.array([f"{t}.png" for t in stream.t_ns.tolist()], dtype=np.str_)
    exposure = stream.columns.get("exposure_s", np.full(len(names), np.nan))
    return SensorTable(stream.t_ns, {"filename": names, "exposure_s": np.asarray(exposure, dtype=np.float64)})


def _needed(mapping: Mapping, specs: dict[str, AnySensor]) -> dict[str, Any]:
    """Surfaces that a sensor of the flight looks at."""
    seen = {getattr(spec, "surface", None) for spec in specs.values()}
    return {name: surface for name, surface in mapping.surface.items() if name in seen}


def _info(mapping: Mapping) -> dict[str, str]:
    about = {"source": mapping.flight.source, "licence": mapping.flight.licence, "note": mapping.flight.note}
    return {key: value for key, value in about.items() if value is not None}
