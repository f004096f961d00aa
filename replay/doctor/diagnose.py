"""All examinations of a recording, in the order in which their findings are to be repaired."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from axialnav.replay.doctor.setup import aids, calibration, drops, exposures, inertial_unit, references
from axialnav.replay.doctor.symptom import Symptom
from axialnav.replay.doctor.timing import clocks, gaps, repeated_stamps, stated_rates
from axialnav.replay.doctor.values import clipped, frozen, units
from axialnav.replay.flight import Flight

# what spoils everything after it comes first: without a clock or a unit the later numbers mean nothing
EXAMINATIONS: tuple[Callable[[Flight], Iterator[Symptom]], ...] = (
    inertial_unit, clocks, units, repeated_stamps, gaps, frozen, clipped, exposures, aids, drops, stated_rates,
    calibration, references,
)  # fmt: skip


def diagnose(flight: Flight) -> list[Symptom]:
    """Examine a recording; return what was found, the gravest first and then in the order of repair."""
    found = [symptom for examine in EXAMINATIONS for symptom in examine(flight)]
    return sorted(found, key=lambda symptom: symptom.gravity)
