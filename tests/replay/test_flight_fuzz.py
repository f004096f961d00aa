"""Whatever bytes stand in the files: a flight whose readings are accepted, or one FlightError line."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from axialnav.fusion.errors import FlightError
from axialnav.fusion.sources import fused_sensors
from axialnav.replay.flight import load_flight
from tests.replay.flight_texts import CAM_YAML, SENSORS, full_flight, standing_flight, write_sensor

CELLS = st.one_of(
    st.sampled_from(
        ["", " ", "nan", "inf", "-inf", "0", "-0", "1e400", "1e-400", "9", "007", "0x1F", "1_0", "1.", ".5", "#"]
    ),
    st.sampled_from(
        ["+1", "1e5", "--1", "1 2", '"1"', "\x00", "\ufeff", "٣", "²", "∞", "1,", "\r", "\v", "1e", "None", "x"]
    ),
    st.integers(-(2**63), 2**64).map(str),
    st.integers(900_000_000, 3_100_000_000).map(str),
    st.floats(allow_nan=True).map(repr),
    st.text(max_size=6),
)
LINES = st.lists(CELLS, max_size=20).map(",".join)
ENDS = st.sampled_from(["\n", "\r\n", "\r", "\n\n"])


def check(flight_folder: Path) -> None:
    """Load; where that works, take every reading and check that the tables are in order."""
    refused: str | None = None
    try:
        flight = load_flight(flight_folder)
    except FlightError as error:
        refused = str(error)
    if refused is not None:
        assert refused.isprintable(), repr(refused)
        return
    for table in flight.tables.values():
        assert np.all(np.diff(table.t_ns) >= 0)
        assert all(len(column) == len(table) for column in table.columns.values())
    fusable = sum(len(flight.tables[name]) for name in fused_sensors(flight.config) if name in flight.tables)
    assert sum(1 for _ in flight.readings()) == fusable
    assert all(drop.count > 0 and drop.reason for drop in flight.drops)


@pytest.mark.parametrize("sensor", [*SENSORS, "cam0"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(lines=st.lists(LINES, max_size=12), end=ENDS, head=st.booleans(), where=st.integers(0, 12))
def test_any_lines_among_good_ones(sensor: str, lines: list[str], end: str, head: bool, where: int) -> None:
    header, step_ms, kinds, yaml = SENSORS.get(
        sensor, ("#timestamp [ns],filename,exposure [s]", 30, "a.png 0.1", CAM_YAML)
    )
    values = ",".join("0.25" if kind in "smw" else kind for kind in kinds.split())
    good = [f"{1_000_000_000 + i * step_ms * 1_000_000},{values}" for i in range(8)]
    with tempfile.TemporaryDirectory() as folder:
        flight = standing_flight(Path(folder))
        path = write_sensor(flight, sensor, [], yaml)
        text = end.join([*([header] if head else []), *good[:where], *lines, *good[where:]])
        path.write_bytes(text.encode("utf-8", errors="surrogatepass"))
        check(flight)


@settings(max_examples=150, deadline=None)
@given(blob=st.binary(max_size=300), sensor=st.sampled_from(["imu0", "uwb1", "cam0"]))
def test_any_bytes_as_a_csv_file(blob: bytes, sensor: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        flight = standing_flight(Path(folder))
        yaml = CAM_YAML if sensor == "cam0" else SENSORS[sensor][3]
        write_sensor(flight, sensor, [], yaml).write_bytes(blob)
        check(flight)


@settings(max_examples=150, deadline=None)
@given(blob=st.binary(max_size=200) | st.text(max_size=100).map(lambda text: text.encode("utf-8", "surrogatepass")))
def test_any_bytes_as_sensor_yaml_or_flight_toml(blob: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        flight = standing_flight(Path(folder))
        (flight / "mav0" / "imu0" / "sensor.yaml").write_bytes(blob)
        check(flight)
        (flight / "mav0" / "imu0" / "sensor.yaml").write_bytes(b"")
        (flight / "flight.toml").write_bytes(blob)
        check(flight)


YAML_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=20,
)


@settings(max_examples=200, deadline=None)
@given(
    key=st.sampled_from(
        ["T_BS", "anchors", "measurement", "intrinsics", "surface", "rate_hz", "sigma_m", "sensor_type", "law"]
    ),
    value=YAML_VALUES,
    sensor=st.sampled_from(["uwb0", "flow0", "blur0", "cam0", "tof0"]),
)
def test_any_value_in_sensor_yaml(key: str, value: object, sensor: str) -> None:
    import yaml

    base = CAM_YAML if sensor == "cam0" else SENSORS[sensor][3]
    data = {**yaml.safe_load(str(base)), key: value}
    with tempfile.TemporaryDirectory() as folder:
        flight = standing_flight(Path(folder))
        write_sensor(flight, sensor, ["1100000000,0.5,0.5,0.5,0.5,0.5,0.5"], yaml.safe_dump(data, allow_unicode=True))
        check(flight)


def test_a_file_cut_off_anywhere_still_loads(tmp_path: Path) -> None:
    flight = full_flight(tmp_path)
    for name in SENSORS:
        path = flight / "mav0" / name / "data.csv"
        whole = path.read_bytes()
        for length in np.random.default_rng(5).integers(0, len(whole), 5).tolist():
            path.write_bytes(whole[:length])
            with contextlib.suppress(FlightError):
                check(flight)
        path.write_bytes(whole)
    assert load_flight(flight).drops == ()
