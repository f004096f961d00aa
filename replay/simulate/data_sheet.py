"""What a maker's data sheet would say of each simulated sensor, as comments in its ``sensor.yaml``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.sensors import aiding, uwb
from axialnav.replay.simulate.sensors.imu import ImuSheet
from axialnav.replay.simulate.sensors.tof import TofSheet


def append_data_sheets(folder: Path, mission: Mission, imu: ImuSheet, tof: TofSheet) -> None:
    """Add the data sheet to every ``sensor.yaml`` below ``folder``/mav0."""
    sheets: dict[str, dict[str, float | str]] = {
        "imu0": _numbers(imu) | {"vibration_m_s2": mission.vehicle.vibration_m_s2},
        "tof0": _numbers(tof),
        "tof1": _numbers(tof),
        "uwb0": _uwb(mission),
        "att0": {
            "white_noise_rad": aiding.ATTITUDE_SIGMA_RAD,
            "tilt_drift_rad": aiding.ATTITUDE_DRIFT_RAD,
            "drift_time_s": aiding.ATTITUDE_DRIFT_S,
            "yaw_drift_rad": aiding.COMPASS_RAD,
        },
        "baro0": {
            "white_noise_m": aiding.BARO_SIGMA_M,
            "drift_m": aiding.BARO_DOOR_M,
            "drift_time_s": aiding.BARO_DRIFT_S,
        },
        "cam0": _camera(mission),
    }
    for name, sheet in sheets.items():
        path = folder / "mav0" / name / "sensor.yaml"
        if path.is_file():
            with path.open("a", encoding="utf-8") as file:
                file.writelines(_lines(sheet))


def _lines(sheet: dict[str, float | str]) -> Iterator[str]:
    yield "# data sheet\n"
    for key, value in sheet.items():
        yield f"#   {key}: {value if isinstance(value, str) else format(value, '.6g')}\n"


def _numbers(sheet: ImuSheet | TofSheet) -> dict[str, float | str]:
    return {field.name: float(getattr(sheet, field.name)) for field in fields(sheet)}


def _uwb(mission: Mission) -> dict[str, float | str]:
    return {
        "white_noise_m": mission.uwb.sigma_m,
        "noise_correlation_s": uwb.CORRELATION_S,
        "condition": mission.uwb.condition,
        "reflection_median_m": uwb.BIAS_MEDIAN_M,
        "reflection_95_percent_m": uwb.BIAS_MEDIAN_M * math.exp(1.645 * uwb.BIAS_LOG_SIGMA),
        "reflection_shortest_s": uwb.EPISODE_S[0],
        "reflection_longest_s": uwb.EPISODE_S[1],
        "lost_in_sight": uwb.DROPOUT[True],
        "lost_out_of_sight": uwb.DROPOUT[False],
        "latency_s": mission.uwb.latency_s if "uwb_late" in mission.faults else 0.0,
    }


def _camera(mission: Mission) -> dict[str, float | str]:
    plan = mission.camera
    return {
        "light": plan.light,
        "flicker_hz": plan.flicker_hz,
        "flicker_depth": plan.flicker_depth,
        "pixel_pattern": plan.pixel_pattern,
        "column_pattern": plan.column_pattern,
        "vignette": plan.vignette,
        "focal_length_error": plan.focal_error,
    }
