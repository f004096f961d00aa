r"""Axial velocity of a UAV in a featureless tunnel, with an honest uncertainty.

Sensor readings go in one door, in any order and late if they must; out comes the velocity along the corridor and its
sigma.  The same code runs in flight and in replay.

Frames
------
W  world or corridor: x along the axis, z up.          B  body: x forward, y left, z up.
S  sensor: x right, y down, z along the optical axis or the beam.
``p_W`` is a vector in W, ``R_WB`` takes body to world coordinates, ``q_WB`` is the same as a Hamilton quaternion,
scalar first, ``T_BS`` (4x4) takes sensor to body coordinates: ``p_B = R_BS p_S + t_BS``.  FRD and NED appear only where
MAVLink does.

Units
-----
SI and radians throughout.  A name that crosses a module border carries its unit (``range_m``, ``sigma_px``); time is
``t_ns``, integer nanoseconds of one monotonic clock.  White noise is given as a root spectral density.  Accelerometers
read specific force: +g on z at rest.

State
-----
Position, velocity, attitude, gyro bias, accelerometer bias, blur scale, UWB bias, wall offset.  The error state has 18
components, in this order: p 3, v 3, attitude 3 (body axes), gyro bias 3, accelerometer bias 3, then one each for blur
scale, UWB bias and wall offset.  ``axialnav.models.state`` names the slices; nothing else writes an index.

Layers
------
``models`` (what a sensor reads, given the state) <- ``estimators`` (frames to pixel motion) <- ``fusion`` (filter,
gates, facade) <- ``replay`` (recordings, scores, report, command line).  A layer imports only what stands left of it.

Start with :func:`load_flight` and :func:`replay`, or feed readings to a :class:`CorridorEstimator` yourself:

>>> import axialnav as an
>>> an.ImuSample(t_ns=0, sensor="imu0", gyro_rad_s=(0.0, 0.0, 0.0), accel_m_s2=(0.0, 0.0, 9.81)).sensor
'imu0'

Every name below is loaded at first use, so that ``import axialnav`` costs next to nothing on a companion computer.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from axialnav.estimators.estimate import MotionEstimate as MotionEstimate
    from axialnav.estimators.estimate import MotionEstimator as MotionEstimator
    from axialnav.estimators.estimate import estimate_motion as estimate_motion
    from axialnav.fusion.axial_estimator import AxialEstimator as AxialEstimator
    from axialnav.fusion.config import Config as Config
    from axialnav.fusion.corridor import CorridorEstimator as CorridorEstimator
    from axialnav.fusion.errors import AxialnavError as AxialnavError
    from axialnav.fusion.errors import ConfigError as ConfigError
    from axialnav.fusion.errors import FlightError as FlightError
    from axialnav.fusion.errors import ReadingError as ReadingError
    from axialnav.fusion.outcome import AxialState as AxialState
    from axialnav.fusion.outcome import Health as Health
    from axialnav.fusion.outcome import Outcome as Outcome
    from axialnav.fusion.outcome import Reason as Reason
    from axialnav.fusion.outcome import Verdict as Verdict
    from axialnav.fusion.readings import Attitude as Attitude
    from axialnav.fusion.readings import BlurLength as BlurLength
    from axialnav.fusion.readings import CameraFrame as CameraFrame
    from axialnav.fusion.readings import Height as Height
    from axialnav.fusion.readings import ImuSample as ImuSample
    from axialnav.fusion.readings import PixelMotion as PixelMotion
    from axialnav.fusion.readings import UwbFix as UwbFix
    from axialnav.fusion.readings import UwbRange as UwbRange
    from axialnav.fusion.readings import UwbTdoa as UwbTdoa
    from axialnav.fusion.readings import WallRange as WallRange
    from axialnav.replay.flight import Flight as Flight
    from axialnav.replay.flight import load_flight as load_flight
    from axialnav.replay.run import Run as Run
    from axialnav.replay.run import replay as replay

    __version__: str

_HOME = {
    "axialnav.estimators.estimate": ("MotionEstimate", "MotionEstimator", "estimate_motion"),
    "axialnav.fusion.axial_estimator": ("AxialEstimator",),
    "axialnav.fusion.config": ("Config",),
    "axialnav.fusion.corridor": ("CorridorEstimator",),
    "axialnav.fusion.errors": ("AxialnavError", "ConfigError", "FlightError", "ReadingError"),
    "axialnav.fusion.outcome": ("AxialState", "Health", "Outcome", "Reason", "Verdict"),
    "axialnav.fusion.readings": (
        "Attitude",
        "BlurLength",
        "CameraFrame",
        "Height",
        "ImuSample",
        "PixelMotion",
        "UwbFix",
        "UwbRange",
        "UwbTdoa",
        "WallRange",
    ),
    "axialnav.replay.flight": ("Flight", "load_flight"),
    "axialnav.replay.run": ("Run",),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = ["__version__", "replay", *_MODULE_OF]


def __getattr__(name: str) -> Any:
    """Load a public name at first use (PEP 562)."""
    if name == "replay":
        # The layer of that name is a module that can be called; see its docstring.
        return importlib.import_module("axialnav.replay")
    if name == "__version__":
        value: Any = _version()
    elif name in _MODULE_OF:
        value = getattr(importlib.import_module(_MODULE_OF[name]), name)
    else:
        raise AttributeError(f"module 'axialnav' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Version of the installed distribution; a checkout that was never installed has none."""
    from importlib import metadata

    try:
        return metadata.version("axialnav")
    except metadata.PackageNotFoundError:
        return "0+not-installed"
