"""Messages to bytes on the link, from several threads, numbered and signed."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable

from axialnav.fusion.live.dialect import Message, mavlink
from axialnav.fusion.live.security import Signatures, signing_ticks
from axialnav.fusion.live.transport import Link


class Sender:
    """Packs and sends as one system and component.

    Attributes
    ----------
    counts
        Messages sent by name; ``unsent`` counts those that found no way out.
    """

    def __init__(
        self,
        link: Link,
        *,
        system: int,
        component: int,
        signatures: Signatures | None = None,
        ticks: Callable[[], int] = signing_ticks,
        tap: Callable[[Message], None] | None = None,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._link, self._signatures, self._ticks, self._tap = link, signatures, ticks, tap
        self._lock = threading.Lock()
        self._packer = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        if signatures is not None:
            self._packer.signing.secret_key = signatures.key
            self._packer.signing.sign_outgoing = True

    def send(self, message: Message) -> bool:
        """Send one message; False if it could not go out."""
        with self._lock:
            signing = self._packer.signing
            if self._signatures is not None:
                # the other end refuses stamps behind what it has seen: follow its clock if ours is behind
                signing.timestamp = max(signing.timestamp, self._ticks(), self._signatures.newest + 1)
            data = message.pack(self._packer)
            self._packer.seq = (self._packer.seq + 1) % 256
            sent = self._link.send(data)
            self.counts[message.get_type() if sent else "unsent"] += 1
        if sent and self._tap is not None:
            self._tap(message)
        return sent
