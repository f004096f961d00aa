"""Ten million hostile bytes into every decoder: what came out, what was ever kept, and what memory it took."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from functools import partial

from tests.bench.live_hour import resident_mib
from tests.bench.markdown import number
from tests.fusion.live import nooploop_vectors as vectors
from tests.fusion.live.hostile import Survived, feed_mavlink, feed_nlink

HEAD = ("decoder", "bytes", "frames or messages out", "most bytes kept", "resident [MiB] grew by", "MB/s")
KEY = bytes(range(32))


def byte_rows(total: int = 10_000_000) -> Iterator[list[str]]:
    """One row a decoder; an exception ends the bench."""
    decoders: dict[str, Callable[[], Survived]] = {name: partial(feed_nlink, name, total, 20) for name in vectors.BYTES}
    decoders["Nooploop, all frames"] = partial(feed_nlink, None, total, 20)
    decoders["MAVLink and what takes its messages"] = partial(feed_mavlink, None, total, 3)
    decoders["MAVLink, signed"] = partial(feed_mavlink, KEY, total, 3)
    feed_mavlink(None, 1000, 1)
    for name, feed in decoders.items():
        gc.collect()
        before, began = resident_mib(), time.perf_counter()
        survived = feed()
        seconds = time.perf_counter() - began
        gc.collect()
        grew = f"{resident_mib() - before:+.1f}"
        counts = (str(survived.taken), str(survived.came_out), str(survived.most_waiting))
        yield [name, *counts, grew, number(total * 1e-6 / seconds, 1)]
