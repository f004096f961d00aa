"""One recording, many settings: readings are packed once, and trials run side by side in threads.

The likelihood of a trial is that of its innovations, seen through the gate, so that reflections do not decide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.alignment import align
from axialnav.fusion.batch import run_batch, unpack_log
from axialnav.fusion.config import Config
from axialnav.fusion.events import Events, Table, pack_tables
from axialnav.fusion.handedness import mirror_config, mirror_tables
from axialnav.fusion.kernels.measure import repetition
from axialnav.fusion.kernels.run import mean_gap, run
from axialnav.fusion.memory import LOG_WIDTH, TRACK_WIDTH, build_settings, new_memory, new_scratch
from axialnav.fusion.outcome import InnovationLog, Verdict
from axialnav.fusion.sources import Kind, Records, build_sources
from axialnav.models.scalar_kernel import threaded_kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
KEPT = 8  # packings, for delays on trial


@threaded_kernel
def _run_released(
    t_ns: Ints,
    source: Ints,
    values: Array,
    sources: Records,
    core: Records,
    memory: Records,
    scratch: Records,
    settings: Records,
    track: Array,
    log: Array,
) -> int:
    return run(t_ns, source, values, sources, core, memory, scratch, settings, track, log)


@dataclass(frozen=True)
class Trial:
    """What came out of one trial; ``terms`` are the readings' parts of the likelihood."""

    log: InnovationLog
    terms: Terms


@dataclass(frozen=True)
class Terms:
    """Per reading, in the order of the log, arrays of shape (n,).

    Attributes
    ----------
    used
        Whether the reading was compared with a prediction (fused or gated).
    nis
        Normalised innovation squared, at most the gate.
    log_det
        Sum over the axes of log S.
    gate
        Threshold on ``nis``; 0 where nothing was compared.
    weight
        1 over the number of readings that repeat each other.
    """

    used: NDArray[np.bool_]
    nis: Array
    log_det: Array
    gate: Array
    weight: Array

    def cost(self, reference: Terms) -> Array:
        """Twice the negative log-likelihood of each reading, up to a constant; shape (n,).

        The readings counted are those that ``reference`` compared.  One that is not compared here (a blur that became
        blind) is charged its gate, so that refusing readings is never a gain.
        """
        cost = np.where(self.used, self.nis + self.log_det, reference.gate + reference.log_det)
        return np.where(reference.used, reference.weight * cost, 0.0)


@dataclass(frozen=True)
class Packed:
    """Events of a recording and what is known of them before any trial.

    ``read`` (events,) tells readings from inertial samples; ``repeated`` (n,) belongs to the n readings.
    """

    events: Events
    read: NDArray[np.bool_]
    repeated: Array

    def first(self, share: float) -> Packed:
        """The beginning of it."""
        if share >= 1.0:
            return self
        many = int(share * len(self.read))
        readings = int(self.read[:many].sum())
        return Packed(self.events.part(slice(0, many)), self.read[:many], self.repeated[:readings])


class Rehearsal:
    """A recording ready to be run with many settings.

    Parameters
    ----------
    config
        Resolved configuration of the recording; decides which frame the survey is in, if that is open.
    tables
        Readings by sensor name.

    Raises
    ------
    ConfigError, FlightError
        As for :func:`axialnav.fusion.batch.run_batch`.
    """

    def __init__(self, config: Config, tables: Mapping[str, Table]) -> None:
        self._left = run_batch(config, tables).handedness == "left"
        enabled = {name: table for name, table in tables.items() if name not in config.disabled}
        self._tables = mirror_tables(enabled) if self._left else enabled
        self._packed: dict[str, Packed] = {}

    @property
    def duration_s(self) -> float:
        """Time between the first and the last reading [s]."""
        stamps = [t for table in self._tables.values() for t in (table.t_ns[:1], table.t_ns[-1:])]
        every = np.concatenate(stamps) if stamps else np.zeros(1, np.int64)
        return float(every.max() - every.min()) * 1e-9 if every.size else 0.0

    def run(self, config: Config, share: float = 1.0) -> Trial:
        """Run with other settings of the same sensors, over the first ``share`` of the events.

        Thread-safe; the compiled part lets other threads run.  Where the survey is left-handed, the log is that of the
        mirrored flight.
        """
        own = mirror_config(config) if self._left else config
        src = build_sources(own)
        packed = self._pack(own, src).first(share)
        events, memory = packed.events, new_memory(len(src))
        align(own, src, events, memory)
        track, log = np.zeros((int((~packed.read).sum()), TRACK_WIDTH)), np.zeros((len(events.t_ns), LOG_WIDTH))
        settings = build_settings(own)
        _run_released(*events, src, memory.core, memory.sources, new_scratch(), settings, track, log)
        named = unpack_log(own, events, packed.read, log)
        return Trial(named, likelihood_terms(named, packed))

    def _pack(self, config: Config, src: Records) -> Packed:
        """Events in their order; delays and the correlation time change it, nothing else that can be tried does."""
        key = repr((sorted(config.delay.late_s.items()), src["correlation_s"].tolist()))
        packed = self._packed.get(key)
        if packed is None:
            events = pack_tables(config, self._tables)
            read = src["kind"][events.source] != int(Kind.IMU)
            packed = Packed(events, read, _repetition(events, read, src))
            self._packed = {**dict(list(self._packed.items())[1 - KEPT :]), key: packed}
        return packed


def likelihood_terms(log: InnovationLog, packed: Packed) -> Terms:
    """Parts of the likelihood of every reading of a log.

    Neighbouring errors are alike, and what the filter's bias states leave of that must not decide: a reading counts as
    one over the number of readings that repeat each other (:func:`axialnav.fusion.kernels.measure.repetition`), as it
    does where the filter itself weighs evidence.

    Parameters
    ----------
    log
        From the filter.
    packed
        The same readings.
    """
    used = (log.verdict == int(Verdict.FUSED)) | (log.verdict == int(Verdict.GATED))
    with np.errstate(invalid="ignore", divide="ignore"):
        log_det = np.nansum(np.log(log.variance), axis=1)
    gate = np.where(used, log.gate, 0.0)
    return Terms(
        used=used,
        nis=np.where(used, np.minimum(log.nis, gate), 0.0),
        log_det=np.where(used, log_det, 0.0),
        gate=gate,
        weight=1.0 / packed.repeated,
    )


def _repetition(events: Events, read: NDArray[np.bool_], src: Records) -> Array:
    """How many readings say the same as each one, (n,)."""
    t_ns, source = events.t_ns[read], events.source[read]
    repeated = np.ones(t_ns.size)
    for index in np.flatnonzero(src["correlation_s"]):
        rows = np.flatnonzero(source == index)
        repeated[rows] = [repetition(gap, float(src["correlation_s"][index])) for gap in _gaps(t_ns[rows])]
    return repeated


def _gaps(t_ns: Ints) -> list[float]:
    """Fading mean of the time between readings, as the filter knows it at each of them [s]; NaN at the first."""
    gaps, known = [], math.nan
    for gap_s in np.diff(t_ns, prepend=-(2**61)) * 1e-9:
        known = mean_gap(known, gap_s)
        gaps.append(known)
    return gaps
