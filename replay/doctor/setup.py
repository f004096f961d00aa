"""What is missing: the inertial unit, aids, calibration, references; and what the reader left out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from axialnav.models.rig import IDENTITY, BlurMeter, Camera, Flow, Imu, RangeFinder, Uwb
from axialnav.replay.doctor.symptom import Gravity, Symptom
from axialnav.replay.flight import Flight

EXPOSURE_CHANGE = 0.1
MANY_DROPPED = 0.01


def inertial_unit(flight: Flight) -> Iterator[Symptom]:
    """Exactly one inertial unit drives the filter."""
    units = [name for name, spec in flight.config.sensor.items() if isinstance(spec, Imu)]
    speaking = [name for name in units if len(flight.tables.get(name, ())) > 1]
    if not speaking:
        yield Symptom(
            Gravity.STOP,
            units[0] if units else "flight",
            "no inertial samples",
            "add mav0/imu0; with the autopilot's attitude alone, `replay --estimator axial` still works",
        )
    elif len(speaking) > 1:
        yield Symptom(
            Gravity.STOP,
            "flight",
            f"{len(speaking)} inertial units, the filter takes one",
            f"name the others in --without, for example --without {','.join(speaking[1:])}",
        )


def aids(flight: Flight) -> Iterator[Symptom]:
    """Something has to say how fast the vehicle is along the axis, and how far the wall is."""
    specs = {n: s for n, s in flight.config.sensor.items() if len(flight.tables.get(n, ()))}
    motion = [n for n, s in specs.items() if isinstance(s, Flow | BlurMeter) or (isinstance(s, Camera) and s.surface)]
    if not motion and not any(isinstance(s, Uwb) for s in specs.values()):
        yield Symptom(
            Gravity.FIX,
            "flight",
            "neither image motion nor UWB: nothing measures the axial velocity",
            "the velocity will drift; add flow, blur, camera frames or UWB",
        )
    for name, spec in specs.items():
        if isinstance(spec, Camera) and not spec.surface:
            yield Symptom(
                Gravity.LOOK, name, "its frames are not fused: no surface is named", "add `surface:` to its sensor.yaml"
            )


def calibration(flight: Flight) -> Iterator[Symptom]:
    """Descriptions that were left at what everybody's sensor would be."""
    for name, spec in flight.config.sensor.items():
        if isinstance(spec, Imu):
            default = Imu()
            fields = ("gyro_noise_density", "gyro_bias_walk", "accel_noise_density", "accel_bias_walk")
            if all(getattr(spec, field) == getattr(default, field) for field in fields):
                yield Symptom(
                    Gravity.LOOK,
                    name,
                    "noise densities are the defaults",
                    "measure them on a still recording with `axialnav allan`",
                )
        elif isinstance(spec, Flow | RangeFinder | BlurMeter | Camera) and spec.T_BS == IDENTITY:
            yield Symptom(
                Gravity.LOOK,
                name,
                "no mounting is given: it would look straight up from the centre",
                "write T_BS into its sensor.yaml",
            )
        elif isinstance(spec, Uwb) and spec.measurement != "position" and not spec.anchors:
            yield Symptom(Gravity.STOP, name, "no anchors are listed", "list them as id: [x, y, z] in its sensor.yaml")
        if isinstance(spec, Camera) and spec.distortion_model == "none":
            yield Symptom(
                Gravity.LOOK, name, "no lens distortion is given", "calibrate the lens, or keep to its centre"
            )
        table = flight.tables.get(name)
        if table is not None and table.unlisted:
            share = 100.0 * len(table.unlisted) / len(table)
            strange = sorted({a for names in table.unlisted.values() for a in names} - set(table.anchors))
            yield Symptom(
                Gravity.FIX,
                name,
                f"{share:.1f} % of its readings name an anchor that is not listed: {', '.join(strange[:5])}",
                "survey the anchor and add it to its sensor.yaml",
            )


def exposures(flight: Flight) -> Iterator[Symptom]:
    """Exposure times that change: a blur length is proportional to them."""
    for name, table in flight.tables.items():
        exposure = table.columns.get("exposure_s")
        if exposure is None or not np.isfinite(exposure).any():
            continue
        low, high = float(np.nanmin(exposure)), float(np.nanmax(exposure))
        if high > (1.0 + EXPOSURE_CHANGE) * low:
            yield Symptom(
                Gravity.LOOK,
                name,
                f"its exposure changes between {1e3 * low:.3g} and {1e3 * high:.3g} ms",
                "lock the exposure in flight; the frames' own values are used as recorded",
            )


def drops(flight: Flight) -> Iterator[Symptom]:
    """What the reader left out."""
    for drop in flight.drops:
        rows = len(flight.tables.get(drop.sensor, ()))
        grave = drop.count > MANY_DROPPED * max(rows, 1)
        yield Symptom(
            Gravity.FIX if grave else Gravity.LOOK,
            drop.sensor,
            f"{drop.count} left out or doubtful: {drop.reason}",
            f"look at {drop.example}",
        )


def references(flight: Flight) -> Iterator[Symptom]:
    """Without a reference a replay cannot be scored; without a first state UWB has to find it."""
    if flight.truth is None and flight.gps is None:
        yield Symptom(
            Gravity.LOOK,
            "flight",
            "no reference: a replay cannot be scored",
            "add ground truth or GPS, if there is any",
        )
    if flight.config.initial is None:
        yield Symptom(
            Gravity.LOOK,
            "flight",
            "no first position and heading are given",
            "add [initial] to flight.toml; otherwise the filter starts at the origin or where UWB says",
        )
