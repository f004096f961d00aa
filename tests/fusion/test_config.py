"""Configurations: strict, helpful about typing errors, and the same after a trip through TOML."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axialnav.fusion.config import Config, Corridor, Gate, Initial, Section
from axialnav.fusion.errors import ConfigError
from axialnav.fusion.memory import build_settings
from axialnav.fusion.sources import build_sources
from axialnav.fusion.strict_toml import dump, parse
from axialnav.models.rig import Flow, Imu, RangeFinder, Surface, Uwb
from tests.fusion.made_flights import Scene, fly


def test_the_default_configuration_survives_toml() -> None:
    assert Config.from_dict(parse(Config().to_toml(), where="")) == Config()


def test_a_full_configuration_survives_toml(tmp_path: Path) -> None:
    config = msgspec.structs.replace(
        fly(Scene(duration_s=1.0, sensors=("uwb0", "flow0", "range0"))).config,
        corridor=Corridor(axis=(0.6, 0.8, 0.0), section=tuple(
            Section(kind=kind, start=(0, 0, 0), end=(1, 2, 3), width=2.5) for kind in ("straight", "corner"))),
        disabled=("uwb0",),
    )  # fmt: skip
    path = tmp_path / "config.toml"
    path.write_text(config.to_toml(), encoding="utf-8")
    assert Config.from_toml(path) == config


NUMBER = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(1e-9, 1e9)
NAME = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
POINT = st.tuples(NUMBER, NUMBER, NUMBER)


@st.composite
def configurations(draw) -> Config:
    """Configurations of every shape, names of any letters included."""
    uwb = st.builds(
        Uwb,
        measurement=st.sampled_from(["range", "tdoa", "position"]),
        anchors=st.dictionaries(NAME, POINT, max_size=3),
        sigma_m=st.none() | POSITIVE,
    )
    unit = st.sampled_from([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.8, 0.0)])
    surface = st.builds(Surface, normal=unit, offset_m=st.just("unknown") | NUMBER)
    gate = st.builds(Gate, probability=st.floats(1e-9, 1 - 1e-9), soft_sigma=POSITIVE)
    section = st.builds(Section, kind=st.just("stairs"), start=POINT, end=POINT, width=st.none() | POSITIVE)
    return Config(
        handedness=draw(st.sampled_from(["auto", "right", "left"])),
        corridor=draw(st.none() | st.builds(Corridor, axis=unit, section=st.tuples(section) | st.just(()))),
        initial=draw(st.none() | st.builds(Initial, position_m=POINT, velocity_m_s=POINT, yaw_rad=NUMBER)),
        uwb=msgspec.structs.replace(Config().uwb, sigma_m=draw(POSITIVE), gate=draw(gate)),
        disabled=tuple(draw(st.lists(NAME, max_size=2))),
        surface=draw(st.dictionaries(NAME, surface, max_size=2)),
        sensor=draw(st.dictionaries(NAME, uwb | st.builds(Imu), max_size=3)),
    )


@settings(max_examples=150, deadline=None)
@given(configurations())
def test_any_configuration_survives_toml_to_the_last_bit(config: Config) -> None:
    assert Config.from_dict(parse(config.to_toml(), where="round trip")) == config


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ({"uwb": {"sigma": 0.3}}, "unknown key `uwb.sigma`; did you mean `sigma_m`?"),
        ({"gravity": 9.8}, "unknown key `gravity`; did you mean `gravity_m_s2`?"),
        ({"uwb": {"gate": {"probabilty": 0.9}}}, "did you mean `probability`?"),
        ({"sensor": {"imu0": {"kind": "imu", "acel_noise_density": 1.0}}}, "did you mean `accel_noise_density`?"),
        ({"qqqqqq": 1}, "unknown key `qqqqqq`"),
        ({"uwb": {"sigma_m": "large"}}, "uwb.sigma_m"),
        ({"uwb": {"sigma_m": -0.1}}, "> 0.0"),
        ({"uwb": {"gate": {"probability": 1.0}}}, "< 1.0"),
        ({"gravity_m_s2": 0.0}, "> 0.0"),
        ({"delay": {"buffer_s": 60.0}}, "<= 10.0"),
        ({"corridor": {"axis": [1.0, 0.0]}}, "length 3"),
        ({"surface": {"wall": {"normal": [0.0, 0.0, 2.0]}}}, "must have length 1"),
        ({"surface": {"wall": {"normal": [0.0, 0.0, 1.0], "offset_m": "far"}}}, "offset_m"),
        ({"corridor": {"axis": [0.0, 0.0, 0.0]}}, "corridor axis must point somewhere"),
        ({"initial": {"position_m": [0.0, math.nan, 0.0]}}, "initial.position_m.1 must be a finite number"),
        ({"sensor": {"u": {"kind": "uwb", "anchors": {"a": [math.nan, 0, 0]}}}}, "sensor.u.anchors.a.0 must be"),
        ({"sensor": {"a": {"kind": "imu"}, "u": {"kind": "imu", "rate_hz": -3.0}}}, "got -3; correct it or leave it"),
        ({"sensor": {"a": {"kind": "imu"}, "u": {"kind": "imu", "rate_hz": math.inf}}}, "`sensor.u`"),
        ({"surface": {"floor": {"normal": [0, 0, 1]}, "wall": {"normal": [1, 0, 0], "offset_m": ""}}}, "surface.wall"),
        ({"handedness": "both"}, "both"),
        ({"initial": {"yaw_rad": 1.0}}, "position_m"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_in_one_line(data, complaint: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        Config.from_dict(data, where="corridor.toml")
    message = str(refusal.value)
    assert message.startswith("corridor.toml: ")
    assert complaint in message
    assert "\n" not in message


def test_a_file_that_is_not_toml_or_not_there_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("[uwb\nsigma_m = 1", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"broken\.toml: not valid TOML"):
        Config.from_toml(broken)
    with pytest.raises(ConfigError, match=r"absent\.toml: cannot be read"):
        Config.from_toml(tmp_path / "absent.toml")
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read"):
        Config.from_toml(broken)


@pytest.mark.parametrize(
    ("path", "text", "value"),
    [
        ("uwb.sigma_m", "0.4", lambda c: c.uwb.sigma_m == 0.4),
        ("uwb.gate.probability", "0.95", lambda c: c.uwb.gate.probability == 0.95),
        ("handedness", "left", lambda c: c.handedness == "left"),
        ("handedness", '"left"', lambda c: c.handedness == "left"),
        ("imu_fault.enabled", "false", lambda c: not c.imu_fault.enabled),
        ("imu_fault.trials_to_clear", "7", lambda c: c.imu_fault.trials_to_clear == 7),
        ("gravity_m_s2", "9.81", lambda c: c.gravity_m_s2 == 9.81),
        ("sensor.uwb0.kind", "uwb", None),
        ("corridor.axis", "[0.0, 1.0, 0.0]", lambda c: c.corridor.axis == (0.0, 1.0, 0.0)),
        ("initial.position_m", "[1.0, 2.0, 3.0]", lambda c: c.initial.position_m == (1.0, 2.0, 3.0)),
    ],
)  # fmt: skip
def test_single_values_can_be_replaced(path: str, text: str, value) -> None:
    if value is None:
        with pytest.raises(ConfigError, match="measurement"):
            Config().with_params({path: text})
        return
    changed = Config().with_params({path: text})
    assert value(changed)
    assert changed != Config()


@pytest.mark.parametrize(
    ("path", "text", "complaint"),
    [
        ("uwb.sigmam", "0.4", "did you mean `sigma_m`"),
        ("uwb.sigma_m", "wide", "uwb.sigma_m"),
        ("uwb.sigma_m", "-1", "> 0.0"),
        ("uwb.sigma_m", "nan", "uwb.sigma_m"),
        ("uwb", "0.4", "uwb"),
        ("uwb.sigma_m.x", "0.4", "which is a value and not a table"),
        ("", "1", "must be dotted like uwb.sigma_m"),
        ("uwb.", "1", "must be dotted"),
        (".sigma_m", "1", "must be dotted"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_refused(path: str, text: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        Config().with_params({path: text})
    assert complaint in str(refusal.value)


def test_the_axis_is_a_unit_vector_however_it_is_written() -> None:
    assert Config().axis == (1.0, 0.0, 0.0)
    assert Config(corridor=Corridor(axis=(0.0, -3.0, 4.0))).axis == (0.0, -0.6, 0.8)


def test_sensors_can_be_switched_off_by_name_only() -> None:
    config = fly(Scene(duration_s=1.0, sensors=("uwb0", "range0"))).config
    assert config.without(("uwb0",)).disabled == ("uwb0",)
    assert config.without(("uwb0",)).without(("range0", "uwb0")).disabled == ("range0", "uwb0")
    assert config.without(()) == config
    with pytest.raises(ConfigError, match="no sensor named uwb9; there are imu0, uwb0, range0"):
        config.without(("uwb9",))


def test_a_switched_off_sensor_is_not_a_source() -> None:
    config = fly(Scene(duration_s=1.0, sensors=("uwb0", "range0"))).config
    assert build_sources(config)["enabled"].tolist() == [True, True, True]
    assert build_sources(config.without(("range0",)))["enabled"].tolist() == [True, False, True]


def test_the_flight_fills_what_the_user_left_open_and_no_more() -> None:
    flight = Config(
        gravity_m_s2=9.81,
        corridor=Corridor(axis=(0.0, 1.0, 0.0)),
        initial=Initial(position_m=(1.0, 1.0, 1.0)),
        surface={"floor": Surface(normal=(0.0, 0.0, 1.0)), "wall": Surface(normal=(0.0, 1.0, 0.0))},
        sensor={"imu0": Imu(), "uwb0": Uwb(measurement="position")},
    )
    mine = Config(initial=Initial(position_m=(2.0, 2.0, 2.0)), sensor={"imu0": Imu(gyro_noise_density=0.5)})
    both = mine.with_defaults_from(flight)
    assert both.initial == mine.initial
    assert both.sensor["imu0"] == mine.sensor["imu0"]
    assert set(both.sensor) == {"imu0", "uwb0"}
    assert (both.corridor, both.surface, both.gravity_m_s2) == (flight.corridor, flight.surface, 9.81)


@pytest.mark.parametrize(
    ("sensors", "complaint"),
    [
        ({"range0": RangeFinder(surface="wall")}, "looks at surface 'wall', which is not described; surfaces: none"),
        ({"flow0": Flow(surface="sky", focal_px=(1.0, 1.0))}, "looks at surface 'sky'"),
        ({"uwb0": Uwb(measurement="range")}, "UWB range needs anchors, got none"),
        ({"uwb0": Uwb(measurement="tdoa", anchors={str(i): (0, 0, i) for i in range(65)})}, "the limit is 64"),
    ],
)
def test_a_rig_that_does_not_fit_together_is_refused(sensors, complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        build_sources(Config(sensor={"imu0": Imu(), **sensors}))


@pytest.mark.parametrize("key", ["new\nline", "tab\t", "dot.ted", 'quo"te', "", "\x7f", "a\n"])
def test_odd_names_survive_toml(key: str) -> None:
    assert parse(dump({key: 1, "table": {key: key}}), where="") == {key: 1, "table": {key: key}}


@pytest.mark.parametrize("imus", [{}, {"imu0": Imu(), "imu1": Imu()}])
def test_there_is_exactly_one_inertial_unit(imus) -> None:
    with pytest.raises(ConfigError, match=f"exactly one inertial unit, got {len(imus)}"):
        build_settings(Config(sensor=imus))


VALUE = NUMBER | st.booleans() | NAME | st.integers(-(2**60), 2**60)
TREE = st.recursive(VALUE, lambda inner: st.dictionaries(NAME, inner, max_size=3), max_leaves=6)


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(NAME, TREE, max_size=4))
def test_any_plain_tables_survive_toml(data) -> None:
    assert parse(dump(data), where="") == data


def test_floats_keep_every_bit() -> None:
    for value in (0.1, 1e-300, 1e22, 5e-324, -0.0, math.pi):
        assert math.copysign(1.0, parse(dump({"x": value}), where="")["x"]) == math.copysign(1.0, value)
        assert parse(dump({"x": value}), where="")["x"] == value
