"""Boot time of the autopilot on the companion's monotonic clock, with drift, through reboots and lost answers.

TIMESYNC gives offset = (sent + received) / 2 - remote, wrong by at most half the asymmetry of the round trip.  A line
is fitted to the offsets of the last minute; exchanges with a long round trip weigh little.  Where the autopilot answers
none, the smallest (arrival - remote) of the last seconds stands in: it contains the shortest one-way delay, which
nobody can know, and :attr:`BootClock.synchronised` says so.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

SLOWEST_NS = 100_000_000
WINDOW = 120  # exchanges: a minute at the slow rate
DRIFT_PRIOR = 50e-6  # crystals of autopilots and companions
ROUND_TRIP_FLOOR_NS = 500_000
SLEW = 0.01  # share of the time by which the mapping may run fast or slow while it corrects itself
STEP_NS = 100_000_000  # offsets that differ by more are another boot, not drift
SUSPICIONS = 3
STALE_NS = 500_000_000
DOUBT_NS = 1_000_000_000
ENVELOPE_NS = 5_000_000_000
SETTLED = 5  # answers before stamps are believed
PATIENCE_NS = 2_000_000_000  # how long answers are waited for


class Exchange(NamedTuple):
    """One answered TIMESYNC: when the answer came, offset and round trip [ns]."""

    t_ns: int
    offset_ns: int
    round_trip_ns: int


class BootClock:
    """Maps the autopilot's stamps to the companion's clock.

    Attributes
    ----------
    epoch
        Number of clock restarts noticed so far (reboots, steps of more than 0.1 s).
    synchronised
        Whether TIMESYNC is answered; otherwise arrival times stand in.
    """

    def __init__(self) -> None:
        self.epoch = 0
        self.synchronised = False
        self._exchanges: deque[Exchange] = deque(maxlen=WINDOW)
        self._arrivals: deque[tuple[int, int]] = deque()  # increasing (arrival, arrival - remote): lower envelope
        self._suspicions = 0
        self._doubted_ns: int | None = None
        # offset(remote) = base + drift * (remote - at) + correction that fades
        self._first_ns: int | None = None
        self._envelope_ns = 0  # how long arrivals have been watched
        self._base_ns: float | None = None
        self._drift = 0.0
        self._at_ns = 0
        self._correction_ns = 0.0

    @property
    def in_doubt(self) -> bool:
        """Whether stamps or answers of late do not fit: ask faster."""
        return self._suspicions > 0 or self._doubted_ns is not None

    @property
    def drift_ppm(self) -> float:
        """How much faster the companion's clock runs, parts per million."""
        return self._drift * 1e6

    @property
    def round_trip_ns(self) -> int | None:
        """Median round trip of the exchanges in use [ns]; None without any."""
        trips = sorted(e.round_trip_ns for e in self._exchanges)
        return trips[len(trips) // 2] if trips else None

    def exchange(self, sent_ns: int, remote_ns: int, received_ns: int) -> None:
        """Take one answered request: sent and received on our clock, ``remote_ns`` on the autopilot's."""
        trip = received_ns - sent_ns
        if not 0 <= trip <= SLOWEST_NS:
            return  # such an answer tells less than the arrival of any message
        offset = (sent_ns + received_ns) // 2 - remote_ns
        expected = self._offset(remote_ns)
        if expected is not None and self.synchronised and abs(offset - expected) > STEP_NS:
            self._suspicions += 1
            if self._suspicions < SUSPICIONS:
                return
            self._restart()
        self._suspicions = 0
        self._exchanges.append(Exchange(received_ns, offset, trip))
        self._fit(remote_ns)
        self.synchronised = len(self._exchanges) >= SETTLED

    def notice(self, remote_ns: int, arrival_ns: int) -> None:
        """Take stamp and arrival of any message: the fallback without TIMESYNC, and the watch for reboots."""
        expected = self._offset(remote_ns)
        if expected is not None and abs(arrival_ns - remote_ns - expected) > STALE_NS:
            self._doubted_ns = arrival_ns if self._doubted_ns is None else self._doubted_ns
            if arrival_ns - self._doubted_ns > DOUBT_NS:  # a backlog that is let go all at once lasts less
                self._restart()
            return
        self._doubted_ns = None
        if not self._exchanges:
            self._lower_envelope(remote_ns, arrival_ns)

    def to_companion_ns(self, remote_ns: int) -> int | None:
        """Companion time of an autopilot stamp; None until some answers, or some seconds without any, have come."""
        offset = self._offset(remote_ns) if self.synchronised or self._envelope_ns >= PATIENCE_NS else None
        return None if offset is None else remote_ns + round(offset)

    def _offset(self, remote_ns: int) -> float | None:
        if self._base_ns is None:
            return None
        since = remote_ns - self._at_ns
        left = max(abs(self._correction_ns) - SLEW * max(since, 0), 0.0)
        return self._base_ns + self._drift * since + (left if self._correction_ns >= 0.0 else -left)

    def _restart(self) -> None:
        self.epoch += 1
        self.synchronised = False
        self._exchanges.clear()
        self._arrivals.clear()
        self._suspicions, self._doubted_ns = 0, None
        self._first_ns, self._envelope_ns = None, 0
        self._base_ns, self._drift, self._correction_ns = None, 0.0, 0.0

    def _lower_envelope(self, remote_ns: int, arrival_ns: int) -> None:
        lag = arrival_ns - remote_ns
        self._first_ns = arrival_ns if self._first_ns is None else self._first_ns
        self._envelope_ns = arrival_ns - self._first_ns
        while self._arrivals and self._arrivals[-1][1] >= lag:
            self._arrivals.pop()
        self._arrivals.append((arrival_ns, lag))
        while self._arrivals[0][0] < arrival_ns - ENVELOPE_NS:
            self._arrivals.popleft()
        self._aim(remote_ns, float(self._arrivals[0][1]), 0.0)

    def _fit(self, remote_ns: int) -> None:
        """Weighted line through the offsets, its slope held near zero by what crystals can do."""
        newest = self._exchanges[-1]
        best = min(e.round_trip_ns for e in self._exchanges)
        s = st = stt = so = sto = 0.0
        for e in self._exchanges:
            spread = ROUND_TRIP_FLOOR_NS + (e.round_trip_ns - best)  # the asymmetry is at most half of it
            weight = 1.0 / (spread * spread)
            t, o = float(e.t_ns - newest.t_ns), float(e.offset_ns - newest.offset_ns)
            s, st, stt, so, sto = (
                s + weight,
                st + weight * t,
                stt + weight * t * t,
                so + weight * o,
                sto + weight * t * o,
            )
        stt += 1.0 / DRIFT_PRIOR**2
        determinant = s * stt - st * st
        drift = (s * sto - st * so) / determinant
        self._aim(remote_ns, newest.offset_ns + (stt * so - st * sto) / determinant, drift)

    def _aim(self, remote_ns: int, offset_ns: float, drift: float) -> None:
        """Follow a new line from ``remote_ns`` on, without a jump unless the jump is a large one."""
        before = self._offset(remote_ns) if self.synchronised or self._envelope_ns >= PATIENCE_NS else None
        correction = 0.0 if before is None else before - offset_ns
        self._correction_ns = correction if abs(correction) < STEP_NS / 2 else 0.0
        self._base_ns, self._drift, self._at_ns = offset_ns, drift, remote_ns
