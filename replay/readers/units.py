"""Units told by their size, for the IMU alone: what no inertial unit can read is an error or a remark."""

from __future__ import annotations

import numpy as np

from axialnav.fusion.errors import FlightError
from axialnav.replay.flight import SensorTable
from axialnav.replay.readers.csv import Rows
from axialnav.replay.readers.dropped import DropLog

SHORTEST_STEP_NS = 20_000  # 50 kHz
IN_G = (0.8, 1.25)


def check_imu_units(rows: Rows, table: SensorTable, sensor: str, drops: DropLog) -> None:
    """Stamps in nanoseconds and accelerations in m/s^2, as far as sizes tell.

    Raises
    ------
    FlightError
        The samples would have come at more than 50 kHz: the stamps are in another unit.
    """
    if len(table) < 10:
        return
    step_ns = float(np.median(np.diff(table.t_ns)))
    if step_ns < SHORTEST_STEP_NS:
        raise FlightError(
            f"{rows.where}: the median step between stamps is {step_ns:g} ns, must be over {SHORTEST_STEP_NS} ns; "
            f"the stamps are in another unit (us, ms): convert them to nanoseconds"
        )
    size = float(np.median(np.linalg.norm(table.columns["accel_m_s2"], axis=1)))
    if IN_G[0] < size < IN_G[1]:
        drops.add(sensor, "accelerations look like g, not m/s^2: kept as they are", len(table), f"median {size:.3f}")
