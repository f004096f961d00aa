"""Readings as rows of numbers: the one packing that the streaming door and the replay kernel share.

An event is (t_ns, source, values[8]).  Columns by kind:

=============  =====================================================================
IMU            gyro x y z [rad/s], accel x y z [m/s^2]
FLOW           window [s], dx, dy [px], sigma [px], quality, sigma of dy [px], coherence [px]
BLUR           window [s], length [px], sigma [px]
RANGE          range, sigma [m]
UWB_RANGE      anchor, range, sigma [m], rssi, first path [dBm]
UWB_TDOA       anchor a, anchor b, difference, sigma [m]
UWB_POSITION   x, y, z, sigma x, sigma y, sigma z [m]
HEIGHT         height, sigma [m]
ATTITUDE       roll, pitch, yaw, sigma [rad]
=============  =====================================================================

NaN stands for "not given".
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.sources import Kind, fused_sensors, kind_of

WIDTH = 8
COLUMNS: dict[Kind, tuple[str, ...]] = {
    Kind.IMU: ("gyro_rad_s", "accel_m_s2"),
    Kind.FLOW: ("window_s", "dx_px", "dy_px", "sigma_px", "quality", "sigma_dy_px", "coherence_px"),
    Kind.BLUR: ("window_s", "length_px", "sigma_px"),
    Kind.RANGE: ("range_m", "sigma_m"),
    Kind.UWB_RANGE: ("anchor", "range_m", "sigma_m", "rssi_dbm", "first_path_dbm"),
    Kind.UWB_TDOA: ("anchor_a", "anchor_b", "difference_m", "sigma_m"),
    Kind.UWB_POSITION: ("position_m", "sigma_m"),
    Kind.HEIGHT: ("height_m", "sigma_m"),
    Kind.ATTITUDE: ("roll_rad", "pitch_rad", "yaw_rad", "sigma_rad"),
}


class Table(Protocol):
    """Readings of one sensor as columns, keyed by the fields of its reading class."""

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Stamps [ns], shape (n,)."""

    @property
    def columns(self) -> Mapping[str, NDArray[np.generic]]:
        """Values, each (n,) or (n, 3); NaN or absent means not given."""


class Events(NamedTuple):
    """A sorted batch: stamps (n,), source indices (n,), values (n, 8)."""

    t_ns: NDArray[np.int64]
    source: NDArray[np.int64]
    values: NDArray[np.float64]

    def part(self, cut: slice) -> Events:
        """The events of a slice."""
        return Events(self.t_ns[cut], self.source[cut], self.values[cut])


def tie_break(values: NDArray[np.float64]) -> tuple[Any, ...]:
    """Key that orders events of equal stamp and source by their values (NaN last).

    Works on one event (8,) or on columns (8, n); makes the order of processing independent of the order of arrival.
    """
    return tuple(np.where(np.isnan(values), np.inf, values))


def late_ns(config: Config) -> dict[str, int]:
    """By how much the stamps of the named sensors are too late [ns].

    Raises
    ------
    ConfigError
        A name that no sensor has.
    """
    unknown = [name for name in config.delay.late_s if name not in config.sensor]
    if unknown:
        there = ", ".join(config.sensor) or "none"
        raise ConfigError(f"delay.late_s names {', '.join(unknown)}, which no sensor is called; there are {there}")
    return {name: round(late_s * 1e9) for name, late_s in config.delay.late_s.items()}


def pack_tables(config: Config, tables: Mapping[str, Table]) -> Events:
    """Merge the tables of all fused sensors into one batch, sorted by stamp, then source, then value."""
    stamps, sources, values, late = [], [], [], late_ns(config)
    for index, name in enumerate(fused_sensors(config)):
        if name not in tables:
            continue
        table = tables[name]
        kind = kind_of(config.sensor[name])
        assert kind is not None
        packed = _pack_columns(table, COLUMNS[kind])
        measured = np.asarray(table.t_ns, dtype=np.int64) - late.get(name, 0)
        stamps.append(measured + after_stamp_ns(kind, packed[:, 0]))
        sources.append(np.full(len(table.t_ns), index, dtype=np.int64))
        values.append(packed)
    if not stamps:
        return Events(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, WIDTH)))
    t_ns, source, value = np.concatenate(stamps), np.concatenate(sources), np.concatenate(values)
    ties = tie_break(value.T)
    order = np.lexsort((*reversed(ties), source, t_ns))
    return Events(t_ns[order], source[order], np.ascontiguousarray(value[order]))


def reading_stamps(config: Config, events: Events) -> NDArray[np.int64]:
    """Stamps of the readings [ns], shape (n,), which for pixel motion are earlier than those of their events."""
    stamps = events.t_ns.copy()
    for index, name in enumerate(fused_sensors(config)):
        kind, mine = kind_of(config.sensor[name]), events.source == index
        if kind is not None:
            stamps[mine] -= after_stamp_ns(kind, events.values[mine, 0])
    return stamps


def after_stamp_ns(kind: Kind, first_value: NDArray[np.float64]) -> NDArray[np.int64]:
    """How long after its stamp a reading is processed [ns], by its first value.

    Pixel motion is stamped in the middle of its window, but only known at its end; everything else, at once.
    """
    if kind not in {Kind.FLOW, Kind.BLUR}:
        return np.zeros(first_value.shape, dtype=np.int64)
    return np.array([half_window_ns(window_s) for window_s in first_value.tolist()], dtype=np.int64)


def half_window_ns(window_s: float) -> int:
    """Half of a window, rounded [ns]: the one place where it is, for single readings and for tables."""
    return round(0.5e9 * window_s)


def _pack_columns(table: Table, names: tuple[str, ...]) -> NDArray[np.float64]:
    packed = np.full((len(table.t_ns), WIDTH), np.nan)
    at = 0
    for name in names:
        width = 3 if name in {"gyro_rad_s", "accel_m_s2", "position_m"} else 1
        if name in table.columns:
            column = np.asarray(table.columns[name], dtype=np.float64)
            if name == "sigma_m" and column.ndim == 2:
                width = 3
            packed[:, at : at + width] = column.reshape(len(column), width)
        at += width
    return packed
