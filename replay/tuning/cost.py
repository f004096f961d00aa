"""The cost of a set of settings: what the innovations of several flights say about them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.config import Config, Gate
from axialnav.fusion.rehearsal import Rehearsal, Terms
from axialnav.replay.tuning.parameters import Parameter, apply

Array = NDArray[np.float64]
GATED = ("uwb", "flow", "range", "height", "attitude")
NO_WEIGHT = 1e9  # soft_sigma from which on every reading inside the gate has full weight
HOPELESS = 1e12


@dataclass(frozen=True)
class Subject:
    """A flight under tuning: its name, its resolved configuration, and the packed readings."""

    name: str
    config: Config
    rehearsal: Rehearsal


def hard_gates(config: Config) -> Config:
    """Copy with full weight inside every gate.

    The redescending weight makes the filter take less from each reading than its noise allows; likelihood would then
    call the accelerometer noisier than it is, to make up for that.
    """
    tables = {name: getattr(config, name) for name in GATED}
    hard = {
        name: msgspec.structs.replace(table, gate=Gate(probability=table.gate.probability, soft_sigma=NO_WEIGHT))
        for name, table in tables.items()
    }
    return msgspec.structs.replace(config, **hard)


class Cost:
    """Twice the negative log-likelihood of all subjects as a function of search coordinates.

    Readings that the first trial compared are counted in all others too (see :meth:`Terms.cost`).  Several points are
    computed side by side in threads; the result does not depend on how many.  ``share`` limits every flight to its
    beginning.
    """

    def __init__(
        self, subjects: Sequence[Subject], parameters: Sequence[Parameter], workers: int, share: float = 1.0
    ) -> None:
        self._subjects = [Subject(s.name, hard_gates(s.config), s.rehearsal) for s in subjects]
        self._parameters = tuple(parameters)
        self._workers = workers
        self._share = share
        self._references: list[Terms] = []

    def refer_to(self, point: Array) -> None:
        """Count the readings that a trial at ``point`` compares from here on."""
        self._references = [self._terms(s, point) for s in self._subjects]

    @property
    def readings(self) -> float:
        """Number of readings counted, those that repeat each other as one."""
        return float(sum((terms.weight * terms.used).sum() for terms in self._references))

    def values(self, point: Array) -> dict[str, float]:
        """Settings by name at a point."""
        return {p.name: p.value(float(x)) for p, x in zip(self._parameters, point, strict=True)}

    def __call__(self, points: list[Array]) -> list[float]:
        """Costs of several points, in order."""
        if not points:
            return []
        if not self._references:
            self.refer_to(points[0])
        jobs = [(point, index) for point in points for index in range(len(self._subjects))]
        with ThreadPoolExecutor(self._workers) as pool:
            parts = list(pool.map(lambda job: self._one(*job), jobs))
        return [float(total) for total in np.array(parts).reshape(len(points), -1).sum(axis=1)]

    def _one(self, point: Array, index: int) -> float:
        subject = self._subjects[index]
        cost = float(self._terms(subject, point).cost(self._references[index]).sum())
        return cost if np.isfinite(cost) else HOPELESS

    def _terms(self, subject: Subject, point: Array) -> Terms:
        return subject.rehearsal.run(apply(subject.config, self.values(point)), self._share).terms
