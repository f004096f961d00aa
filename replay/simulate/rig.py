"""What is mounted on the simulated vehicle, and where."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.models.rig import AnySensor, AttitudeSource, Barometer, Camera, RangeFinder, Transform, Uwb, Vector3
from axialnav.replay.simulate.mission import Mission
from axialnav.replay.simulate.sensors.aiding import ATTITUDE_HZ, BARO_HZ, barometer_sigma_m, tilt_sigma_rad
from axialnav.replay.simulate.sensors.imu import ImuSheet
from axialnav.replay.simulate.sensors.tof import TofSheet

Array = NDArray[np.float64]
LEFT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # columns: image right, image down, optical axis
RIGHT = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CAMERA_M = {"left": (0.05, 0.06, 0.0), "right": (0.05, -0.06, 0.0)}
BEAM_M = {"left": (-0.03, 0.06, 0.02), "right": (-0.03, -0.06, 0.02)}
BELOW_M = (0.0, 0.0, -0.05)
ANTENNA_M = (0.0, 0.0, 0.10)
TAKE_OFF_ANCHORS = ((-1.5, 0.9, 0.3), (-1.5, -0.9, 2.5), (1.5, 0.9, 2.5), (1.5, -0.9, 0.3))


def transform(rotation: Array, lever_m: Vector3) -> Transform:
    """Row-major 4x4 ``T_BS`` of a rotation (3, 3) and a lever arm [m]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, lever_m
    return tuple(matrix.ravel().tolist())


def side_axes(side: str) -> Array:
    """Rotation from a sensor that looks to one side to the body, shape (3, 3)."""
    return LEFT if side == "left" else RIGHT


def build_rig(
    mission: Mission, imu: ImuSheet, tof: TofSheet, frames: bool, rng: np.random.Generator
) -> dict[str, AnySensor]:
    """Descriptions of all sensors of a mission by name, as on their data sheets; ``rng`` draws calibration errors."""
    side = mission.camera.side
    rig: dict[str, AnySensor] = {
        "imu0": imu.spec(mission.vehicle.vibration_m_s2),
        "tof0": _range_finder(transform(side_axes(side), BEAM_M[side]), "wall", tof),
        "tof1": _range_finder(transform(DOWN, BELOW_M), "floor", tof),
        "baro0": Barometer(rate_hz=BARO_HZ, sigma_m=barometer_sigma_m("baro_doors" in mission.faults)),
        "att0": AttitudeSource(rate_hz=ATTITUDE_HZ, sigma_rad=tilt_sigma_rad("attitude_drift" in mission.faults)),
    }
    if mission.uwb.condition != "none":
        rig["uwb0"] = Uwb(
            T_BS=transform(np.eye(3), ANTENNA_M),
            rate_hz=mission.uwb.rate_hz,
            measurement=mission.uwb.measurement,
            anchors=anchors_of(mission),
            sigma_m=mission.uwb.sigma_m,
        )
    if frames:
        rig["cam0"] = camera_of(mission, 1.0 + mission.camera.focal_error * float(rng.normal()))
    return rig


def camera_of(mission: Mission, calibration: float = 1.0) -> Camera:
    """The wall camera, its focal length known to a factor of ``calibration``."""
    plan = mission.camera
    centre = 0.5 * (plan.width_px - 1), 0.5 * (plan.height_px - 1)
    return Camera(
        T_BS=transform(side_axes(plan.side), CAMERA_M[plan.side]),
        rate_hz=plan.rate_hz,
        resolution=(plan.width_px, plan.height_px),
        intrinsics=(plan.focal_px * calibration, plan.focal_px * calibration, *centre),
        exposure_s=plan.exposure_s,
        readout_s=plan.readout_s,
        surface="wall",
    )


def anchors_of(mission: Mission) -> dict[str, Vector3]:
    """Anchors of a mission, four around take-off if it names none."""
    if mission.uwb.anchors:
        return dict(mission.uwb.anchors)
    half = 0.5 * mission.section[0].width_m
    return {f"a{k}": (x, y / 1.2 * half, z) for k, (x, y, z) in enumerate(TAKE_OFF_ANCHORS)}


def _range_finder(T_BS: Transform, surface: str, sheet: TofSheet) -> RangeFinder:
    return RangeFinder(
        T_BS=T_BS,
        rate_hz=sheet.rate_hz,
        surface=surface,
        range_min_m=sheet.range_min_m,
        range_max_m=sheet.range_max_m,
        sigma_m=sheet.sigma_m,
    )
