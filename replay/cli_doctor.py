"""The verb ``doctor``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from axialnav.replay.cli_output import emit

if TYPE_CHECKING:
    from axialnav.replay.doctor import Symptom
    from axialnav.replay.flight import Flight

Flag = Annotated[bool, Parameter(negative=())]


def doctor(log: Path, /, *, json: Flag = False, mapping: Path | None = None) -> int:
    """Look at a recording: what is in it, what is wrong with it, and what to repair first.

    Exit code 0: nothing, or only remarks. 1: something would spoil a replay. 3: no replay is possible.

    Parameters
    ----------
    log
        Flight folder, or any log that `replay` takes.
    json
        Print JSON instead of the tables.
    mapping
        TOML file that says which topics and fields of the log are which sensor.
    """
    from axialnav.replay.doctor import Gravity, diagnose
    from axialnav.replay.flight import load_flight

    flight = load_flight(log, mapping=mapping)
    symptoms = diagnose(flight)
    emit(_as_json(flight, symptoms) if json else "\n".join(_as_table(flight, symptoms)))
    worst = min((symptom.gravity for symptom in symptoms), default=Gravity.LOOK)
    return {Gravity.STOP: 3, Gravity.FIX: 1, Gravity.LOOK: 0}[worst]


def _as_json(flight: Flight, symptoms: list[Symptom]) -> str:
    from dataclasses import asdict

    from axialnav.replay.run_folder import metrics_text

    found = [{**asdict(symptom), "gravity": symptom.gravity.name} for symptom in symptoms]
    sensors = {
        row[0]: dict(zip(("kind", "readings", "rate_hz", "gaps", "longest_s"), row[1:], strict=True))
        for row in _sensors(flight)
    }
    return metrics_text({"flight": flight.name, "sensors": sensors, "symptoms": found}).rstrip("\n")


def _sensors(flight: Flight) -> list[tuple[str, str, int, float | None, int, float]]:
    from axialnav.replay.doctor.timing import the_imu
    from axialnav.replay.rates import sensor_rates

    imu = the_imu(flight)
    rows = []
    for rate in sensor_rates(flight, int(imu.t_ns[0]) if imu is not None else 0):
        spec = flight.config.sensor.get(rate.name)
        kind = str(spec.__struct_config__.tag) if spec is not None else "not described"
        rows.append((rate.name, kind, rate.count, rate.rate_hz, rate.gaps, rate.longest_s))
    return rows


def _as_table(flight: Flight, symptoms: list[Symptom]) -> list[str]:
    from axialnav.replay.table import aligned

    rows = [["sensor", "kind", "readings", "rate [Hz]", "gaps", "longest [s]"]]
    for name, kind, count, rate_hz, gaps, longest_s in _sensors(flight):
        rows.append(
            [name, kind, str(count), "-" if rate_hz is None else f"{rate_hz:.1f}", str(gaps), f"{longest_s:.2f}"]
        )
    lines = [f"flight  {flight.name}", "", *aligned(rows, left=(0, 1)), ""]
    if not symptoms:
        return [*lines, "nothing to repair"]
    for number, symptom in enumerate(symptoms, 1):
        lines.append(f"{number:2d}. {symptom.gravity.name:4}  {symptom.sensor}: {symptom.what}")
        lines.append(f"          {symptom.remedy}")
    counts = {g: sum(s.gravity is g for s in symptoms) for g in type(symptoms[0].gravity)}
    return [*lines, "", "   ".join(f"{g.name} {count}" for g, count in counts.items())]
