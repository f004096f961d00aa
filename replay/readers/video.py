"""A video with the stamps of its frames in a CSV, and further CSVs for the other sensors."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.estimators.errors import FrameError
from axialnav.estimators.pictures import read_video, video_shape
from axialnav.fusion.errors import FlightError
from axialnav.models.rig import Camera
from axialnav.replay.flight import Flight
from axialnav.replay.readers.assemble import Assembly
from axialnav.replay.readers.cells import split_fields
from axialnav.replay.readers.detect import VIDEO_SUFFIXES
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.mapping import Mapping, load_mapping
from axialnav.replay.readers.streams import Stream

VIDEO = "video"
_UNIT = re.compile(r"\s*\[[^\]]*\]\s*$")


def read_video_log(path: Path, mapping: Path | None) -> Flight:
    """Read a video file, or the folder that holds one; streams are ``video`` and the names of the CSV files.

    The CSV beside the video that has its name (or is the only one, or is called ``frames.csv``) holds one row a frame:
    its stamp [ns] first, then optionally ``exposure``.  Without it the frames follow each other at the video's rate.

    Raises
    ------
    FlightError
        The video cannot be opened, or a CSV cannot be read.
    """
    video = path if path.is_file() else _only_video(path)
    found, asked = load_mapping(path, mapping, "video")
    drops = DropLog()
    try:
        width, height, count, rate_hz = video_shape(video)
    except FrameError as error:
        raise FlightError(str(error)) from None
    tables = {file.stem: file for file in sorted(video.parent.glob("*.csv"))}
    frames = _frames_table(video, tables)
    streams = [_csv_stream(name, file, drops) for name, file in tables.items()]
    stamps = next((s for s in streams if s.name == frames), None)
    if stamps is None:
        t_ns = np.rint(np.arange(count) * 1e9 / rate_hz).astype(np.int64)
        drops.add(VIDEO, f"no CSV with stamps: taken at {rate_hz:g} Hz, the video's own rate", count, video.name)
        stamps = Stream(VIDEO, VIDEO, t_ns)
    elif len(stamps.t_ns) != count:
        text = f"{count} frames, {len(stamps.t_ns)} stamps"
        drops.add(
            VIDEO, "frames and stamps differ in number: the surplus is left out", abs(count - len(stamps.t_ns)), text
        )
    stamps = stamps.take(np.arange(len(stamps.t_ns)) < count)
    pictures = Stream(VIDEO, VIDEO, stamps.t_ns, _exposure(stamps), lambda: _pictures(video, len(stamps.t_ns)))
    found = _with_camera(found, width, height, drops)
    return Assembly(path, [pictures, *streams], found, asked, drops).flight()


def _only_video(folder: Path) -> Path:
    videos = sorted(file for file in folder.iterdir() if file.suffix.lower() in VIDEO_SUFFIXES)
    if len(videos) != 1:
        names = ", ".join(file.name for file in videos)
        raise FlightError(f"{folder}: holds {len(videos)} videos ({names}), must be one; give the file itself")
    return videos[0]


def _frames_table(video: Path, tables: dict[str, Path]) -> str | None:
    if video.stem in tables:
        return video.stem
    if "frames" in tables:
        return "frames"
    return next(iter(tables)) if len(tables) == 1 else None


def _csv_stream(name: str, file: Path, drops: DropLog) -> Stream:
    """Columns of a CSV by the names of its header; the first is the stamp [ns]."""
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FlightError(f"{file}: cannot be read: {error}") from None
    header = next((line for line in lines if line.strip()), "").lstrip("# ")
    names = [_UNIT.sub("", part.strip()) for part in header.split(",")]
    rows: list[tuple[int, list[float]]] = []
    bad = 0
    for line in lines[1:]:
        cells = split_fields(line)
        try:
            rows.append((int(cells[0]), [float(cell) if cell else np.nan for cell in cells[1 : len(names)]]))
        except (ValueError, IndexError):
            bad += bool(line.strip())
    drops.add(file.name, "row is not numbers: left out", bad, file.name)
    whole = [row for row in rows if len(row[1]) == len(names) - 1]
    drops.add(file.name, "row too short: left out", len(rows) - len(whole), file.name)
    block = np.array([values for _, values in whole], dtype=np.float64).reshape(len(whole), len(names) - 1)
    stamps = np.array([stamp for stamp, _ in whole], dtype=np.int64)
    return Stream(name, "csv", stamps, {column: block[:, k] for k, column in enumerate(names[1:])})


def _exposure(stamps: Stream) -> dict[str, NDArray[np.float64]]:
    return {"exposure_s": stamps.columns["exposure"]} if "exposure" in stamps.columns else {}


def _pictures(video: Path, count: int) -> Iterator[NDArray[np.generic]]:
    for _, picture in zip(range(count), read_video(video), strict=False):
        yield picture


def _with_camera(mapping: Mapping, width: int, height: int, drops: DropLog) -> Mapping:
    """The mapping with a camera for the video, where it describes none."""
    if any(isinstance(spec, Camera) for spec in mapping.sensor.values()):
        return mapping
    drops.add("cam0", "camera not described: motion in pixels alone, no fusion", 1, "[sensor.cam0] in a mapping")
    camera = Camera(resolution=(width, height), intrinsics=(float(width), float(width), width / 2, height / 2))
    return msgspec.structs.replace(mapping, sensor={**mapping.sensor, "cam0": camera})
