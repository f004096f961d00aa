"""Calibration of a flight's sensors: scale and line of image motion, offset of ranges, delays of stamps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.rehearsal import Rehearsal
from axialnav.models.rig import BlurMeter, Camera, Flow, RangeFinder
from axialnav.replay.calibration.delays import Delay, find_delays
from axialnav.replay.calibration.line import Line, fit_line
from axialnav.replay.calibration.path import beam_length, image_rates, path_at
from axialnav.replay.flight import Flight, SensorTable
from axialnav.replay.frames import with_pixel_motion
from axialnav.replay.run import resolve
from axialnav.replay.tuning.cost import Subject

Array = NDArray[np.float64]
SIGNIFICANT = 2.0
PixelSensor = Flow | BlurMeter | Camera


@dataclass(frozen=True)
class ImageScale:
    """Image motion of one sensor against the path.

    Attributes
    ----------
    sensor, against
        Which sensor, and what the path comes from.
    scale
        Measured over expected displacement: slope 1 and intercept 0 [px] for a focal length that is right.
    focal_px, sigma_focal_px
        Focal length that makes the slope 1, and its standard error.
    paper
        The paper's line: speed across the wall [m/s] over displacement or blur length [px].
    expected_slope
        What the slope of that line should be from distance, focal length and window [m/s per px].
    """

    sensor: str
    against: str
    scale: Line
    focal_px: float
    sigma_focal_px: float
    paper: Line | None
    expected_slope: float


@dataclass(frozen=True)
class RangeOffset:
    """Range finder against the path: ``line`` is measured over expected range [m]; ``offset_m`` with the slope at 1."""

    sensor: str
    against: str
    offset_m: float
    sigma_m: float
    line: Line


@dataclass(frozen=True)
class Calibration:
    """Everything found in one flight; ``skipped`` names what could not be calibrated, and why."""

    flight: str
    images: tuple[ImageScale, ...]
    ranges: tuple[RangeOffset, ...]
    delays: tuple[Delay, ...]
    skipped: tuple[str, ...]


def calibrate(
    flight: Flight, config: Config | None = None, *, workers: int = 2, progress: Callable[[float], None] | None = None
) -> Calibration:
    """Calibrate the sensors of one flight.

    Delays are found first, and taken out before anything is compared with the path.
    """
    resolved = resolve(config, flight)
    tables = with_pixel_motion(flight, resolved, flight.tables_for(resolved))
    delays = find_delays(Subject(flight.name, resolved, Rehearsal(resolved, tables)), workers)
    if progress is not None:
        progress(0.7)
    late = {d.sensor: d.late_s for d in delays if _is_known(d)}
    timed = msgspec.structs.replace(
        resolved, delay=msgspec.structs.replace(resolved.delay, late_s={**resolved.delay.late_s, **late})
    )
    images: list[ImageScale] = []
    ranges: list[RangeOffset] = []
    skipped: list[str] = []
    for name, spec in resolved.sensor.items():
        if name not in tables or name in resolved.disabled or not len(tables[name]):
            continue
        if isinstance(spec, Flow | BlurMeter | Camera) and spec.surface is not None:
            found: Any = _image(flight, timed, tables[name], name, spec)
            (skipped if isinstance(found, str) else images).append(found)
        elif isinstance(spec, RangeFinder):
            found = _range(flight, timed, tables[name], name, spec)
            (skipped if isinstance(found, str) else ranges).append(found)
    return Calibration(flight.name, tuple(images), tuple(ranges), tuple(delays), tuple(skipped))


def _is_known(delay: Delay) -> bool:
    """Whether the shift was needed to explain the readings, and stands out of its error."""
    if delay.sigma_s is None or delay.at_edge or delay.gain_nats <= 0.0:
        return False
    return abs(delay.late_s) > SIGNIFICANT * delay.sigma_s


def _surface(config: Config, name: str) -> tuple[Array, float] | None:
    surface = config.surface.get(name)
    if surface is None or surface.offset_m == "unknown":
        return None
    return np.array(surface.normal), float(surface.offset_m)


def _stamps(config: Config, name: str, table: SensorTable) -> NDArray[np.int64]:
    return table.t_ns - round(config.delay.late_s.get(name, 0.0) * 1e9)


def _image(flight: Flight, config: Config, table: SensorTable, name: str, spec: PixelSensor) -> ImageScale | str:
    """Least squares of measured on expected displacement, both image axes together where there are two."""
    surface = _surface(config, spec.surface or "")
    if surface is None:
        return f"{name}: the place of surface {spec.surface} is unknown, so its distance is"
    path = path_at(flight, config, _stamps(config, name, table), name)
    distance = beam_length(path, spec, *surface)
    rates, speeds = image_rates(path, spec, distance)
    window = np.asarray(table.columns["window_s"], dtype=np.float64)
    expected, measured, speed = [], [], []
    unsigned = "length_px" in table.columns
    for axis, column in enumerate(("length_px",) if unsigned else ("dx_px", "dy_px")):
        if column not in table.columns:
            continue
        motion = spec.focal_px[axis] * window * rates[:, axis]
        expected.append(np.abs(motion) if unsigned else motion)
        measured.append(_good(table, column))
        speed.append(np.abs(speeds[:, axis]) if unsigned else -speeds[:, axis])
    x, y, v = (np.concatenate(parts) for parts in (expected, measured, speed))
    line = fit_line(x, y)
    if line is None or line.slope <= 0.0:
        return f"{name}: fewer than 20 readings with a known path and a spread of speeds"
    known = path.sigma_m_s / float(np.sqrt(np.nanmean(np.sum(path.velocity_m_s**2, axis=1))))
    line = replace(line, sigma_slope=float(np.hypot(line.sigma_slope, line.slope * known)))
    focal = float(spec.focal_px[0])
    slope = float(np.nanmedian(distance) / (focal * line.slope * np.nanmedian(window)))
    return ImageScale(name, path.source, line, focal * line.slope, focal * line.sigma_slope, fit_line(y, v), slope)


def _good(table: SensorTable, column: str) -> Array:
    """A column without the rows whose quality is 0."""
    values = np.array(table.columns[column], dtype=np.float64)
    quality = table.columns.get("quality")
    if quality is not None:
        values[~(np.asarray(quality, dtype=np.float64) > 0.0)] = np.nan
    return values


def _range(flight: Flight, config: Config, table: SensorTable, name: str, spec: RangeFinder) -> RangeOffset | str:
    surface = _surface(config, spec.surface)
    if surface is None:
        return f"{name}: the place of surface {spec.surface} is unknown, so its offset is"
    path = path_at(flight, config, _stamps(config, name, table), name)
    expected = beam_length(path, spec, *surface)
    measured = np.array(table.columns["range_m"], dtype=np.float64)
    measured[(measured < spec.range_min_m) | (measured > spec.range_max_m)] = np.nan
    line = fit_line(expected, measured)
    offset = fit_line(expected - np.nanmean(expected), measured - expected)
    if line is None or offset is None:
        return f"{name}: fewer than 20 readings with a known path"
    sigma_m = float(np.hypot(offset.sigma_intercept, path.sigma_m))
    return RangeOffset(name, path.source, offset.intercept, sigma_m, line)


def calibrated_config(config: Config | None, flight: Flight, found: Calibration) -> dict[str, Any]:
    """Plain data of a configuration file: delays, focal lengths and range offsets that stand out of their errors.

    A range offset becomes a shift of the sensor along its beam, which reads the same.
    """
    resolved = resolve(config, flight).to_dict()
    out: dict[str, Any] = {}
    late = {d.sensor: round(d.late_s, 4) for d in found.delays if _is_known(d)}
    if late:
        out["delay"] = {"late_s": late}
    sensors: dict[str, Any] = {}
    for image in found.images:
        if abs(image.scale.slope - 1.0) > SIGNIFICANT * image.scale.sigma_slope:
            sensors[image.sensor] = _with_focal(resolved["sensor"][image.sensor], image.scale.slope)
    for offset in found.ranges:
        if abs(offset.offset_m) > SIGNIFICANT * offset.sigma_m:
            spec = flight.config.sensor[offset.sensor]
            pose = list(spec.T_BS)
            for axis in range(3):
                pose[4 * axis + 3] -= offset.offset_m * float(spec.rotation_BS[axis, 2])
            sensors[offset.sensor] = {**resolved["sensor"][offset.sensor], "T_BS": pose}
    if sensors:
        out["sensor"] = sensors
    return out


def _with_focal(spec: dict[str, Any], factor: float) -> dict[str, Any]:
    if "focal_px" in spec:
        return {**spec, "focal_px": [factor * value for value in spec["focal_px"]]}
    fu, fv, cu, cv = spec["intrinsics"]
    return {**spec, "intrinsics": [factor * fu, factor * fv, cu, cv]}


def merge_flights(found: Sequence[Calibration]) -> dict[str, tuple[float, float]]:
    """Weighted means over flights by name of the quantity: value and standard error."""
    values: dict[str, list[tuple[float, float]]] = {}
    for one in found:
        for image in one.images:
            values.setdefault(f"{image.sensor} focal length [px]", []).append((image.focal_px, image.sigma_focal_px))
        for offset in one.ranges:
            values.setdefault(f"{offset.sensor} offset [m]", []).append((offset.offset_m, offset.sigma_m))
        for delay in one.delays:
            if delay.sigma_s is not None:
                values.setdefault(f"{delay.sensor} delay [s]", []).append((delay.late_s, delay.sigma_s))
    return {name: _mean(pairs) for name, pairs in values.items()}


def _mean(pairs: list[tuple[float, float]]) -> tuple[float, float]:
    value, sigma = np.array(pairs).T
    weight = 1.0 / np.maximum(sigma, 1e-12) ** 2
    return float((weight * value).sum() / weight.sum()), float(1.0 / np.sqrt(weight.sum()))
