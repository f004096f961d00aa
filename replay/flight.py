"""A flight in memory: what is mounted, what it read, what is known to be true, and what was left out.

Tables hold numpy arrays for replay at full speed; :meth:`Flight.readings` gives the same rows as the typed readings
that a vehicle would push in flight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.readings import Reading
from axialnav.models.rig import Uwb
from axialnav.replay.inputs import InputFile, input_files

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
ANCHOR_FIELDS = ("anchor", "anchor_a", "anchor_b")


@dataclass(frozen=True)
class Drop:
    """Something in a recording that was left out, or kept with a reservation.

    Attributes
    ----------
    sensor
        Folder of the sensor, or the file concerned.
    reason
        Why; one phrase for a person.
    count
        How many rows (for files, folders and keys: how many of those).
    example
        The first case, with its line number where there is one.
    """

    sensor: str
    reason: str
    count: int
    example: str


@dataclass(frozen=True)
class SensorTable:
    """All readings of one sensor.

    Attributes
    ----------
    t_ns
        Stamps [ns], shape (n,), ascending; equal stamps keep the order of the file.
    columns
        Keyed as the fields of the reading class, first axis n; NaN stands for None.
    anchors
        UWB only: the anchor names that the index columns refer to, in the order of the sensor's description.
    unlisted
        UWB only: row -> the anchor names of that row, for rows that name an anchor outside ``anchors`` (index -1).
    """

    t_ns: Stamps
    columns: Mapping[str, NDArray[Any]]
    anchors: tuple[str, ...] = ()
    unlisted: Mapping[int, tuple[str, ...]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def is_motion(self) -> bool:
        """Whether these are displacements of the image, also where the sensor is a camera that measured on board."""
        return "dx_px" in self.columns

    def renumbered(self, anchors: tuple[str, ...]) -> SensorTable:
        """The same UWB rows with index columns that refer to another list of anchors.

        Needed where a configuration replaces the flight's own description of the sensor.
        """
        if anchors == self.anchors:
            return self
        places = {name: index for index, name in enumerate(anchors)}
        fields = [name for name in ANCHOR_FIELDS if name in self.columns]
        named = [self.anchor_names(name) for name in fields]
        index = [np.array([places.get(name, -1) for name in names], dtype=np.int64) for names in named]
        strange = np.flatnonzero(np.any([part < 0 for part in index], axis=0)) if index else np.zeros(0, dtype=np.int64)
        unlisted = {row: tuple(str(names[row]) for names in named) for row in strange.tolist()}
        columns = {**self.columns, **dict(zip(fields, index, strict=True))}
        return SensorTable(self.t_ns, columns, anchors, unlisted)

    def anchor_names(self, column: str) -> list[str]:
        """Anchor of every row by name, from the index column ``anchor``, ``anchor_a`` or ``anchor_b``."""
        fields = [name for name in ANCHOR_FIELDS if name in self.columns]
        place = fields.index(column)
        index = self.columns[column].tolist()
        return [self.anchors[i] if i >= 0 else self.unlisted[row][place] for row, i in enumerate(index)]


@dataclass(frozen=True)
class Truth:
    """Ground truth in the flight's world frame.

    Attributes
    ----------
    t_ns
        Stamps [ns], shape (n,), ascending.
    position_m, velocity_m_s
        World frame, shape (n, 3); velocities are NaN where the file has none.
    quaternion_WB
        Body to world, Hamilton, scalar first, unit within 0.01 as recorded, shape (n, 4).
    gyro_bias, accel_bias
        [rad/s] and [m/s^2], shape (n, 3), or None where absent.
    """

    t_ns: Stamps
    position_m: Array
    quaternion_WB: Array
    velocity_m_s: Array
    gyro_bias: Array | None = None
    accel_bias: Array | None = None


@dataclass(frozen=True)
class GpsReference:
    """GPS to score against; never fused.  East, north, up: position [m] and velocity [m/s], shape (n, 3)."""

    t_ns: Stamps
    position_m: Array
    velocity_m_s: Array


@dataclass(frozen=True)
class Flight:
    """One recording, ready for replay.

    Attributes
    ----------
    name, path
        Name of the flight and the folder that holds it.
    info
        ``source``, ``licence`` and ``note`` where given.
    config
        What the flight itself says of rig and world: gravity, corridor, surfaces, first state, sensors.
    tables
        Sensor name -> its readings.  A configured sensor without a usable row has an empty table.
    truth, gps
        References, or None.
    evaluation
        (start_s, end_s) of the scoring window after the first IMU sample; None = from the beginning / to the end.
    drops
        Everything that was left out or kept with a reservation, counted and named.
    frames
        Camera -> function that goes through its pictures in the order of its table, for pictures that stand inside the
        recording; other cameras have them below ``path``.
    """

    name: str
    path: Path
    info: Mapping[str, str]
    config: Config
    tables: Mapping[str, SensorTable]
    truth: Truth | None = None
    gps: GpsReference | None = None
    evaluation: tuple[float | None, float | None] = (None, None)
    drops: tuple[Drop, ...] = ()
    frames: Mapping[str, Callable[[], Iterator[NDArray[np.generic]]]] = field(default_factory=dict)

    def readings(self) -> Iterator[Reading]:
        """Typed readings of all fusable sensors in time order; ties in the fixed order of the filter."""
        from axialnav.replay.flight_readings import merge_readings

        return merge_readings(self)

    @cached_property
    def inputs(self) -> tuple[InputFile, ...]:
        """The files of the recording with their hashes; read once, when first asked for."""
        return input_files(self)

    def tables_for(self, config: Config) -> dict[str, SensorTable]:
        """Tables whose anchor columns refer to the anchors of ``config``, which may differ from the flight's own."""
        tables = dict(self.tables)
        for name, spec in config.sensor.items():
            if isinstance(spec, Uwb) and name in tables:
                tables[name] = tables[name].renumbered(tuple(spec.anchors))
        return tables

    def image_path(self, sensor: str, filename: str) -> Path:
        """Where the image ``filename`` of a camera lies."""
        return self.path / "mav0" / sensor / "data" / filename


def load_flight(path: str | Path, *, mapping: str | Path | None = None) -> Flight:
    """Read a recording of any known format, which is told by content and not by name.

    Parameters
    ----------
    path
        A flight folder (EuRoC/ASL layout) or its ``mav0``, an MCAP file, a ROS 1 or 2 bag, a MAVLink ``.tlog``, an
        ArduPilot ``.bin``, a PX4 ``.ulg``, a raw dump of a Nooploop serial line, or a folder with a video and a CSV.
    mapping
        TOML file that says which of the log's topics and fields are which sensor and how they are mounted; None: the
        file beside the log that has its name with ``.toml``, else the defaults of the format.

    Raises
    ------
    FlightError
        One line: what cannot be used, why, and the way out.  What can be left out is left out and listed in
        :attr:`Flight.drops` instead.
    """
    from axialnav.replay.readers.any_log import read_log

    return read_log(Path(path), None if mapping is None else Path(mapping))
