"""Sensors as the compiled kernels see them: one row per source, built from the configuration."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.chi_square import chi_square_threshold
from axialnav.fusion.config import Config, Gate
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.memory import MAX_ANCHORS
from axialnav.models.faces import FACE_WIDTH
from axialnav.models.rig import (
    MAX_FACES,
    AnySensor,
    AttitudeSource,
    Barometer,
    BlurMeter,
    Camera,
    Flow,
    Imu,
    RangeFinder,
    Surface,
    Uwb,
)

Records = NDArray[np.void]
COHERENCE_PX = 2.6  # how far parts of a picture may drift apart over a window and be seen as one; readings may know


class Kind(IntEnum):
    """Kinds of events; at equal stamps they are processed in this order."""

    IMU = 0
    RANGE = 1
    FLOW = 2
    BLUR = 3
    UWB_RANGE = 4
    UWB_TDOA = 5
    UWB_POSITION = 6
    HEIGHT = 7
    ATTITUDE = 8


SOURCE = np.dtype(
    [
        ("kind", "i8"),
        ("enabled", "?"),
        ("sigma", "f8"),
        ("white_share", "f8"),  # of the variance of a reading that states none; the rest is alike from one to the next
        ("bias_variance", "f8"),  # of a UWB path [m^2]
        ("correlation_s", "f8"),  # over which errors are alike, 0: not at all
        ("first_path", "i8"),  # number of its anchor 0 among the paths of all sources
        ("gate", "f8", 3),  # chi-square threshold for 1, 2, 3 axes
        ("soft_nis", "f8"),
        ("R_BS", "f8", (3, 3)),
        ("lever_B", "f8", 3),
        ("focal_px", "f8", 2),
        ("half_view", "f8"),  # half of a camera's picture over its focal length, 0 for what has no picture
        ("coherence_px", "f8"),  # of readings that tell none
        ("periods", "f8"),  # between the first and the last frame that a reading was measured from
        ("normal_W", "f8", 3),
        ("offset_m", "f8"),
        ("offset_is_state", "?"),
        ("faces", "f8", (MAX_FACES, FACE_WIDTH)),
        ("n_faces", "i8"),
        ("low", "f8"),
        ("high", "f8"),
        ("anchors", "f8", (MAX_ANCHORS, 3)),
        ("n_anchors", "i8"),
    ],
    align=True,
)


def kind_of(spec: AnySensor) -> Kind | None:
    """Event kind of a sensor, or None for sensors that are not fused (GPS, cameras that name no surface)."""
    match spec:
        case Uwb(measurement=measurement):
            return {"range": Kind.UWB_RANGE, "tdoa": Kind.UWB_TDOA, "position": Kind.UWB_POSITION}[measurement]
        case Imu():
            return Kind.IMU
        case RangeFinder():
            return Kind.RANGE
        case Flow() | Camera(surface=str()):
            return Kind.FLOW
        case BlurMeter(signed=signed):
            return Kind.FLOW if signed else Kind.BLUR
        case Barometer():
            return Kind.HEIGHT
        case AttitudeSource():
            return Kind.ATTITUDE
        case _:
            return None


def fused_sensors(config: Config) -> tuple[str, ...]:
    """Names of the sensors that become sources, in the fixed order that breaks ties between equal stamps."""
    kinds = {name: kind_of(spec) for name, spec in config.sensor.items()}
    return tuple(sorted((n for n, k in kinds.items() if k is not None), key=lambda n: (kinds[n] or 0, n)))


def build_sources(config: Config) -> Records:
    """Build one record per fused sensor of ``config``, in the order of :func:`fused_sensors`; shape (S,).

    Raises
    ------
    ConfigError
        A sensor refers to a surface that is not described, or UWB ranging without anchors or with too many.
    """
    names = fused_sensors(config)
    sources = np.zeros(len(names), SOURCE)
    sources["first_path"] = MAX_ANCHORS * np.arange(len(names))
    for source, name in zip(sources, names, strict=True):
        for field, value in _row(name, config.sensor[name], config).items():
            if field == "faces":
                source["faces"][: len(value)] = np.array(value, dtype=np.float64).reshape(-1, FACE_WIDTH)
                source["n_faces"] = len(value)
            elif field == "anchors":
                source["anchors"][: len(value)] = np.array(value, dtype=np.float64).reshape(-1, 3)
                source["n_anchors"] = len(value)
            else:
                source[field] = value
    return sources


def scale_sigma(config: Config) -> float:
    """How well the blur scale is known at the start [-]: as a calibrated camera's, or as a flow chip's."""
    seeing = [s for n, s in config.sensor.items() if n not in config.disabled and kind_of(s) in (Kind.FLOW, Kind.BLUR)]
    calibrated = bool(seeing) and all(isinstance(spec, Camera) for spec in seeing)
    return config.camera.scale_sigma if calibrated else config.flow.scale_sigma


def _row(name: str, spec: AnySensor, config: Config) -> dict[str, Any]:
    kind = kind_of(spec)
    assert kind is not None
    sigma, gate = _noise(spec, config)
    row: dict[str, Any] = {
        "kind": int(kind),
        "enabled": name not in config.disabled,
        "sigma": sigma,
        "white_share": _white_share(spec, config),
        "bias_variance": _bias_sigma(spec, config) ** 2,
        "correlation_s": correlation_s(spec, config),
        "gate": [chi_square_threshold(dof, gate.probability) for dof in (1, 2, 3)],
        "soft_nis": gate.soft_sigma**2,
        "R_BS": spec.rotation_BS,
        "lever_B": spec.lever_arm_m,
        "focal_px": [1.0, 1.0],
        "half_view": 0.0,
        "coherence_px": 1.0,
        "periods": 1.0,
        "normal_W": [0.0, 0.0, 1.0],
        "offset_m": 0.0,
        "offset_is_state": False,
        "low": -np.inf,
        "high": np.inf,
        "anchors": [],
    }
    if isinstance(spec, Flow | BlurMeter | RangeFinder | Camera):
        surface = _surface(name, spec.surface or "", config)
        known = surface.offset_m != "unknown"
        row |= {
            "normal_W": surface.normal,
            "offset_m": surface.offset_m if known else 0.0,
            "offset_is_state": not known,
            "faces": [(*f.normal, f.offset_m, *f.start, *f.end, f.roughness_m) for f in surface.face],
        }
    if isinstance(spec, Flow | BlurMeter):
        row |= {"focal_px": spec.focal_px, "low": config.flow.min_quality}
    if isinstance(spec, Camera):
        row |= {
            "focal_px": spec.focal_px,
            "half_view": 0.5 * spec.resolution[0] / spec.focal_px[0],
            "coherence_px": COHERENCE_PX / (config.camera.frames - 1),
            "periods": float(config.camera.frames - 1),
        }
    if isinstance(spec, RangeFinder):
        row |= {"low": spec.range_min_m, "high": spec.range_max_m}
    if isinstance(spec, Uwb):
        if spec.measurement != "position" and not spec.anchors:
            raise ConfigError(
                f"sensor.{name}: UWB {spec.measurement} needs anchors, got none; list them as {{id = [x, y, z]}}"
            )
        if len(spec.anchors) > MAX_ANCHORS:
            raise ConfigError(f"sensor.{name}: {len(spec.anchors)} anchors, the limit is {MAX_ANCHORS}; split the list")
        row["anchors"] = list(spec.anchors.values())
    return row


def _surface(sensor: str, name: str, config: Config) -> Surface:
    if name not in config.surface:
        known = ", ".join(config.surface) or "none"
        raise ConfigError(f"sensor.{sensor} looks at surface {name!r}, which is not described; surfaces: {known}")
    return config.surface[name]


def correlation_s(spec: AnySensor, config: Config) -> float:
    """Time over which the errors of a sensor are alike [s], 0 where neighbouring readings have nothing in common."""
    match spec:
        case Uwb():
            return config.uwb.correlation_time_s
        case Barometer():
            return config.height.correlation_time_s
        case AttitudeSource():
            return config.attitude.correlation_time_s
        case _:
            return 0.0


def counts_as_fewer(spec: AnySensor, config: Config) -> bool:
    """Whether neighbouring readings of a sensor err alike and no bias state takes that up."""
    return correlation_s(spec, config) > 0.0 and _bias_sigma(spec, config) == 0.0


def _white_share(spec: AnySensor, config: Config) -> float:
    told = not isinstance(spec, RangeFinder) or spec.sigma_m is not None
    return 1.0 if told else min(1.0, (config.range.white_m / config.range.sigma_m) ** 2)


def _bias_sigma(spec: AnySensor, config: Config) -> float:
    if not isinstance(spec, Uwb):
        return 0.0
    uwb = config.uwb
    return {"range": uwb.range_bias_sigma_m, "tdoa": uwb.bias_sigma_m, "position": uwb.fix_bias_sigma_m}[
        spec.measurement
    ]


def _noise(spec: AnySensor, config: Config) -> tuple[float, Gate]:
    match spec:
        case Uwb(sigma_m=claim, measurement=measurement):
            uwb = config.uwb
            floor = {"range": uwb.range_sigma_m, "tdoa": uwb.sigma_m, "position": uwb.fix_sigma_m}[measurement]
            return max(claim or 0.0, floor), uwb.gate  # receivers claim too little, never too much
        case Flow(sigma_px=sigma, focal_px=focal):
            return sigma or config.flow.sigma_rad * max(focal), config.flow.gate
        case BlurMeter(focal_px=focal) | Camera(focal_px=focal):
            return config.flow.sigma_rad * max(focal), config.flow.gate
        case RangeFinder(sigma_m=sigma):
            return sigma or config.range.sigma_m, config.range.gate
        case Barometer(sigma_m=sigma):
            return sigma or config.height.sigma_m, config.height.gate
        case AttitudeSource(sigma_rad=sigma):
            return sigma or config.attitude.sigma_rad, config.attitude.gate
        case _:
            return 1.0, Gate()
