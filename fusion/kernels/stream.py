"""One reading into the ring and through the filter, where it belongs.

A late reading rolls the filter back to a snapshot before its stamp, and everything since then runs again in the order
of stamps.  The same readings in any order of arrival within the ring therefore give the same bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from axialnav.fusion.events import WIDTH
from axialnav.fusion.kernels.run import run
from axialnav.fusion.memory import LOG_WIDTH, MEMORY, SCRATCH, SETTINGS, SOURCE_MEMORY, TRACK_WIDTH
from axialnav.fusion.ring import HEAD, INBOX
from axialnav.fusion.sources import SOURCE
from axialnav.models.jit import Record, Records, array_at
from axialnav.models.scalar_kernel import kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

DONE, TOO_OLD, HELD, FULL = 0, 1, 2, 3  # what became of a reading; FULL: nothing, the ring has to grow first
ADDRESSES = (
    "head", "t_ns", "source", "values", "slot", "free", "kept", "live", "core", "memory", "inbox",
    "sources", "scratch", "settings", "out", "track", "sizes",
)  # fmt: skip
ADDRESS, WORD, REAL = np.dtype(np.uintp), np.dtype(np.int64), np.dtype(np.float64)


@kernel
def take_at(address: int) -> int:
    """Run :func:`take` on the arrays whose addresses stand at ``address``, in the order of ``ADDRESSES``.

    One address as the only argument: handing over seventeen arrays would cost more than the filter.
    """
    at = array_at(address, (len(ADDRESSES),), ADDRESS)
    sizes = array_at(at[16], (4,), WORD)
    n, k, words, n_sources = sizes[0], sizes[1], sizes[2], sizes[3]
    return take(
        array_at(at[0], (1,), HEAD)[0], array_at(at[1], (n,), WORD), array_at(at[2], (n,), WORD),
        array_at(at[3], (n, WIDTH), REAL), array_at(at[4], (n,), WORD), array_at(at[5], (k,), WORD),
        array_at(at[6], (k, words), WORD), array_at(at[7], (words,), WORD), array_at(at[8], (1,), MEMORY),
        array_at(at[9], (n_sources,), SOURCE_MEMORY), array_at(at[10], (1,), INBOX)[0],
        array_at(at[11], (n_sources,), SOURCE), array_at(at[12], (1,), SCRATCH), array_at(at[13], (1,), SETTINGS),
        array_at(at[14], (2, LOG_WIDTH), REAL), array_at(at[15], (1, TRACK_WIDTH), REAL),
    )  # fmt: skip


@kernel
def take(
    h: Record, t_ns: Ints, source: Ints, values: Array, slot: Ints, free: Ints, kept: Ints, live: Ints, core: Records,
    memory: Records, inbox: Record, sources: Records, scratch: Records, settings: Records, out: Array, track: Array,
) -> int:  # fmt: skip
    """Take the reading in the inbox; its log row is left in ``out[0]``."""
    start = 0
    if h.restart == 0:
        code = place(h, t_ns, source, values, slot, inbox)
        if code != DONE:
            return int(code)
        late = h.wanted < h.count - 1
        start = rewind(h, slot, free, kept, live) if late else h.wanted
    h.restart = 0
    for e in range(start, h.count):
        remember(e, h, slot, free, kept, live)
        one, row = slice(e, e + 1), slice(0, 1) if e == h.wanted else slice(1, 2)
        for i in range(LOG_WIDTH):
            out[row][0, i] = 0.0
        run(t_ns[one], source[one], values[one], sources, core, memory, scratch, settings, track, out[row])
    forget(h, t_ns, source, values, slot, free)
    return DONE


@kernel
def place(h: Record, t_ns: Ints, source: Ints, values: Array, slot: Ints, inbox: Record) -> int:
    """Put the reading in the inbox where it belongs, unless it is too old or there is no room."""
    if h.count == t_ns.shape[0]:
        return FULL
    in_first_window = inbox.t_ns <= h.keep_from_ns
    if h.aligned == 1 and h.count > 0 and (inbox.t_ns < t_ns[0] or (in_first_window and h.trimmed == 1)):
        return TOO_OLD
    insert(h, t_ns, source, values, slot, inbox)
    return HELD if h.aligned == 0 or in_first_window else DONE


@kernel
def comes_before(inbox: Record, t_ns: int, source: int, values: Array) -> bool:
    """Whether the reading in the inbox is processed before that event: by stamp, source, then values, NaN last.

    The order is that of :func:`axialnav.fusion.events.tie_break`.
    """
    if inbox.t_ns != t_ns:
        return bool(inbox.t_ns < t_ns)
    if inbox.source != source:
        return bool(inbox.source < source)
    for i in range(values.shape[0]):
        ours = np.inf if np.isnan(inbox.values[i]) else inbox.values[i]
        theirs = np.inf if np.isnan(values[i]) else values[i]
        if ours != theirs:
            return bool(ours < theirs)
    return False


@kernel
def insert(h: Record, t_ns: Ints, source: Ints, values: Array, slot: Ints, inbox: Record) -> None:
    """Put the reading in the inbox where it belongs."""
    at = h.count
    while at > 0 and comes_before(inbox, t_ns[at - 1], source[at - 1], values[at - 1]):
        move_event(at - 1, at, t_ns, source, values, slot)
        at -= 1
    t_ns[at] = inbox.t_ns
    source[at] = inbox.source
    for i in range(values.shape[1]):
        values[at, i] = inbox.values[i]
    slot[at] = -1
    h.count += 1
    h.wanted = at


@kernel
def move_event(old: int, new: int, t_ns: Ints, source: Ints, values: Array, slot: Ints) -> None:
    """Copy an event, with its snapshot, to another place."""
    t_ns[new] = t_ns[old]
    source[new] = source[old]
    slot[new] = slot[old]
    for i in range(values.shape[1]):
        values[new, i] = values[old, i]


@kernel
def rewind(h: Record, slot: Ints, free: Ints, kept: Ints, live: Ints) -> int:
    """Bring back the filter before the wanted event or an earlier one; return which, give up later snapshots."""
    index = h.wanted
    if slot[index + 1] >= 0:  # before the next was before the new one
        slot[index] = slot[index + 1]
        slot[index + 1] = -1
    for e in range(index + 1, h.count):
        release(e, h, slot, free)
    start = index
    while slot[start] < 0:
        start -= 1
    snapshot = kept[slot[start]]
    for i in range(live.shape[0]):
        live[i] = snapshot[i]
    return int(start)


@kernel
def remember(index: int, h: Record, slot: Ints, free: Ints, kept: Ints, live: Ints) -> None:
    """Keep the filter as it is before the event at ``index`` if the last snapshot is a stride back."""
    for e in range(index, max(index - h.stride, -1), -1):
        if slot[e] >= 0:
            return
    h.free -= 1
    slot[index] = free[h.free]
    snapshot = kept[slot[index]]
    for i in range(live.shape[0]):
        snapshot[i] = live[i]


@kernel
def release(index: int, h: Record, slot: Ints, free: Ints) -> None:
    """Give up the snapshot before an event, if there is one."""
    if slot[index] >= 0:
        free[h.free] = slot[index]
        h.free += 1
        slot[index] = -1


@kernel
def forget(h: Record, t_ns: Ints, source: Ints, values: Array, slot: Ints, free: Ints) -> None:
    """Drop what is older than the ring reaches, but nothing of the first window while that is in reach.

    The oldest event kept carries a snapshot; trimming in lumps keeps the cost per reading constant.
    """
    limit = t_ns[h.count - 1] - h.reach_ns
    if limit <= h.keep_from_ns or t_ns[0] > limit - h.reach_ns // 4:
        return
    cut = 0
    for e in range(h.count):
        if t_ns[e] > limit:
            break
        if slot[e] >= 0:
            cut = e
    if cut == 0:
        return
    for e in range(cut):
        release(e, h, slot, free)
    for e in range(cut, h.count):
        move_event(e, e - cut, t_ns, source, values, slot)
    h.count -= cut
    h.trimmed = 1
