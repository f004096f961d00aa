"""A typed reading and its row in a table become the same numbers."""

from __future__ import annotations

import numpy as np
import pytest

from axialnav.fusion.events import pack_tables
from axialnav.fusion.packing import PACKERS, Packer
from axialnav.fusion.readings import PixelMotion, UwbRange, UwbTdoa
from axialnav.fusion.sources import Kind, fused_sensors
from tests.fusion.made_flights import Scene, Table, fly
from tests.fusion.made_readings import ORDER, readings_of

ALL = ("range0", "flow0", "uwb0", "tdoa0", "fix0", "baro0", "attitude0")


@pytest.mark.parametrize("name", ["imu0", *ALL])
def test_pushed_and_tabled_readings_are_the_same_events(name: str) -> None:
    flight = fly(Scene(seed=2, duration_s=2.0, sensors=ALL))
    events = pack_tables(flight.config, {name: flight.tables[name]})
    packer = Packer(flight.config)
    packed = [packer.pack(reading) for reading in readings_of(name, flight.tables[name])]
    assert len(packed) == len(events.t_ns) > 10
    np.testing.assert_array_equal([source for source, _ in packed], events.source)
    np.testing.assert_array_equal([values for _, values in packed], events.values)


def test_optional_values_are_packed_where_they_belong() -> None:
    flight = fly(Scene(seed=2, duration_s=1.0, sensors=ALL))
    table = Table(
        np.array([5, 6]),
        {
            "window_s": np.array([0.01, 0.02]),
            "dx_px": np.array([1.0, 2.0]),
            "dy_px": np.array([np.nan, 3.0]),
            "sigma_px": np.array([0.4, np.nan]),
            "quality": np.array([np.nan, 77.0]),
        },
    )
    events = pack_tables(flight.config, {"flow0": table})
    packer = Packer(flight.config)
    pushed = [
        PixelMotion(t_ns=5, sensor="flow0", window_s=0.01, dx_px=1.0, sigma_px=0.4),
        PixelMotion(t_ns=6, sensor="flow0", window_s=0.02, dx_px=2.0, dy_px=3.0, quality=77.0),
    ]
    np.testing.assert_array_equal([packer.pack(r)[1] for r in pushed], events.values)


def test_anchors_are_numbered_as_the_sensor_lists_them() -> None:
    flight = fly(Scene(seed=2, duration_s=1.0, sensors=ALL))
    packer = Packer(flight.config)
    row = np.array(packer.pack(UwbRange(t_ns=0, sensor="uwb0", anchor="a3", range_m=2.0, rssi_dbm=-80.0))[1])
    assert row[[0, 1, 3]].tolist() == [3, 2, -80]
    _, row = packer.pack(UwbTdoa(t_ns=0, sensor="tdoa0", anchor_a="a7", anchor_b="nobody", difference_m=0.5))
    assert row[:3] == (7.0, -1.0, 0.5)


def test_events_are_sorted_by_stamp_then_source_and_not_by_the_order_of_tables() -> None:
    flight = fly(Scene(seed=3, duration_s=2.0, sensors=ALL))
    forward = pack_tables(flight.config, flight.tables)
    backward = pack_tables(flight.config, dict(reversed(flight.tables.items())))
    for a, b in zip(forward, backward, strict=True):
        np.testing.assert_array_equal(a, b)
    keys = list(zip(forward.t_ns.tolist(), forward.source.tolist(), strict=True))
    assert keys == sorted(keys)
    assert fused_sensors(flight.config)[0] == "imu0"


def test_shuffled_rows_of_a_table_give_the_same_events() -> None:
    flight = fly(Scene(seed=3, duration_s=2.0, sensors=("uwb0",)))
    table = flight.tables["uwb0"]
    order = np.random.default_rng(1).permutation(len(table.t_ns))
    shuffled = Table(table.t_ns[order], {key: column[order] for key, column in table.columns.items()})
    for a, b in zip(
        pack_tables(flight.config, {"uwb0": table}), pack_tables(flight.config, {"uwb0": shuffled}), strict=True
    ):
        np.testing.assert_array_equal(a, b)


def test_no_tables_are_no_events() -> None:
    events = pack_tables(fly(Scene(seed=3, duration_s=1.0)).config, {})
    assert len(events.t_ns) == 0
    assert events.values.shape == (0, 8)


def test_every_kind_has_a_reading() -> None:
    assert set(PACKERS) | {Kind.UWB_RANGE, Kind.UWB_TDOA} == set(Kind)
    assert len(ORDER) == len(Kind) - 1  # blur lengths are made by hand where they are needed
