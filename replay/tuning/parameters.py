"""What can be tuned: a setting by name, its start, its bounds and the scale on which it is searched."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.events import Table
from axialnav.fusion.sources import Kind, kind_of
from axialnav.models.rig import AnySensor, Flow, Uwb

LEVER_FIELDS = {"lever_x_m": 3, "lever_y_m": 7, "lever_z_m": 11}
DELAY = "delay.late_s."
FACTOR = 100.0
DELAY_BOUND_S, DELAY_SCALE_S = 0.6, 0.2
LEVER_BOUND_M, LEVER_SCALE_M = 0.5, 0.05
OTHER_SCALE = 0.1


@dataclass(frozen=True)
class Parameter:
    """One setting.

    Positive ones are searched as logarithms (equal steps are equal factors), those that can be negative on their own
    scale.  The search coordinate of the start is 0.

    Attributes
    ----------
    name
        Dotted name as for ``--param``; ``sensor.NAME.lever_x_m`` (y, z) is a part of the sensor's ``T_BS`` and
        ``delay.late_s.NAME`` the error of its stamps.
    start, low, high
        First value and bounds.
    scale
        Unit of the search coordinate; 0 for logarithms.
    """

    name: str
    start: float
    low: float
    high: float
    scale: float = 0.0

    @property
    def is_log(self) -> bool:
        """Whether the search is over the logarithm."""
        return self.scale == 0.0

    def value(self, coordinate: float) -> float:
        """Value at a search coordinate."""
        if self.is_log:
            return self.start * math.exp(coordinate)
        return self.start + self.scale * coordinate

    def coordinate(self, value: float) -> float:
        """Search coordinate of a value."""
        return math.log(value / self.start) if self.is_log else (value - self.start) / self.scale

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of the search coordinate."""
        return self.coordinate(self.low), self.coordinate(self.high)


def apply(config: Config, values: Mapping[str, float]) -> Config:
    """Copy of a resolved configuration with the named settings replaced."""
    texts: dict[str, str] = {}
    moved: dict[str, list[float]] = {}
    for name, value in values.items():
        sensor, _, part = name.removeprefix("sensor.").rpartition(".")
        if part in LEVER_FIELDS:
            pose = moved.setdefault(sensor, list(_sensor(config, sensor, name).T_BS))
            pose[LEVER_FIELDS[part]] = value
        else:
            texts[name] = repr(float(value))
    texts |= {f"sensor.{sensor}.T_BS": repr(pose) for sensor, pose in moved.items()}
    return config.with_params(texts)


def read(config: Config, name: str) -> float:
    """Present value of a setting.

    Raises
    ------
    ConfigError
        There is no such setting, or it is not a number.
    """
    *tables, part = name.split(".")
    if tables[:1] == ["sensor"] and part in LEVER_FIELDS:
        return float(_sensor(config, ".".join(tables[1:]), name).T_BS[LEVER_FIELDS[part]])
    if tables == ["delay", "late_s"]:
        _sensor(config, part, name)
        return float(config.delay.late_s.get(part, 0.0))
    node: Any = config.to_dict()
    for key in (*tables, part):
        if not isinstance(node, dict) or key not in node:
            raise ConfigError(f"no setting named {name!r}; docs/filter/configuration.md lists them")
        node = node[key]
    if isinstance(node, bool) or not isinstance(node, int | float):
        raise ConfigError(f"{name} is {str(node)[:40]!r} and not a number that can be tuned; free another setting")
    return float(node)


def _sensor(config: Config, sensor: str, name: str) -> AnySensor:
    if sensor not in config.sensor:
        raise ConfigError(f"{name}: no sensor named {sensor}; there are {', '.join(config.sensor) or 'none'}")
    return config.sensor[sensor]


def parameter(config: Config, name: str, start: float | None = None) -> Parameter:
    """Parameter of that name, starting from the present value or from ``start``."""
    value = read(config, name) if start is None else start
    part = name.rpartition(".")[2]
    if part in LEVER_FIELDS:
        return Parameter(name, value, value - LEVER_BOUND_M, value + LEVER_BOUND_M, LEVER_SCALE_M)
    if name.startswith(DELAY):
        return Parameter(name, value, value - DELAY_BOUND_S, value + DELAY_BOUND_S, DELAY_SCALE_S)
    if value > 0.0:
        return Parameter(name, value, value / FACTOR, value * FACTOR)
    reach = 10.0 * OTHER_SCALE
    return Parameter(name, value, value - reach, value + reach, OTHER_SCALE)


def default_names(config: Config, tables: Mapping[str, Table]) -> list[str]:
    """Settings that are freed if nobody says which: the noise of what was read, accelerometer and its bias walk.

    Not that of barometers and of the autopilot's attitude: their errors drift, every reading says what the one before
    said, and the likelihood, which takes them as independent, would believe them far too much.
    """
    names = ["imu.accel_noise_scale", "imu.accel_walk_scale"]
    for sensor, spec in config.sensor.items():
        kind = kind_of(spec)
        there = sensor in tables and len(tables[sensor].t_ns) and sensor not in config.disabled
        if there and kind not in (None, Kind.IMU, Kind.HEIGHT, Kind.ATTITUDE):
            names.append(_noise_name(sensor, spec, config))
    return list(dict.fromkeys(names))


def _noise_name(sensor: str, spec: AnySensor, config: Config) -> str:
    """Setting that decides the noise of a sensor."""
    own = getattr(spec, "sigma_px" if isinstance(spec, Flow) else "sigma_m", None)
    if isinstance(spec, Uwb):
        general = {"range": "uwb.range_sigma_m", "tdoa": "uwb.sigma_m", "position": "uwb.fix_sigma_m"}[spec.measurement]
        return f"sensor.{sensor}.sigma_m" if (own or 0.0) > read(config, general) else general
    if own is not None:
        return f"sensor.{sensor}.{'sigma_px' if isinstance(spec, Flow) else 'sigma_m'}"
    return "range.sigma_m" if kind_of(spec) is Kind.RANGE else "flow.sigma_rad"


def freed(config: Config, tables: Mapping[str, Table], names: Sequence[str]) -> list[Parameter]:
    """Parameters by name, or the default ones.

    Raises
    ------
    ConfigError
        A name that is no setting, or given twice.
    """
    twice = [name for name in dict.fromkeys(names) if list(names).count(name) > 1]
    if twice:
        raise ConfigError(f"--free names {', '.join(twice)} twice; once is enough")
    return [parameter(config, name) for name in names or default_names(config, tables)]
