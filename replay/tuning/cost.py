"""The cost of a set of settings: what the innovations of several flights say about them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Gate
from axialnav.fusion.rehearsal import Rehearsal, Trial
from axialnav.replay.tuning.evidence import Evidence, collect, counts_of, expected_curvature
from axialnav.replay.tuning.parameters import DELAY, Parameter, apply
from axialnav.replay.tuning.scoring import Expansion

Array = NDArray[np.float64]
GATED = ("uwb", "flow", "range", "height", "attitude")
NO_WEIGHT = 1e9  # soft_sigma from which on every reading inside the gate has full weight
HOPELESS = 1e12
MARGIN_S = 1.0
STEP = 0.05  # of a search coordinate, for differences


@dataclass(frozen=True)
class Subject:
    """A flight under tuning: its name, its resolved configuration, and the packed readings."""

    name: str
    config: Config
    rehearsal: Rehearsal


def undecided(config: Config) -> Config:
    """Copy with full weight inside every gate, all of the accelerometer's margin, and without the supervisor.

    The redescending weight makes the filter take less from each reading than its noise allows; likelihood would then
    call the accelerometer noisier than it is, to make up for that.  A margin that follows the flight would make the
    likelihood flat in the accelerometer's noise.  The supervisor decides about a whole source for
    seconds, and a small change of a setting can bring such a decision about: the cost would jump by hundreds there, and
    a source with wrong stamps would be judged by the few readings that the supervisor lets pass.
    """
    tables = {name: getattr(config, name) for name in GATED}
    hard = {
        name: msgspec.structs.replace(table, gate=Gate(probability=table.gate.probability, soft_sigma=NO_WEIGHT))
        for name, table in tables.items()
    }
    replace = msgspec.structs.replace
    alone, told = replace(config.supervisor, enabled=False), replace(config.imu, margin_time_s=0.0)
    return replace(config, **hard, supervisor=alone, imu=told)


class Cost:
    """Twice the negative log-likelihood of all subjects as a function of search coordinates.

    Readings that the first trial compared are counted in all others too (see :meth:`Terms.cost`).  Several points are
    computed side by side in threads; the result does not depend on how many.  ``share`` limits every flight to its
    beginning.  ``replays`` counts what was replayed.
    """

    def __init__(
        self, subjects: Sequence[Subject], parameters: Sequence[Parameter], workers: int, share: float = 1.0
    ) -> None:
        self._subjects = [Subject(s.name, undecided(s.config), s.rehearsal) for s in subjects]
        self._parameters = tuple(parameters)
        self._workers = workers
        self._share = share
        self._references: list[Evidence] = []
        self._counts: list[NDArray[np.int64]] = []
        shifts = any(p.name.startswith(DELAY) for p in self._parameters)
        self._margin_s = MARGIN_S if shifts else 0.0
        self.replays = 0

    def refer_to(self, point: Array) -> None:
        """Count the readings that a trial at ``point`` compares from here on."""
        trials = [self._trial(subject, point) for subject in self._subjects]
        self.replays += len(trials)
        self._counts = [counts_of(trial) for trial in trials]
        pairs = zip(trials, self._counts, strict=True)
        self._references = [collect(trial, counts, self._margin_s) for trial, counts in pairs]

    @property
    def readings(self) -> float:
        """Number of readings counted, those that repeat each other as one."""
        return float(sum((one.terms.weight * one.terms.used).sum() for one in self._references))

    def values(self, point: Array) -> dict[str, float]:
        """Settings by name at a point."""
        return {p.name: p.value(float(x)) for p, x in zip(self._parameters, point, strict=True)}

    def __call__(self, points: list[Array]) -> list[float]:
        """Costs of several points, in order."""
        if not points:
            return []
        if not self._references:
            self.refer_to(points[0])
        return self._costs(self._evidence(points))

    def expand(self, point: Array) -> Expansion:
        """Cost, slope and expected curvature from central differences (one-sided at a bound), side by side."""
        n = point.size
        bounds = np.array([p.bounds for p in self._parameters])
        ends = [np.clip(point + sign * STEP * unit, *bounds.T) for unit in np.eye(n) for sign in (-1.0, 1.0)]
        evidence = self._evidence([point, *ends])
        here, *around = self._costs(evidence)
        span = np.array([(ends[2 * i + 1] - ends[2 * i])[i] for i in range(n)])
        slope = np.diff(np.array(around).reshape(n, 2), axis=1)[:, 0] / span
        curvature = np.zeros((n, n))
        for reference, (middle, *outer) in zip(self._references, evidence, strict=True):
            curvature += expected_curvature(middle, outer, span, reference.terms)
        return Expansion(here, slope, curvature)

    def _evidence(self, points: list[Array]) -> list[list[Evidence]]:
        """What each subject says at all points."""
        jobs = [(index, point) for index in range(len(self._subjects)) for point in points]

        def one(job: tuple[int, Array]) -> Evidence:
            """Evidence of one flight at one point."""
            index, point = job
            return collect(self._trial(self._subjects[index], point), self._counts[index])

        with ThreadPoolExecutor(self._workers) as pool:
            found = list(pool.map(one, jobs))
        self.replays += len(jobs)
        return [found[i : i + len(points)] for i in range(0, len(jobs), len(points))]

    def _trial(self, subject: Subject, point: Array) -> Trial:
        return subject.rehearsal.run(apply(subject.config, self.values(point)), self._share)

    def _costs(self, evidence: list[list[Evidence]]) -> list[float]:
        """Costs of the points, summed over the subjects."""
        parts = [
            [float(one.terms.cost(reference.terms).sum()) for one in mine]
            for reference, mine in zip(self._references, evidence, strict=True)
        ]
        return [float(total) if np.isfinite(total) else HOPELESS for total in np.sum(parts, axis=0)]
