"""Columns of every ``data.csv``: names, units and limits, in the order they are written.

The limits are those of the reading classes, so that a row that passes here is accepted by its reading.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

from axialnav.fusion.readings import MAX_ACCEL_M_S2, MAX_LENGTH_M, MAX_RATE_RAD_S

LARGEST = sys.float_info.max
SMALLEST = math.ulp(0.0)


@dataclass(frozen=True)
class Column:
    """One column of a file.

    Attributes
    ----------
    target
        Field of the reading it belongs to; columns with one target are stacked to a vector.
    name
        Name in the header line as this project writes it.
    unit
        SI unit as written in brackets, empty for none.
    low, high
        Limits of a usable value, both included.
    required
        False: the column may be absent and single values may be empty, meaning None.
    text
        Kept as text (anchor names, file names).
    also
        Other names, lower case, under which the column is found.
    """

    target: str
    name: str
    unit: str = ""
    low: float = -LARGEST
    high: float = LARGEST
    required: bool = True
    text: bool = False
    also: tuple[str, ...] = ()

    @property
    def header(self) -> str:
        """Name and unit as written."""
        return f"{self.name} [{self.unit}]"

    @property
    def names(self) -> tuple[str, ...]:
        """All names, lower case, under which a header may announce the column."""
        return (self.name.lower(), *self.also)


Layout = tuple[Column, ...]


def _vector(target: str, names: str, unit: str, limit: float, also: str = "", required: bool = True) -> Layout:
    """Columns of a vector; ``names`` and ``also`` are patterns in which ``*`` stands for x, y, z."""
    other = also.split()
    return tuple(
        Column(
            target, names.replace("*", c), unit, -limit, limit, required, also=tuple(o.replace("*", c) for o in other)
        )
        for c in "xyz"
    )


def _sigma(target: str, unit: str, required: bool = False) -> Column:
    return Column(target, "sigma", unit, SMALLEST, LARGEST, required, also=(target, "std", "stddev"))


_WINDOW = Column("window_s", "window", "s", 1e-6, 10.0)
_QUALITY = Column("quality", "quality", required=False)
_SIGMA_DY = Column("sigma_dy_px", "sigma_dy", "px", SMALLEST, LARGEST, required=False)
_COHERENCE = Column("coherence_px", "coherence", "px", SMALLEST, LARGEST, required=False)

IMU = (
    *_vector("gyro_rad_s", "w_RS_S_*", "rad s^-1", MAX_RATE_RAD_S, "w* w_* gyro_* gyr_* omega_* angular_velocity_*"),
    *_vector("accel_m_s2", "a_RS_S_*", "m s^-2", MAX_ACCEL_M_S2, "a* a_* accel_* acc_* linear_acceleration_*"),
)
_EXPOSURE = Column("exposure_s", "exposure", "s", SMALLEST, 10.0, required=False)
CAMERA = (Column("filename", "filename", text=True), _EXPOSURE)
CAMERA_VIDEO = (Column("filename", "filename", required=False, text=True), _EXPOSURE)
FLOW = (
    _WINDOW,
    Column("dx_px", "dx", "px", -1e5, 1e5),
    Column("dy_px", "dy", "px", -1e5, 1e5, required=False),
    _sigma("sigma_px", "px"),
    _QUALITY,
    _SIGMA_DY,
    _COHERENCE,
)
BLUR = (_WINDOW, Column("length_px", "length", "px", 0.0, 1e5), _sigma("sigma_px", "px", required=True))
BLUR_SIGNED = (
    _WINDOW,
    Column("dx_px", "length", "px", -1e5, 1e5, also=("dx", "displacement")),
    _sigma("sigma_px", "px"),
    Column("dy_px", "dy", "px", -1e5, 1e5, required=False),
    _QUALITY,
    _SIGMA_DY,
    _COHERENCE,
)
RANGE = (Column("range_m", "range", "m", 0.0, MAX_LENGTH_M, also=("distance",)), _sigma("sigma_m", "m"))
UWB_RANGE = (
    Column("anchor", "anchor", text=True, also=("anchor_id",)),
    Column("range_m", "range", "m", 0.0, MAX_LENGTH_M, also=("distance",)),
    _sigma("sigma_m", "m"),
    Column("rssi_dbm", "rssi", "dBm", required=False),
    Column("first_path_dbm", "first_path_rssi", "dBm", required=False, also=("first_path", "fp_rssi")),
)
UWB_TDOA = (
    Column("anchor_a", "anchor_a", text=True),
    Column("anchor_b", "anchor_b", text=True),
    Column("difference_m", "difference", "m", -MAX_LENGTH_M, MAX_LENGTH_M, also=("tdoa",)),
    _sigma("sigma_m", "m"),
)
UWB_POSITION = (
    *_vector("position_m", "*", "m", MAX_LENGTH_M, "p_* position_*"),
    *(Column("sigma_m", f"sigma_{c}", "m", SMALLEST, LARGEST, required=False, also=(f"std_{c}",)) for c in "xyz"),
)
HEIGHT = (
    Column("height_m", "altitude", "m", -MAX_LENGTH_M, MAX_LENGTH_M, also=("height", "alt")),
    _sigma("sigma_m", "m"),
)
ATTITUDE = (
    Column("roll_rad", "roll", "rad", -7.0, 7.0),
    Column("pitch_rad", "pitch", "rad", -7.0, 7.0),
    Column("yaw_rad", "yaw", "rad", -7.0, 7.0),
    _sigma("sigma_rad", "rad"),
)
GPS = tuple(
    Column(target, prefix + c, unit, -limit, limit)
    for target, prefix, unit, limit in (("position_m", "", "m", 1e8), ("velocity_m_s", "v_", "m s^-1", 1e4))
    for c in ("east", "north", "up")
)
TRUTH = (
    *_vector("position_m", "p_RS_R_*", "m", 1e8, "p_* position_* *"),
    *(Column("quaternion_WB", f"q_RS_{c}", "", -1.01, 1.01, also=(f"q_{c}", f"q{c}")) for c in "wxyz"),
    *_vector("velocity_m_s", "v_RS_R_*", "m s^-1", 1e4, "v_* v*", required=False),
    *_vector("gyro_bias", "b_w_RS_S_*", "rad s^-1", MAX_RATE_RAD_S, "b_w_*", required=False),
    *_vector("accel_bias", "b_a_RS_S_*", "m s^-2", MAX_ACCEL_M_S2, "b_a_*", required=False),
)
