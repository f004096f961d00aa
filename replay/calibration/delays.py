"""How late the stamps of each sensor are: the shift under which its readings are most likely."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from axialnav.fusion.sources import Kind, kind_of
from axialnav.replay.tuning.cost import Cost, Subject
from axialnav.replay.tuning.parameters import DELAY, DELAY_SCALE_S, Parameter

COARSE_S = np.arange(-0.5, 0.5001, 0.1)
FINE_STEPS_S = (0.04, 0.016, 0.006, 0.003)
REACH_S = 1.0
MAX_REFINEMENTS, ENOUGH_NATS = 4, 0.5
MIN_READINGS = 50
CLEAR_RISE = 4.0  # two standard errors
MIN_GAIN_NATS = 20.0  # less than that is the roughness of gates, and of image windows that are not points


@dataclass(frozen=True)
class Delay:
    """Delay of one sensor's stamps [s].

    ``sigma_s`` is None where the flight does not tell; ``at_edge`` if it may be more than what was searched;
    ``gain_nats`` is 0 where no shift was needed to explain the readings.
    """

    sensor: str
    late_s: float
    sigma_s: float | None
    gain_nats: float
    at_edge: bool


def find_delay(subject: Subject, sensor: str, workers: int, *, coarse: bool = True) -> Delay:
    """Delay of one sensor, the others as they are: a coarse look over half a second to both sides, then finer ones."""
    known = subject.config.delay.late_s.get(sensor, 0.0)
    best, sigma, gain = _best_shift(subject, (sensor,), workers, coarse)
    return Delay(sensor, known + best, sigma, gain, abs(best) > float(COARSE_S[-1]))


def _best_shift(
    subject: Subject, sensors: Sequence[str], workers: int, coarse: bool
) -> tuple[float, float | None, float]:
    """By how much to shift the stamps of all these sensors, its standard error, and what that gains [nats]."""
    cost = Cost([subject], _parameters(subject, sensors), workers)
    costs: dict[float, float] = {}

    def look(shifts: list[float]) -> None:
        """Ask for the costs of shifts [s] that are not known yet."""
        new = [round(shift, 6) for shift in shifts if round(shift, 6) not in costs]
        points = [np.full(len(sensors), shift / DELAY_SCALE_S) for shift in new]
        costs.update(zip(new, cost(points) if points else [], strict=True))

    cost.refer_to(np.zeros(len(sensors)))
    look([0.0, *(COARSE_S.tolist() if coarse else [])])
    for step in FINE_STEPS_S:
        best = min(costs, key=costs.__getitem__)
        look([best + k * step for k in (-2, -1, 1, 2)])
    vertex, sigma = _vertex(costs)
    if vertex is not None:
        look([vertex])
    best = min(costs, key=costs.__getitem__)
    return best, sigma, 0.5 * (costs[0.0] - costs[best])


def _parameters(subject: Subject, sensors: Sequence[str]) -> list[Parameter]:
    known = [(name, subject.config.delay.late_s.get(name, 0.0)) for name in sensors]
    return [Parameter(f"{DELAY}{name}", late, late - REACH_S, late + REACH_S, DELAY_SCALE_S) for name, late in known]


def _vertex(costs: dict[float, float]) -> tuple[float | None, float | None]:
    """Vertex and standard error of the parabola through the best shift and the nearest clearly worse one on each side.

    None where the cost does not rise clearly on both sides.
    """
    best = min(costs, key=costs.__getitem__)
    worse = [shift for shift, cost in costs.items() if cost > costs[best] + CLEAR_RISE]
    left, right = [s for s in worse if s < best], [s for s in worse if s > best]
    if not left or not right:
        return None, None
    x = np.array([max(left), best, min(right)])
    second, first, _ = np.polyfit(x - best, [costs[shift] for shift in x.tolist()], 2)
    if second <= 0.0:
        return None, None
    return float(np.clip(best - first / (2.0 * second), x[0], x[2])), float(1.0 / np.sqrt(second))


def find_delays(subject: Subject, workers: int) -> list[Delay]:
    """Delays of all sensors that were read often enough.

    A sensor with wrong stamps pulls at the best shift of every other.  Therefore the one whose shift gains most is
    moved first and the search repeated, until no shift gains anything to speak of.  Sensors that were moved hold each
    other where they are, because they agree; so in the end all of them are shifted together too, against the inertial
    unit, and then each once more.
    """
    names = _wanted(subject)
    moved = subject
    for _ in range(len(names) + 1):
        found = [find_delay(moved, name, workers) for name in names]
        best = max(found, key=lambda delay: delay.gain_nats, default=None)
        if best is None or best.gain_nats < MIN_GAIN_NATS:
            break
        moved = _with_delays(moved, {best.sensor: best.late_s})
    moved = _refined(moved, _changed(subject, moved, names), workers)
    final = [find_delay(moved, name, workers, coarse=False) for name in names]
    gains = {name: _gain(subject, moved, name) for name in names}
    joint = _joint_errors(moved, [d.sensor for d in final if d.sigma_s is not None])
    return [
        replace(
            d,
            gain_nats=gains[d.sensor],
            at_edge=abs(d.late_s) > float(COARSE_S[-1]),
            sigma_s=None if d.sigma_s is None else max(d.sigma_s, joint[d.sensor]),
        )
        for d in final
    ]


def _changed(before: Subject, after: Subject, names: Sequence[str]) -> list[str]:
    return [name for name in names if after.config.delay.late_s.get(name) != before.config.delay.late_s.get(name)]


def _refined(subject: Subject, names: Sequence[str], workers: int) -> Subject:
    for _ in range(MAX_REFINEMENTS):
        gained = 0.0
        for together in (names, *([name] for name in names)) if len(names) > 1 else [names]:
            if together:
                shift, _, gain = _best_shift(subject, together, workers, coarse=False)
                late = {name: subject.config.delay.late_s[name] + shift for name in together}
                subject, gained = _with_delays(subject, late), gained + gain
        if gained < ENOUGH_NATS:
            break
    return subject


def _joint_errors(subject: Subject, names: Sequence[str]) -> dict[str, float]:
    """Standard errors of delays that are found together, which are larger than those of each by itself."""
    if not names:
        return {}
    cost = Cost([subject], _parameters(subject, names), 1)
    cost.refer_to(np.zeros(len(names)))
    bent = cost.expand(np.zeros(len(names))).curvature
    variance = 2.0 * np.diag(np.linalg.pinv(bent, hermitian=True))
    return dict(zip(names, (DELAY_SCALE_S * np.sqrt(np.maximum(variance, 0.0))).tolist(), strict=True))


def _wanted(subject: Subject) -> list[str]:
    seen = subject.rehearsal.run(subject.config).log
    counts = {name: int((seen.source == index).sum()) for index, name in enumerate(seen.sensors)}
    kinds = {name: kind_of(spec) for name, spec in subject.config.sensor.items()}
    return [
        name for name, kind in kinds.items() if kind not in (None, Kind.IMU) and counts.get(name, 0) >= MIN_READINGS
    ]


def _with_delays(subject: Subject, found: Mapping[str, float]) -> Subject:
    late = {**subject.config.delay.late_s, **found}
    tuning = msgspec.structs.replace(subject.config.delay, late_s=late)
    return replace(subject, config=msgspec.structs.replace(subject.config, delay=tuning))


def _gain(subject: Subject, moved: Subject, sensor: str) -> float:
    """Log-likelihood with all shifts, minus that with all but this one."""
    known = subject.config.delay.late_s.get(sensor, 0.0)
    now = moved.config.delay.late_s.get(sensor, 0.0)
    parameter = Parameter(f"delay.late_s.{sensor}", now, now - 2.0, now + 2.0, DELAY_SCALE_S)
    after, before = Cost([moved], [parameter], 1)([np.zeros(1), np.array([(known - now) / DELAY_SCALE_S])])
    return 0.5 * (before - after)
