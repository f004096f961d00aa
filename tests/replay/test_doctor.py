"""A healthy simulated flight is given one illness at a time: the doctor must name it, and nothing while it is well."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from axialnav.models.rig import IDENTITY, Imu
from axialnav.replay.cli import main
from axialnav.replay.doctor import Gravity, diagnose
from axialnav.replay.flight import Drop, Flight, SensorTable, Truth
from axialnav.replay.sample_flights import sample_flight_path
from tests.fusion.made_flights import Scene, fly

Illness = Callable[[Flight], Flight]


@functools.cache
def healthy() -> Flight:
    made = fly(Scene(seed=4, duration_s=12.0, sensors=("range0", "flow0", "uwb0", "fix0")))
    imu = msgspec.structs.replace(made.config.sensor["imu0"], gyro_noise_density=1.6e-3)
    config = msgspec.structs.replace(made.config, sensor={**made.config.sensor, "imu0": imu})
    anchors = tuple(config.sensor["uwb0"].anchors)
    tables = {
        name: SensorTable(t.t_ns, dict(t.columns), anchors if name == "uwb0" else ()) for name, t in made.tables.items()
    }
    t_ns = tables["imu0"].t_ns
    truth = Truth(t_ns, made.truth.position_m, np.tile([1.0, 0, 0, 0], (len(t_ns), 1)), made.truth.velocity_m_s)
    return Flight("healthy", Path("healthy"), {}, config, tables, truth)


def with_table(flight: Flight, name: str, table: SensorTable) -> Flight:
    return replace(flight, tables={**flight.tables, name: table})


def scaled(name: str, column: str, factor: float) -> Illness:
    def make(flight: Flight) -> Flight:
        table = flight.tables[name]
        return with_table(
            flight, name, replace(table, columns={**table.columns, column: factor * table.columns[column]})
        )

    return make


def changed(name: str, column: str, rows: slice, change: Callable[[np.ndarray], np.ndarray]) -> Illness:
    def make(flight: Flight) -> Flight:
        table = flight.tables[name]
        values = np.array(table.columns[column], dtype=float)
        values[rows] = change(values[rows])
        return with_table(flight, name, replace(table, columns={**table.columns, column: values}))

    return make


def kept(name: str, keep: Callable[[np.ndarray], np.ndarray]) -> Illness:
    """Rows chosen, repeated or left out by their numbers."""

    def make(flight: Flight) -> Flight:
        table = flight.tables[name]
        rows = keep(np.arange(len(table)))
        columns = {k: np.asarray(v)[rows] for k, v in table.columns.items()}
        return with_table(flight, name, SensorTable(table.t_ns[rows], columns, table.anchors))

    return make


def stamped(name: str, stamp: Callable[[np.ndarray], np.ndarray]) -> Illness:
    def make(flight: Flight) -> Flight:
        table = flight.tables[name]
        return with_table(flight, name, replace(table, t_ns=stamp(table.t_ns)))

    return make


def described(name: str, **fields: object) -> Illness:
    def make(flight: Flight) -> Flight:
        spec = msgspec.structs.replace(flight.config.sensor[name], **fields)
        sensor = {**flight.config.sensor, name: spec}
        return replace(flight, config=msgspec.structs.replace(flight.config, sensor=sensor))

    return make


def without(*names: str) -> Illness:
    return lambda flight: replace(flight, tables={n: t for n, t in flight.tables.items() if n not in names})


def strange_anchor(flight: Flight) -> Flight:
    return with_table(flight, "uwb0", replace(flight.tables["uwb0"], unlisted={5: ("lamp",), 9: ("lamp",)}))


def with_camera_times(flight: Flight) -> Flight:
    frames = SensorTable(flight.tables["imu0"].t_ns[:50], {"exposure_s": np.linspace(0.001, 0.004, 50)})
    return with_table(flight, "cam0", frames)


ILLNESSES: dict[str, tuple[Illness, Gravity, str, str]] = {
    "no inertial unit": (without("imu0"), Gravity.STOP, "imu0", "no inertial samples"),
    "acceleration in g": (scaled("imu0", "accel_m_s2", 1 / 9.80665), Gravity.FIX, "imu0", "looks like g"),
    "acceleration in mg": (scaled("imu0", "accel_m_s2", 1e3 / 9.80665), Gravity.FIX, "imu0", "looks like mg"),
    "rates in degrees": (scaled("imu0", "gyro_rad_s", 57.3), Gravity.FIX, "imu0", "degrees per second"),
    "ranges in millimetres": (scaled("range0", "range_m", 1e3), Gravity.FIX, "range0", "looks like millimetres"),
    "UWB in centimetres": (scaled("uwb0", "range_m", 100.0), Gravity.FIX, "uwb0", "or centimetres"),
    "clipped": (
        changed("imu0", "accel_m_s2", slice(700, 706), lambda v: v * [0, 1, 1] + [19.6, 0, 0]),
        Gravity.FIX,
        "imu0",
        "extreme of 19.6 m/s^2 for 6 samples",
    ),
    "frozen fix": (
        changed("fix0", "position_m", slice(100, 110), lambda v: np.broadcast_to(v[0], v.shape)),
        Gravity.FIX,
        "fix0",
        "10 equal readings in a row",
    ),
    "another clock": (
        stamped("uwb0", lambda t: t + 3_600_000_000_000), Gravity.FIX, "uwb0", "begins 3600.0 s after",
    ),
    "microseconds": (stamped("flow0", lambda t: t // 1000), Gravity.FIX, "flow0", "look like microseconds"),
    "lost samples": (
        kept("imu0", lambda r: r[(r < 900) | (r > 1000)]),
        Gravity.FIX,
        "imu0",
        "1 gap of more than 0.1 s, the longest 0.51",
    ),
    "silence": (kept("flow0", lambda r: r[(r < 200) | (r > 300)]), Gravity.LOOK, "flow0", "the longest 2.04 s"),
    "rows twice": (kept("uwb0", lambda r: np.sort(np.append(r, r[50:60]))), Gravity.FIX, "uwb0", "10 rows repeat"),
    "packets": (stamped("imu0", lambda t: t - t % 20_000_000), Gravity.FIX, "imu0", "share the stamp of another"),
    "wrong rate": (described("range0", rate_hz=60.0), Gravity.LOOK, "range0", "its description says 60 Hz"),
    "default noise": (
        described("imu0", gyro_noise_density=Imu().gyro_noise_density), Gravity.LOOK, "imu0", "are the defaults",
    ),
    "not mounted": (described("flow0", T_BS=IDENTITY), Gravity.LOOK, "flow0", "no mounting"),
    "strange anchor": (strange_anchor, Gravity.FIX, "uwb0", "not listed: lamp"),
    "no aids": (without("flow0", "uwb0", "fix0"), Gravity.FIX, "flight", "nothing measures the axial velocity"),
    "changing exposure": (with_camera_times, Gravity.LOOK, "cam0", "changes between 1 and 4 ms"),
    "many dropped": (
        lambda f: replace(f, drops=(Drop("flow0", "not a number", 40, "line 7"),)),
        Gravity.FIX,
        "flow0",
        "not a number",
    ),
    "no truth": (lambda f: replace(f, truth=None), Gravity.LOOK, "flight", "no reference"),
}  # fmt: skip


def test_a_healthy_flight_has_nothing_to_repair() -> None:
    assert diagnose(healthy()) == []


@pytest.mark.parametrize("name", ILLNESSES)
def test_an_illness_is_named_with_its_sensor_and_gravity(name: str) -> None:
    fall_ill, gravity, sensor, words = ILLNESSES[name]
    found = diagnose(fall_ill(healthy()))
    named = [s for s in found if s.sensor == sensor and words in f"{s.what}; {s.remedy}"]
    if name == "no inertial unit":  # named by the sensor's description
        assert found[0].gravity is Gravity.STOP
    assert [s.gravity for s in named] == [gravity], [f"{s.sensor}: {s.what}; {s.remedy}" for s in found]


def test_the_gravest_comes_first() -> None:
    flight = without("imu0")(replace(healthy(), truth=None))
    gravities = [s.gravity for s in diagnose(flight)]
    assert gravities == sorted(gravities)
    assert len(set(gravities)) > 1


def test_the_verb_prints_sensors_and_says_by_its_exit_code_how_bad_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["doctor", str(sample_flight_path())])
    said = capsys.readouterr().out
    assert code in (0, 1)
    assert "imu0" in said
    assert main(["doctor", str(sample_flight_path()), "--json"]) == code
    told = json.loads(capsys.readouterr().out)
    assert told["sensors"]["imu0"]["readings"] > 100
    worst = {symptom["gravity"] for symptom in told["symptoms"]}
    assert code == (1 if "FIX" in worst else 0)


@pytest.mark.flights
def test_the_clean_recordings_have_nothing_to_fix_and_frames_alone_stop_a_replay(
    shared: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor", str(shared / "flights" / "util_nlos_tdoa2_obs_flow_tof")]) == 0
    assert main(["doctor", str(shared / "flights" / "davis_slider_far")]) == 3
    assert "no inertial samples" in capsys.readouterr().out


def test_what_is_not_a_log_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(tmp_path)]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert main(["doctor"]) == 2
