"""``sensor.yaml`` of EuRoC/ASL folders, with this project's additions, to a description of :mod:`axialnav.models.rig`.

Sensor kinds are told by ``sensor_type``, or by the folder's name where that is missing.
"""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Any

import msgspec
import yaml

from axialnav.fusion.errors import FlightError
from axialnav.models.rig import AnySensor, Camera, Uwb
from axialnav.replay.readers.dropped import DropLog
from axialnav.replay.readers.flight_toml import not_finite
from axialnav.replay.readers.yaml_forms import FORMS, YamlForm

_FIELD = re.compile(r"missing required field `(?P<field>[^`]+)`")
_DIRECTIVE = re.compile(r"\A\ufeff?%YAML[: ][^\n]*\n(---[^\n]*\n)?")
_MANY = 1_000_000


def read_sensor_yaml(folder: Path, drops: DropLog) -> AnySensor | None:
    """Describe the sensor in ``folder``; None (and a note in ``drops``) for one that cannot be used.

    Raises
    ------
    FlightError
        The file is not YAML, or a value in it is wrong.
    """
    data = _load(folder / "sensor.yaml")
    form = _form(folder.name, data)
    if form is None:
        told = f"sensor_type {data['sensor_type']}" if data and "sensor_type" in data else "no known sensor_type"
        drops.add(folder.name, "no use for this kind of sensor: folder left out", 1, told)
        return None
    if data is None:
        drops.add(folder.name, "no sensor.yaml: mounted as the body frame, default values", 1, str(folder.name))
    plain = _rename(data or {}, form, folder.name, drops)
    try:
        spec: Any = msgspec.convert(plain, form.kind, strict=False)
    except msgspec.ValidationError as error:
        lacking = _FIELD.search(str(error))
        if lacking is None:
            raise FlightError(f"{folder.name}/sensor.yaml: {_plain_words(str(error), form, plain)}") from None
        key = {v: k for k, v in form.rename.items()}.get(lacking["field"], lacking["field"])
        reason = f"sensor.yaml says no `{key}`, which sensor_type {form.sensor_type} needs: left out"
        drops.add(folder.name, reason, 1, folder.name)
        return None
    strange = not_finite(msgspec.to_builtins(spec))
    if strange is not None:
        raise FlightError(f"{folder.name}/sensor.yaml: {strange} must be a finite number; correct it or leave it out")
    return _checked(spec, folder.name, drops)


def _load(path: Path) -> dict[str, Any] | None:
    """Keys and values, all scalars as text, so that an anchor called 007 keeps its name."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise FlightError(f"{path}: cannot be read: {error}") from None
    try:
        data = yaml.load(_DIRECTIVE.sub("", text), Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        at = f" in line {mark.line + 1}" if mark is not None else ""
        raise FlightError(f"{path}: not valid YAML{at}: {getattr(error, 'problem', None) or error}") from None
    if data in (None, ""):
        return {}
    if not isinstance(data, dict) or not all(isinstance(key, str) for key in data):
        raise FlightError(f"{path}: must hold `key: value` lines, holds a {type(data).__name__}; see the flight format")
    return data


def _form(folder: str, data: dict[str, Any] | None) -> YamlForm | None:
    told = str((data or {}).get("sensor_type", "")).strip().lower()
    if told:
        return next((form for form in FORMS if told == form.sensor_type or told in form.also), None)
    name = folder.rstrip("0123456789").lower()
    return next((form for form in FORMS if name == form.folder), None)


def _rename(data: dict[str, Any], form: YamlForm, sensor: str, drops: DropLog) -> dict[str, Any]:
    """Keys of the file to fields of the structure; unknown keys are noted, with the nearest known one."""
    fields = {field.name for field in msgspec.structs.fields(form.kind)}
    known = {**{name: name for name in fields - set(form.rename.values())}, **form.rename}
    plain: dict[str, Any] = {}
    for key, value in data.items():
        if key in known:
            plain[known[key]] = value
        elif key == "camera_model" and form.kind is Camera and str(value).strip().lower() == "pinhole":
            continue  # what the project assumes anyway
        elif key not in form.quiet:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.6)
            hint = f"; is `{near[0]}` meant?" if near else ""
            drops.add(sensor, "unknown key in sensor.yaml, not used", 1, f"{key}: {value}{hint}")
    if "T_BS" in plain:
        plain["T_BS"] = _flatten(plain["T_BS"])
    if "focal_px" in plain and isinstance(plain["focal_px"], list):
        plain["focal_px"] = plain["focal_px"][:2]
    if isinstance(plain.get("anchors"), dict):
        plain["anchors"] = {anchor_name(str(name)): place for name, place in plain["anchors"].items()}
    return {key: value for key, value in plain.items() if value not in ("", "~", "null")}


def _flatten(matrix: Any) -> Any:
    """EuRoC's ``{rows, cols, data}``, a flat list, or a list of rows, to a flat list."""
    if isinstance(matrix, dict):
        matrix = matrix.get("data", matrix)
    if isinstance(matrix, list) and matrix and all(isinstance(row, list) for row in matrix):
        return [value for row in matrix for value in row]
    return matrix


def anchor_name(text: str) -> str:
    """One spelling for one anchor: ``007``, ``7`` and ``7.0`` are the same, anything else stays as it is."""
    text = text.strip()
    found = re.fullmatch(r"\+?0*(\d+)(\.0*)?", text)
    return found[1] if found else text


def _plain_words(message: str, form: YamlForm, plain: dict[str, Any]) -> str:
    """Finding of msgspec with the key as it stands in the file, and the value found there."""
    found = re.search(r"\$\.(\w+)", message)
    if found and isinstance(plain.get(found[1]), str):
        message += f"; is {plain[found[1]]!r}"
    for key, name in form.rename.items():
        message = message.replace(f"$.{name}", f"$.{key}")
    return message.replace("$.", "").replace(" - at ", ", at ")


def _checked(spec: AnySensor, sensor: str, drops: DropLog) -> AnySensor:
    if isinstance(spec, Uwb):
        for name, place in spec.anchors.items():
            if not all(abs(c) < _MANY for c in place):
                raise FlightError(
                    f"{sensor}/sensor.yaml: anchor {name} is at {place}, must be within +-{_MANY:g} m; survey it"
                )
        if not spec.anchors and spec.measurement != "position":
            drops.add(
                sensor, "sensor.yaml lists no anchors: no row can be fused until it does", 1, "anchors: {id: [x, y, z]}"
            )
    return spec
