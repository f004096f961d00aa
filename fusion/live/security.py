"""What may come in: signed where a key is set, from listed senders only, through a parser that cannot be silenced.

pymavlink stores the time stamp of a signed packet before it has checked the signature, so that one forged packet from
the far future mutes the real sender for ever.  Here the signature is checked first, and a stamp from the far future is
refused even if the signature is right.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

from axialnav.fusion.errors import ConfigError

EPOCH_2015_S = 1_420_070_400
TICKS_PER_S = 100_000  # signing counts 10 us steps since 2015
PLAUSIBLE_TICKS = 9 * 365 * 86_400 * TICKS_PER_S  # our clock has been set if it is past 2024
FAR_FUTURE_TICKS = 30 * 86_400 * TICKS_PER_S
NEW_STREAM_TICKS = 60 * TICKS_PER_S
KEY_BYTES = 32
MAX_STREAMS = 64


def read_key(path: str | Path) -> bytes:
    """Signing key from a file: 64 hexadecimal digits, or a passphrase as ground stations take it (its SHA-256).

    Raises
    ------
    ConfigError
        The file cannot be read or is empty.
    """
    try:
        text = Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise ConfigError(f"mavlink.key_file {path}: cannot be read: {reason}") from None
    if not text:
        raise ConfigError(f"mavlink.key_file {path} is empty; write 64 hexadecimal digits or a passphrase into it")
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    return key if len(key) == KEY_BYTES else hashlib.sha256(text.encode()).digest()


def signing_ticks() -> int:
    """Now, as signing counts it; the one place where the time of day matters, because both ends must agree on it."""
    now_s = time.clock_gettime_ns(time.CLOCK_REALTIME) * 1e-9
    return max(int((now_s - EPOCH_2015_S) * TICKS_PER_S), 0)


class Signatures:
    """Checks the signatures of one parser: signature first, then the stamp against replay and the far future."""

    def __init__(self, key: bytes, ticks: Callable[[], int]) -> None:
        self.key = key
        self._ticks = ticks
        self._streams: dict[tuple[int, int, int], int] = {}
        self.counts: Counter[str] = Counter()
        self.newest = ticks()

    def check(self, packet: bytearray, system: int, component: int) -> bool:
        """Whether the signed ``packet`` may be believed."""
        expected = hashlib.sha256(self.key + packet[:-6]).digest()[:6]
        if not hmac.compare_digest(expected, bytes(packet[-6:])):
            self.counts["forged"] += 1
            return False
        stamp = int.from_bytes(packet[-12:-6], "little")
        now = self._ticks()
        if now > PLAUSIBLE_TICKS and stamp > now + FAR_FUTURE_TICKS:
            self.counts["far_future"] += 1
            return False
        stream = (packet[-13], system, component)
        oldest = self._streams.get(stream, self.newest - NEW_STREAM_TICKS)
        if stamp <= oldest:
            self.counts["replayed"] += 1
            return False
        if stream not in self._streams and len(self._streams) >= MAX_STREAMS:
            self._streams.clear()
        self._streams[stream] = stamp
        self.newest = max(self.newest, stamp)
        return True


class AllowList:
    """Pairs of system and component that may speak; 0 stands for any.  Refused pairs are counted."""

    def __init__(self, pairs: Iterable[tuple[int, int]]) -> None:
        self._pairs = frozenset(pairs)
        self.refused: Counter[tuple[int, int]] = Counter()

    def admits(self, system: int, component: int) -> bool:
        """Whether messages of that sender may be used."""
        wanted = {(system, component), (system, 0), (0, component), (0, 0)}
        if wanted & self._pairs:
            return True
        if len(self.refused) < MAX_STREAMS or (system, component) in self.refused:
            self.refused[system, component] += 1
        else:
            self.refused[0, 0] += 1  # a flood of invented senders is one line
        return False
