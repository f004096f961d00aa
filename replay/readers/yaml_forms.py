"""How each kind of sensor is written in ``sensor.yaml``: its name, its folder, and the keys that differ from ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from axialnav.models.rig import (
    AttitudeSource,
    Barometer,
    BlurMeter,
    Camera,
    Flow,
    Gps,
    Imu,
    RangeFinder,
    Sensor,
    Uwb,
)


@dataclass(frozen=True)
class YamlForm:
    """How one kind of sensor is written in ``sensor.yaml``.

    Attributes
    ----------
    kind
        Structure that describes the sensor.
    sensor_type
        Value of ``sensor_type`` as written; ``also`` are others that are understood.
    folder
        Name of the folder without its number.
    rename
        Key in the file -> field of ``kind``, where they differ.
    quiet
        Keys of EuRoC that say nothing that the project needs.
    """

    kind: type[Sensor]
    sensor_type: str
    folder: str
    also: tuple[str, ...] = ()
    rename: Mapping[str, str] = field(default_factory=dict)
    quiet: tuple[str, ...] = ("sensor_type", "comment")


_IMU_KEYS = {
    "gyroscope_noise_density": "gyro_noise_density",
    "gyroscope_random_walk": "gyro_bias_walk",
    "accelerometer_noise_density": "accel_noise_density",
    "accelerometer_random_walk": "accel_bias_walk",
}
_FOCAL = {"intrinsics": "focal_px"}
FORMS = (
    YamlForm(Imu, "imu", "imu", rename=_IMU_KEYS),
    YamlForm(Camera, "camera", "cam"),
    YamlForm(BlurMeter, "blur", "blur", also=("blur_meter", "motion_blur"), rename=_FOCAL),
    YamlForm(Flow, "optical_flow", "flow", also=("flow",), rename=_FOCAL),
    YamlForm(RangeFinder, "range_finder", "tof", also=("tof", "range")),
    YamlForm(Uwb, "uwb", "uwb"),
    YamlForm(Barometer, "barometer", "baro", also=("height",)),
    YamlForm(AttitudeSource, "attitude", "att"),
    YamlForm(Gps, "gps", "gps"),
)
