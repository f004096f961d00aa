"""The real recordings: every row of every file is read, and the numbers are those in the file."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from axialnav.models.rig import Uwb
from axialnav.replay.flight import Flight, load_flight
from axialnav.replay.flight_writer import write_flight

TRUTH = "state_groundtruth_estimate0"
# lines of each data.csv that do not begin with #
ROWS: dict[str, dict[str, int]] = {
    "copter_px4flow_gps": {"imu0": 40520, "att0": 8107, "flow0": 8051, "tof0": 5295, "gps0": 4235},
    "davis_slider_far": {"cam0": 137, TRUTH: 137},
    "isas_walk1": {"imu0": 4839, "uwb0": 4850, "uwb1": 970, TRUTH: 6335},
    "util_base_tdoa2_circle_noobs": {"imu0": 13741, "baro0": 2749, "uwb0": 15735, TRUTH: 5597},
    "util_los_tdoa2_bolt_short": {"imu0": 12880, "flow0": 4516, "tof0": 1182, "uwb0": 22106, TRUTH: 5108},
    "util_los_tdoa2_circle": {"imu0": 8993, "baro0": 1894, "flow0": 3054, "tof0": 883, "uwb0": 15392, TRUTH: 3743},
    "util_los_tdoa3_circle_fast": {"imu0": 6941, "baro0": 1462, "flow0": 2275, "tof0": 671, "uwb0": 6390, TRUTH: 2911},
    "util_nlos_tdoa2_circle_metal": {"imu0": 13973, "uwb0": 21408, TRUTH: 5675},
    "util_nlos_tdoa2_circle_wood": {"imu0": 13802, "uwb0": 21472, TRUTH: 5602},
    "util_nlos_tdoa2_obs_flow_tof": {
        **{"imu0": 17120, "baro0": 3424, "flow0": 5962, "tof0": 1590, "uwb0": 29349},
        TRUTH: 6788,
    },
}


@pytest.fixture(scope="module", params=ROWS)
def flight(request: pytest.FixtureRequest, shared: Path) -> Flight:
    return load_flight(shared / "flights" / request.param)


def texts_of(flight: Flight, sensor: str) -> list[list[str]]:
    """Cells of a data.csv as the standard library reads them: the oracle."""
    path = flight.path / "mav0" / sensor / "data.csv"
    with path.open(encoding="utf-8") as file:
        return [row for row in csv.reader(file) if row and not row[0].startswith("#")]


@pytest.mark.flights
def test_every_row_is_read_and_nothing_is_dropped(flight: Flight) -> None:
    counts = {name: len(table) for name, table in flight.tables.items()}
    if flight.truth is not None:
        counts[TRUTH] = len(flight.truth.t_ns)
    if flight.gps is not None:
        counts["gps0"] = len(flight.gps.t_ns)
    assert counts == ROWS[flight.name]
    assert flight.drops == ()


@pytest.mark.flights
def test_values_equal_the_text_in_the_file(flight: Flight) -> None:
    for name, table in flight.tables.items():
        cells = texts_of(flight, name)
        columns = [c for c in table.columns.values() if c.dtype.kind != "f" or not np.isnan(c).all()]
        flat = [part for c in columns for part in (c.T if c.ndim == 2 else [c])]
        assert len(flat) == len(cells[0]) - 1, name
        for index, array in enumerate(flat, start=1):
            written = [row[index] for row in cells]
            if array.dtype.kind == "i":
                assert [table.anchors[i] for i in array.tolist()] == written
            elif array.dtype.kind == "U":
                assert array.tolist() == written
            else:
                assert array.tolist() == [float(text) for text in written]


@pytest.mark.flights
def test_readings_of_real_flights_are_all_accepted(flight: Flight) -> None:
    stamps = [reading.t_ns for reading in flight.readings()]
    assert len(stamps) == sum(len(table) for name, table in flight.tables.items() if name != "cam0")
    assert stamps == sorted(stamps)


@pytest.mark.flights
def test_uwb_anchors_are_all_surveyed(flight: Flight) -> None:
    for name, spec in flight.config.sensor.items():
        if isinstance(spec, Uwb) and spec.measurement != "position":
            assert len(spec.anchors) == (5 if flight.name.startswith("isas") else 8)
            assert flight.tables[name].anchors == tuple(spec.anchors)


@pytest.mark.flights
def test_a_written_copy_of_a_real_flight_is_equal(flight: Flight, tmp_path: Path) -> None:
    copy = load_flight(write_flight(flight, tmp_path / "copy"))
    assert copy.config == flight.config
    assert (copy.name, copy.info, copy.evaluation) == (flight.name, flight.info, flight.evaluation)
    for name, table in flight.tables.items():
        np.testing.assert_array_equal(copy.tables[name].t_ns, table.t_ns)
        for field, column in table.columns.items():
            np.testing.assert_array_equal(copy.tables[name].columns[field], column)


@pytest.mark.flights
def test_flow_signs_and_units_agree_with_the_motion_capture(shared: Path) -> None:
    """``du/dt = -f (v_x / Z + w_y)``, ``dv/dt = -f (v_y / Z - w_x)`` with the rates of the gyro, by least squares.

    A wrong sign, axis, unit or stamp in the reader would spoil the fit of the focal length.
    """
    flight = load_flight(shared / "flights" / "util_nlos_tdoa2_obs_flow_tof")
    flow, imu, truth = flight.tables["flow0"], flight.tables["imu0"], flight.truth
    spec = flight.config.sensor["flow0"]
    assert truth is not None
    middle = flow.t_ns

    def at_flow(t_ns: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(middle, t_ns, column) for column in values.T], axis=1)

    q = at_flow(truth.t_ns, truth.quaternion_WB)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    w, x, y, z = q.T
    rows = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    v_sensor = np.einsum("jin,nj->ni", rows, at_flow(truth.t_ns, truth.velocity_m_s)) @ spec.rotation_BS
    w_sensor = at_flow(imu.t_ns, imu.columns["gyro_rad_s"]) @ spec.rotation_BS
    height = at_flow(truth.t_ns, truth.position_m)[:, 2]
    flying = height > 0.4
    window = flow.columns["window_s"]
    for field, rate in (
        ("dx_px", -(v_sensor[:, 0] / height + w_sensor[:, 1])),
        ("dy_px", -(v_sensor[:, 1] / height - w_sensor[:, 0])),
    ):
        predicted = (rate * window)[flying]
        measured = flow.columns[field][flying]
        focal_px = float(predicted @ measured / (predicted @ predicted))
        assert 0.9 < focal_px / 419.0 < 1.1, (field, focal_px)
