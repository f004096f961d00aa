"""A flight folder to a :class:`~axialnav.replay.flight.Flight`: finds the parts and hands each to its reader."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from axialnav.fusion.config import Config
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import AnySensor, AttitudeSource, Camera, Gps, Imu
from axialnav.replay.flight import Flight, GpsReference, SensorTable, Truth
from axialnav.replay.readers import columns
from axialnav.replay.readers.csv import Rows, read_rows
from axialnav.replay.readers.dropped import DropLog, one_line
from axialnav.replay.readers.flight_toml import FlightToml, read_flight_toml
from axialnav.replay.readers.rows import usable_rows
from axialnav.replay.readers.sensor_yaml import read_sensor_yaml
from axialnav.replay.readers.tables import gps_of, layout_of, sensor_table, truth_of
from axialnav.replay.readers.units import check_imu_units

TRUTH_FOLDER = "state_groundtruth_estimate0"
_NUMBER = re.compile(r"(\d+)")


def read_flight_folder(path: Path) -> Flight:
    """Read a flight; ``path`` is its folder, or the ``mav0`` in it.

    Raises
    ------
    FlightError
        No flight there, a file that cannot be understood, or no IMU samples, camera frames or attitudes in it.
    """
    try:
        return _read(*_locate(path))
    except FlightError as error:
        raise FlightError(one_line(str(error))) from None
    except OSError as error:
        raise FlightError(f"{path}: cannot be read: {error.strerror or error}") from None


def _read(root: Path, mav0: Path) -> Flight:
    drops = DropLog()
    toml = read_flight_toml(root / "flight.toml")
    specs, tables, gps = _read_sensors(mav0, drops)
    truth = _read_truth(mav0 / TRUTH_FOLDER, drops)
    driving = (name for name, spec in specs.items() if isinstance(spec, Imu | Camera | AttitudeSource))
    if not any(len(tables[name]) for name in driving if name in tables):
        found = ", ".join(sorted(folder.name for folder in mav0.iterdir() if folder.is_dir())) or "nothing"
        worst = sorted(drops.as_tuple(), key=lambda drop: -drop.count)[:3]
        why = "; ".join(f"{drop.sensor}: {drop.reason} ({drop.count})" for drop in worst)
        raise FlightError(
            f"{mav0}: no usable IMU sample, camera frame or attitude (found: {found}){'; ' + why if why else ''}; "
            f"a flight needs at least imu0/data.csv, cam0/data.csv or att0/data.csv"
        )
    return _assemble(root, toml, specs, tables, truth, gps, drops)


def _locate(path: Path) -> tuple[Path, Path]:
    """Folder of the flight and its ``mav0``."""
    if not path.exists():
        raise FlightError(f"{path}: no such folder; give the folder that holds mav0/")
    if not path.is_dir():
        raise FlightError(f"{path}: is a file, must be a flight folder (one that holds mav0/)")
    if (path / "mav0").is_dir():
        return path, path / "mav0"
    if path.resolve().name == "mav0" or (path / "imu0").is_dir() or (path / "cam0").is_dir():
        return (path.resolve().parent if path.resolve().name == "mav0" else path), path
    below = sorted(inner.parent.name for inner in path.glob("*/mav0"))
    hint = f"is {path / below[0]} meant?" if below else "give the folder that holds mav0/"
    raise FlightError(f"{path}: holds no mav0/; {hint}")


def _natural(name: str) -> list[tuple[int, str]]:
    """Sort key that puts uwb10 after uwb9, and the IMU first of all."""
    parts = [(int(part), "") if part.isdigit() else (0, part) for part in _NUMBER.split(name) if part]
    return [(0 if name.startswith("imu") else 1, ""), *parts]


def _read_sensors(
    mav0: Path, drops: DropLog
) -> tuple[dict[str, AnySensor], dict[str, SensorTable], GpsReference | None]:
    """Descriptions, tables and the GPS reference of all sensor folders."""
    specs: dict[str, AnySensor] = {}
    tables: dict[str, SensorTable] = {}
    gps: GpsReference | None = None
    span_ns: tuple[int, int] | None = None
    folders = [f for f in mav0.iterdir() if f.is_dir() and f.name != TRUTH_FOLDER and not f.name.startswith(".")]
    for folder in sorted(folders, key=lambda f: _natural(f.name)):
        name = folder.name
        spec = read_sensor_yaml(folder, drops)
        if spec is None:
            continue
        specs[name] = spec
        rows = _read_sensor(folder, spec, drops, span_ns)
        if isinstance(spec, Gps):
            if gps is None:
                gps = gps_of(rows)
            else:
                drops.add(name, "a second GPS reference, not used", len(rows.t_ns), name)
            continue
        tables[name] = sensor_table(spec, rows, name, drops)
        if isinstance(spec, Imu):
            check_imu_units(rows, tables[name], name, drops)
        if isinstance(spec, Imu) and span_ns is None and len(rows.t_ns):
            span_ns = int(rows.t_ns[0]), int(rows.t_ns[-1])
    return specs, tables, gps


def _read_sensor(folder: Path, spec: AnySensor, drops: DropLog, span_ns: tuple[int, int] | None) -> Rows:
    layout, name = layout_of(spec), folder.name
    video = isinstance(spec, Camera) and any(folder.glob("video.*"))
    layout = columns.CAMERA_VIDEO if video else layout
    rows = _read_file(folder, layout, drops)
    if rows is None:
        return Rows(name, np.zeros(0, dtype=np.int64), {})
    rows = usable_rows(rows, layout, name, drops, span_ns)
    if isinstance(spec, Camera) and not video:
        rows = _with_images(folder, rows, drops)
    if not len(rows.t_ns):
        drops.add(name, "no usable row", 1, "data.csv")
    return rows


def _read_file(folder: Path, layout: columns.Layout, drops: DropLog) -> Rows | None:
    path = folder / "data.csv"
    if not path.is_file():
        drops.add(folder.name, "no data.csv", 1, f"{folder.name}/data.csv")
        return None
    return read_rows(path, layout, folder.name, drops)


def _with_images(folder: Path, rows: Rows, drops: DropLog) -> Rows:
    """Rows whose image file is there."""
    column = columns.CAMERA[0]
    if not len(rows.t_ns):
        return rows
    there = set(os.listdir(folder / "data")) if (folder / "data").is_dir() else set()
    missing = np.array([name not in there for name in rows.values[column].tolist()], dtype=np.bool_)
    if missing.any():
        drops.add(folder.name, "image file missing", int(missing.sum()), rows.example(int(missing.argmax())))
        rows = rows.subset(~missing)
    return rows


def _read_truth(folder: Path, drops: DropLog) -> Truth | None:
    if not folder.is_dir():
        return None
    rows = _read_file(folder, columns.TRUTH, drops)
    if rows is None:
        return None
    return truth_of(usable_rows(rows, columns.TRUTH, folder.name, drops), drops, folder.name)


def _assemble(
    root: Path,
    toml: FlightToml,
    specs: dict[str, AnySensor],
    tables: dict[str, SensorTable],
    truth: Truth | None,
    gps: GpsReference | None,
    drops: DropLog,
) -> Flight:
    about = {"source": toml.flight.source, "licence": toml.flight.licence, "note": toml.flight.note}
    config = Config(
        gravity_m_s2=toml.world.gravity_m_s2,
        corridor=toml.corridor,
        initial=toml.initial,
        surface=toml.surface,
        sensor=specs,
    )
    return Flight(
        name=toml.flight.name or root.resolve().name,
        path=root,
        info={key: value for key, value in about.items() if value is not None},
        config=config,
        tables=tables,
        truth=truth,
        gps=gps,
        evaluation=(toml.evaluation.start_s, toml.evaluation.end_s),
        drops=drops.as_tuple(),
    )
