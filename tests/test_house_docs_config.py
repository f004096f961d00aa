"""The configuration page lists every key of every table with its default, and no key that does not exist."""

from __future__ import annotations

import re
from typing import Any

import msgspec
import pytest

from axialnav.fusion import config as tables
from axialnav.fusion.strict_toml import dump
from axialnav.models import rig
from tests.house import ROOT

PAGE = (ROOT / "docs" / "filter" / "configuration.md").read_text(encoding="utf-8")
SENSORS = (rig.Imu, rig.Camera, rig.BlurMeter, rig.Flow, rig.RangeFinder, rig.Uwb, rig.Barometer, rig.AttitudeSource)
SETTINGS = {
    field.name: type(field.default)
    for field in msgspec.structs.fields(tables.Config)
    if isinstance(field.default, msgspec.Struct)
}
HOLDERS = {"corridor", "initial", "surface", "sensor"}  # keys of Config that have sections of their own
Row = tuple[str, str, str]


def sections() -> dict[str, list[Row]]:
    """Heading -> (key, default, unit) of each row below it."""
    found = {}
    for heading, body in re.findall(r"^##+ `(.*?)`.*?\n(.*?)(?=^##|\Z)", PAGE, re.MULTILINE | re.DOTALL):
        rows = re.findall(r"^\| `(.+?)` \| (.+?) \| (.*?) \| .+ \|$", body, re.MULTILINE)
        found[heading] = [(key, default.strip("`*"), unit) for key, default, unit in rows]
    return found


def written(value: Any) -> str:
    """A default as TOML would write it."""
    if value == rig.IDENTITY:
        return "identity"
    if value == {}:
        return "{}"
    return dump({"value": msgspec.to_builtins(value)}).removeprefix("value = ").strip()


def expected(struct: type[msgspec.Struct], skip: set[str] = frozenset()) -> dict[str, str]:  # type: ignore[assignment]
    """Dotted key -> default of everything in a table, tables within it included."""
    keys = {}
    for field in msgspec.structs.fields(struct):
        default = field.default
        if default is msgspec.NODEFAULT and field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        if field.name in skip:
            continue
        if isinstance(default, msgspec.Struct):
            keys |= {f"{field.name}.{key}": text for key, text in expected(type(default)).items()}
            for inner in msgspec.structs.fields(default):  # the default of the table, not of its type
                keys[f"{field.name}.{inner.name}"] = written(getattr(default, inner.name))
        elif default is msgspec.NODEFAULT:
            keys[field.name] = "required"
        else:
            keys[field.name] = "none" if default is None else written(default)
    return keys


COMMON = set(rig.Sensor.__struct_fields__)
TABLES = {
    "top of the file": expected(tables.Config, HOLDERS | set(SETTINGS)),
    "[corridor]": expected(tables.Corridor, {"section"}),
    "[[corridor.section]]": expected(tables.Section),
    "[initial]": expected(tables.Initial),
    "[surface.NAME]": expected(rig.Surface),
    "[[surface.NAME.face]]": expected(rig.Face),
    "[sensor.NAME]": expected(rig.Sensor),
    **{f"[{name}]": expected(struct) for name, struct in SETTINGS.items()},
    **{f'kind = "{kind.__struct_config__.tag}"': expected(kind, COMMON) for kind in SENSORS},
}


def test_every_table_has_a_section() -> None:
    assert sorted(sections()) == sorted(TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_every_key_and_its_default_are_on_the_page(name: str) -> None:
    assert {key: default for key, default, _ in sections()[name]} == TABLES[name]


def test_every_number_has_a_unit() -> None:
    bare = [f"{name} {key}" for name, rows in sections().items() for key, _, unit in rows if not unit.strip()]
    assert bare == []


def test_a_wrong_default_would_be_noticed() -> None:
    """The comparison is of text, so it has to see what it compares."""
    assert TABLES["[uwb]"]["gate.soft_sigma"] == written(tables.UwbTuning().gate.soft_sigma) == "2.2"
    assert TABLES["[flow]"]["gate.soft_sigma"] == "3.0"
    assert TABLES["[initial]"]["position_m"] == "required"
    assert sum(len(keys) for keys in TABLES.values()) > 70
