"""Bytes to messages that may be used; whatever else came is counted by reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

from axialnav.fusion.live.dialect import Message, mavlink
from axialnav.fusion.live.security import AllowList, Signatures, signing_ticks

BURST = 100  # refused packets within a second
MAX_PARSED = 4096  # parsed bytes kept before the parser's buffer is cut
MAGIC = (mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2)


class Receiver:
    """Parser, signature check, allow-list and counters of one link.

    Attributes
    ----------
    counts
        ``accepted``, ``damaged``, ``bad_signature``, ``unknown``, ``unlisted`` and ``parser_restarts``; with a key also
        why signatures failed (``forged``, ``far_future``, ``replayed``).

    Notes
    -----
    A damaged or unknown packet may have swallowed good ones (a false start claims up to 280 bytes), so what follows its
    first byte is parsed again.  After a burst of refused packets the parser is made anew and the burst is reported.
    """

    def __init__(
        self,
        allow: Iterable[tuple[int, int]],
        *,
        key: bytes | None = None,
        ticks: Callable[[], int] = signing_ticks,
    ) -> None:
        self.allow = AllowList(allow)
        self.counts: Counter[str] = Counter()
        self.signatures = Signatures(key, ticks) if key is not None else None
        self._sequence: dict[tuple[int, int], tuple[int, int, int]] = {}
        self._burst_began_ns, self._burst = 0, 0
        self._parser = self._new()

    def _new(self) -> Message:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        if self.signatures is not None:
            parser.signing.secret_key = self.signatures.key
            parser.check_signature = self.signatures.check
        return parser

    def feed(self, data: bytes, now_ns: int) -> list[Message]:
        """Messages of listed senders completed by ``data``, in order."""
        good: list[Message] = []
        message = self._parser.parse_char(data)
        while message is not None:
            kind = message.get_msgId()
            if kind < 0 or isinstance(message, mavlink.MAVLink_unknown):
                self._refuse(message, now_ns)
            elif self._admit(message):
                good.append(message)
            message = self._parser.parse_char(b"")
        self._trim()
        return good

    def all_counts(self) -> dict[str, int]:
        """Every counter, those of the signatures and the refused senders included."""
        named = dict(self.counts)
        if self.signatures is not None:
            named.update(self.signatures.counts)
        for (system, component), count in self.allow.refused.items():
            named[f"unlisted {system}/{component}"] = count
        return named

    def lost(self) -> dict[tuple[int, int], int]:
        """Messages of each listed sender that never came, from the gaps in its sequence numbers."""
        return {who: max(last - first + 1 - got, 0) for who, (first, last, got) in self._sequence.items()}

    def _admit(self, message: Message) -> bool:
        system, component = message.get_srcSystem(), message.get_srcComponent()
        if not self.allow.admits(system, component):
            self.counts["unlisted"] += 1
            return False
        self.counts["accepted"] += 1
        self._follow((system, component), message.get_seq())
        return True

    def _follow(self, who: tuple[int, int], number: int) -> None:
        first, last, got = self._sequence.get(who, (number, number, 0))
        step = (number - last + 128) % 256 - 128  # reordered packets step back a little
        self._sequence[who] = (min(first, last + step), max(last, last + step), got + 1)

    def _refuse(self, message: Message, now_ns: int) -> None:
        reason = getattr(message, "reason", "")
        known = isinstance(message, mavlink.MAVLink_bad_data)
        name = "unknown" if not known else "bad_signature" if "signature" in reason else "damaged"
        self.counts[name] += 1
        if name != "bad_signature":
            self._look_inside(bytes(message.data))
        if name == "unknown":
            return  # messages of other dialects are no attack
        if now_ns - self._burst_began_ns > 1_000_000_000:
            self._burst_began_ns, self._burst = now_ns, 0
        self._burst += 1
        if self._burst == BURST:
            self.counts["parser_restarts"] += 1
            waiting = bytes(self._parser.buf[self._parser.buf_index :])
            self._parser = self._new()
            self._parser.buf.extend(waiting)

    def _look_inside(self, packet: bytes) -> None:
        """Have the parser go on from the next start byte inside a packet that was none."""
        start = next((i for i in range(1, len(packet)) if packet[i] in MAGIC), None)
        if start is None:
            return
        parser = self._parser
        parser.buf = bytearray(packet[start:]) + parser.buf[parser.buf_index :]
        parser.buf_index = 0

    def _trim(self) -> None:
        """Forget parsed bytes: on a stream that never pauses pymavlink would keep them for ever."""
        if self._parser.buf_index > MAX_PARSED:
            del self._parser.buf[: self._parser.buf_index]
            self._parser.buf_index = 0
