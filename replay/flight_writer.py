"""Writes a flight to a folder that reads back equal, number for number.

Floats are written with ``repr``, which is the shortest text that reads back to the same bits.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import yaml
from numpy.typing import NDArray

from axialnav.fusion.errors import FlightError
from axialnav.fusion.strict_toml import dump
from axialnav.models.rig import AnySensor, Camera, Flow, Gps, Uwb
from axialnav.replay.flight import ANCHOR_FIELDS, Flight, SensorTable, Stamps
from axialnav.replay.readers import columns as c
from axialnav.replay.readers.flight_folder import TRUTH_FOLDER
from axialnav.replay.readers.sensor_yaml import anchor_name
from axialnav.replay.readers.tables import half_window_ns, layout_of
from axialnav.replay.readers.yaml_forms import FORMS

_UNSAFE = frozenset(",#\r\n")


def write_flight(flight: Flight, folder: str | Path) -> Path:
    """Write ``flight`` as a flight folder and return that folder.

    Images of cameras are copied from ``flight.path`` unless they are already in place.

    Raises
    ------
    FlightError
        The folder holds a flight already, cannot be written, or a name in the flight cannot stand in a CSV file.
    """
    folder = Path(folder)
    there = next(iter([*folder.glob("flight.toml"), *folder.glob("mav0/*/data.csv")]), None)
    if there is not None:
        raise FlightError(f"{folder}: holds a flight already ({there.name}); remove it or choose another folder")
    try:
        _write(flight, folder)
    except OSError as error:
        raise FlightError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return folder


def _write(flight: Flight, folder: Path) -> None:
    mav0 = folder / "mav0"
    mav0.mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(dump(_flight_toml(flight)), encoding="utf-8")
    gps = flight.gps
    for name, spec in flight.config.sensor.items():
        place = mav0 / name
        if isinstance(spec, Gps):
            if gps is None:
                continue
            columns: Mapping[str, NDArray[Any]] = {"position_m": gps.position_m, "velocity_m_s": gps.velocity_m_s}
            table, gps = SensorTable(gps.t_ns, columns), None
        elif name in flight.tables:
            table = flight.tables[name]
        else:
            continue
        if isinstance(spec, Camera) and table.is_motion:
            raise FlightError(
                f"{name} holds image motion measured on board, for which a flight folder has no form; "
                f"convert to MCAP, or keep the recording as it is"
            )
        place.mkdir(exist_ok=True)
        (place / "sensor.yaml").write_text(_sensor_yaml(spec), encoding="utf-8")
        _write_csv(place / "data.csv", layout_of(spec), *_as_in_file(spec, table))
        if isinstance(spec, Camera):
            _copy_images(flight, name, table, place)
    if flight.truth is not None:
        _write_truth(flight, mav0 / TRUTH_FOLDER)


def _flight_toml(flight: Flight) -> dict[str, Any]:
    config = msgspec.to_builtins(flight.config)
    start_s, end_s = flight.evaluation
    corridor = {key: value for key, value in (config["corridor"] or {}).items() if value}
    tables = {
        "flight": {"name": flight.name, **flight.info},
        "world": {"gravity_m_s2": flight.config.gravity_m_s2},
        "corridor": corridor,
        "surface": config["surface"],
        "initial": config["initial"],
        "evaluation": {key: value for key, value in (("start_s", start_s), ("end_s", end_s)) if value is not None},
    }
    return {name: table for name, table in tables.items() if table}


def _sensor_yaml(spec: AnySensor) -> str:
    form = next(form for form in FORMS if type(spec) is form.kind)
    keys = {name: key for key, name in form.rename.items()}
    plain: dict[str, Any] = {"sensor_type": form.sensor_type}
    for name, value in msgspec.to_builtins(spec).items():
        if name == "T_BS":
            plain["T_BS"] = {"rows": 4, "cols": 4, "data": list(value)}
        elif name != "kind" and value is not None and value not in ({}, ()):
            plain[keys.get(name, name)] = list(value) if isinstance(value, tuple) else value
    if isinstance(spec, Camera):
        plain["camera_model"] = "pinhole"
    return str(yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=1000))


def _as_in_file(spec: AnySensor, table: SensorTable) -> tuple[Stamps, dict[str, NDArray[Any]]]:
    """Stamps and columns as the file holds them: flow at the end of its window, anchors by name."""
    columns = dict(table.columns)
    if isinstance(spec, Flow):
        t_ns = table.t_ns + half_window_ns(columns["window_s"])
        order = np.argsort(t_ns, kind="stable")
        return t_ns[order], {name: array[order] for name, array in columns.items()}
    if isinstance(spec, Uwb):
        for field in ANCHOR_FIELDS:
            if field in columns:
                names = table.anchor_names(field)
                for name in set(names):
                    _require_writable(name)
                columns[field] = np.array(names, dtype=np.str_)
    return table.t_ns, columns


def _require_writable(name: str) -> None:
    if not name or _UNSAFE & set(name) or anchor_name(name) != name:
        raise FlightError(
            f"anchor {name!r} cannot stand in a CSV file; give it a name without commas, # or outer spaces"
        )


def _write_csv(path: Path, layout: c.Layout, t_ns: Stamps, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write the columns of ``layout``; optional ones only where they hold a value."""
    headers = ["timestamp [ns]"]
    texts: list[Iterator[str]] = [map(str, t_ns.tolist())]
    for column, array in _spread(layout, columns):
        if column.text:
            headers.append(column.name)
            texts.append(map(str, array.tolist()))
        elif column.required or not np.isnan(array).all():
            headers.append(column.header)
            texts.append(map(repr, array.tolist()))
    lines = map(",".join, zip(*texts, strict=True))
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("#" + ",".join(headers) + "\n")
        file.writelines(line + "\n" for line in lines)


def _spread(layout: c.Layout, columns: Mapping[str, NDArray[Any]]) -> Iterator[tuple[c.Column, NDArray[Any]]]:
    """Every column of the layout that the table has, vectors taken apart."""
    seen: dict[str, int] = {}
    for column in layout:
        if column.target in columns:
            array = columns[column.target]
            index = seen.get(column.target, 0)
            seen[column.target] = index + 1
            yield column, array if array.ndim == 1 else array[:, index]


def _copy_images(flight: Flight, sensor: str, table: SensorTable, place: Path) -> None:
    (place / "data").mkdir(exist_ok=True)
    for name in table.columns["filename"].tolist():
        source, target = flight.image_path(sensor, name), place / "data" / name
        if source.is_file() and not target.exists():
            shutil.copyfile(source, target)
    for video in (flight.path / "mav0" / sensor).glob("video.*"):
        if not (place / video.name).exists():
            shutil.copyfile(video, place / video.name)


def _write_truth(flight: Flight, place: Path) -> None:
    truth = flight.truth
    if truth is None:
        return
    columns = {
        "position_m": truth.position_m,
        "quaternion_WB": truth.quaternion_WB,
        "velocity_m_s": truth.velocity_m_s,
        "gyro_bias": truth.gyro_bias,
        "accel_bias": truth.accel_bias,
    }
    place.mkdir(exist_ok=True)
    held = {name: array for name, array in columns.items() if array is not None}
    _write_csv(place / "data.csv", c.TRUTH, truth.t_ns, held)
