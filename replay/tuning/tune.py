"""Tuning of a filter to flights: free settings, search, standard errors, and what it bought."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config
from axialnav.fusion.errors import ConfigError, FlightError
from axialnav.fusion.rehearsal import Rehearsal
from axialnav.replay.flight import Flight
from axialnav.replay.frames import with_pixel_motion
from axialnav.replay.run import replay, resolve
from axialnav.replay.tuning.cost import Cost, Subject
from axialnav.replay.tuning.optimise import Minimum, describe
from axialnav.replay.tuning.parameters import Parameter, apply, freed
from axialnav.replay.tuning.scoring import TOLERANCE, minimise

Array = NDArray[np.float64]
COARSE_S, COARSE_TOLERANCE = 30.0, 2.0


@dataclass(frozen=True)
class Tuned:
    """One setting after tuning.

    ``sigma`` is its standard error: of the logarithm for settings that are searched so (exp(sigma) is the factor), in
    the setting's own unit otherwise; infinite where the flights do not tell.
    """

    parameter: Parameter
    value: float
    sigma: float
    at_bound: bool
    unidentifiable: bool


@dataclass(frozen=True)
class Score:
    """One flight before and after.

    ``gain_nats`` is the log-likelihood after minus before, ``readings`` how many independent readings it is about;
    ``before`` and ``after`` are metrics of the two replays.
    """

    flight: str
    held_out: bool
    gain_nats: float
    readings: float
    before: dict[str, Any]
    after: dict[str, Any]


@dataclass(frozen=True)
class Tuning:
    """Result: settings, correlation of their errors, scores of all flights, effort."""

    tuned: tuple[Tuned, ...]
    correlation: Array
    scores: tuple[Score, ...]
    evaluations: int
    search_s: float

    @property
    def values(self) -> dict[str, float]:
        """Settings by name that the flights determine; the others are left as they were."""
        return {t.parameter.name: t.value for t in self.tuned if not t.unidentifiable}


def tune(
    flights: Sequence[Flight],
    config: Config | None = None,
    *,
    free: Sequence[str] = (),
    hold_out: Sequence[Flight] = (),
    workers: int = 2,
    progress: Callable[[float], None] | None = None,
) -> Tuning:
    """Find the settings under which the innovations of the flights are most likely.

    The innovations are those that passed the gate; the others count as if they lay on it.  Every reading inside the
    gate has full weight while tuning.  Settings that the flights do not determine keep their value.

    Parameters
    ----------
    flights
        Recordings to tune on, all with the same settings.
    config
        Settings to start from; what it leaves open comes from each flight.
    free
        Dotted names of the settings to change; if empty, those of
        :func:`~axialnav.replay.tuning.parameters.default_names`.
    hold_out
        Recordings that are only scored, before and after.
    workers
        Threads; the result does not depend on their number.
    progress
        Called with the share done, 0 .. 1.

    Raises
    ------
    ConfigError
        A name that is no setting, or a sensor's own setting while the flights describe that sensor differently.
    FlightError
        A recording that cannot be replayed, or whose readings are never compared with anything.
    """
    began = time.perf_counter()
    subjects = [_subject(flight, config) for flight in flights]
    first = subjects[0]
    parameters = freed(first.config, dict(flights[0].tables), free)
    _refuse_different_sensors(parameters, flights)
    minimum, count = _search(subjects, parameters, workers, progress)
    found = minimum.at
    tuned = tuple(_tuned(p, minimum, i) for i, p in enumerate(parameters))
    result = Tuning(tuned, minimum.correlation, (), count, time.perf_counter() - began)
    keep = np.array([0.0 if t.unidentifiable else x for t, x in zip(tuned, found, strict=True)])
    scores = [
        _score(flight, _subject(flight, config) if held else subjects[i], parameters, keep, held)
        for held, group in ((False, flights), (True, hold_out))
        for i, flight in enumerate(group)
    ]
    return Tuning(result.tuned, result.correlation, tuple(scores), result.evaluations, result.search_s)


def _subject(flight: Flight, config: Config | None) -> Subject:
    resolved = resolve(config, flight)
    tables = with_pixel_motion(flight, resolved, flight.tables_for(resolved))
    return Subject(flight.name, resolved, Rehearsal(resolved, tables))


def _search(
    subjects: Sequence[Subject], parameters: Sequence[Parameter], workers: int, progress: Callable[[float], None] | None
) -> tuple[Minimum, int]:
    """Minimum over all flights; the way there begins on a part of them, which costs less."""
    start, bounds = np.zeros(len(parameters)), [p.bounds for p in parameters]
    shortest = min(subject.rehearsal.duration_s for subject in subjects)
    count = 0
    for index, share in enumerate((COARSE_S / shortest, 1.0) if shortest > 2.0 * COARSE_S else (1.0,)):
        cost = Cost(subjects, parameters, workers, share)
        cost.refer_to(start)
        if not cost.readings:
            raise FlightError("no reading was compared with a prediction, so there is nothing to tune by")
        start = minimise(cost, cost.expand, start, bounds, TOLERANCE if share == 1.0 else COARSE_TOLERANCE).at
        count += cost.replays
        if progress is not None:
            progress(0.3 + 0.5 * index)
    cost.refer_to(start)
    before = cost.replays
    minimum = describe(cost, start, bounds)
    return minimum, count + cost.replays - before


def _tuned(parameter: Parameter, minimum: Minimum, index: int) -> Tuned:
    sigma = float(minimum.sigma[index]) * (1.0 if parameter.is_log else parameter.scale)
    value = parameter.value(float(minimum.at[index]))
    return Tuned(parameter, value, sigma, bool(minimum.at_bound[index]), bool(minimum.unidentifiable[index]))


def _score(flight: Flight, subject: Subject, parameters: Sequence[Parameter], found: Array, held_out: bool) -> Score:
    cost = Cost([subject], parameters, 1)
    before, after = cost([np.zeros(len(parameters)), found])
    changed = apply(subject.config, cost.values(found))
    runs = [replay(flight, settings).metrics for settings in (subject.config, changed)]
    return Score(flight.name, held_out, 0.5 * (before - after), cost.readings, *runs)


def _refuse_different_sensors(parameters: Sequence[Parameter], flights: Sequence[Flight]) -> None:
    """A sensor's own setting is written with the whole description of the sensor, so that must be the same."""
    for parameter in parameters:
        sensor = _sensor_of(parameter.name)
        if sensor and any(f.config.sensor.get(sensor) != flights[0].config.sensor.get(sensor) for f in flights):
            raise ConfigError(
                f"{parameter.name}: the flights describe {sensor} differently; free a setting that all share, "
                f"like uwb.sigma_m, or tune on one of them"
            )


def _sensor_of(name: str) -> str | None:
    return name.removeprefix("sensor.").rpartition(".")[0] if name.startswith("sensor.") else None


def tuned_config(config: Config | None, flight: Flight, values: dict[str, float]) -> dict[str, Any]:
    """Plain data of a configuration file with the found values: what ``config`` changes, and what tuning changes.

    Sensors appear only where one of their own settings was changed, then as a whole.
    """
    named = {sensor for name in values if (sensor := _sensor_of(name))}
    changed = apply(resolve(config, flight), values).to_dict()
    given = (config or Config()).to_dict()
    default = Config().to_dict()
    out = {key: value for key, value in given.items() if value != default[key]}
    for key, table in changed.items():
        if key in {"sensor", "surface", "corridor", "initial"}:
            continue
        if isinstance(table, dict):
            different = {name: value for name, value in table.items() if value != default[key].get(name)}
            if different:
                out[key] = different
        elif table != default[key]:
            out[key] = table
    sensors = {**given["sensor"], **{name: changed["sensor"][name] for name in sorted(named)}}
    if sensors:
        out["sensor"] = sensors
    return out
