"""When to send: at a steady rate, at once when a camera frame has been fused, never two messages too close."""

from __future__ import annotations

SPACING_NS = 21_000_000  # ArduPilot drops what comes within 20 ms
DELTA_SPACING_NS = 52_000_000  # and deltas within 50 ms
WAIT_FOR_FRAME = 1.6  # periods that a late frame is waited for: a message just before it would hold its own up
FRAMES_STOPPED_NS = 200_000_000


class Schedule:
    """Decides the instants of sending; all times are of the one monotonic clock [ns]."""

    def __init__(self, rate_hz: float, spacing_ns: int = SPACING_NS) -> None:
        self._period_ns = max(round(1e9 / rate_hz), spacing_ns)
        self._spacing_ns = spacing_ns
        self._last_ns: int | None = None
        self._due_ns: int | None = None
        self._frame_ns = -FRAMES_STOPPED_NS

    def frame_done(self, now_ns: int) -> None:
        """A camera frame has just changed the estimate, or told nothing: send as soon as the spacing allows."""
        self._frame_ns = now_ns
        self._due_ns = now_ns

    def wait_ns(self, now_ns: int) -> int:
        """Time until the next message, 0 if it is due."""
        if self._last_ns is None:
            return 0
        soonest = self._last_ns + self._spacing_ns
        with_frames = now_ns - self._frame_ns < FRAMES_STOPPED_NS
        latest = self._last_ns + round(self._period_ns * (WAIT_FOR_FRAME if with_frames else 1.0))
        at = latest if self._due_ns is None else min(max(self._due_ns, soonest), latest)
        return max(max(at, soonest) - now_ns, 0)

    def taken(self) -> None:
        """What was fused so far will be in the message that is being made."""
        self._due_ns = None

    def sent(self, now_ns: int) -> None:
        """The opportunity was used, or passed over because there was nothing to send."""
        self._last_ns = now_ns
