"""What a person waits for: import, a whole replay, and the first start on a fresh machine."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.timing import Spent, median_of_processes

HEAD = ("process", "wall [s]", "processor [s]", "least [s]", "asked")
IMPORT_REPEATS, REPLAY_REPEATS = 5, 3


def process_rows(flight: Path, *, repeats: tuple[int, int] = (IMPORT_REPEATS, REPLAY_REPEATS)) -> Iterator[list[str]]:
    """Rows of the table of processes; ``flight`` is replayed warm and with nothing compiled yet."""
    bare = median_of_processes(repeats[0], ["-c", "pass"])
    ours = median_of_processes(repeats[0], ["-c", "import axialnav"])
    facade = median_of_processes(repeats[0], ["-c", "import axialnav; axialnav.CorridorEstimator"])
    yield _row("python, nothing imported", bare)
    yield _row("import axialnav (above bare python)", _above(ours, bare), "<= 0.3")
    yield _row("import axialnav, then axialnav.CorridorEstimator (above bare python)", _above(facade, bare))
    with tempfile.TemporaryDirectory() as folder:
        replay = ["-m", "axialnav", "replay", str(flight), "--out", str(Path(folder, "run"))]
        median_of_processes(1, replay)
        yield _row(f"axialnav replay {flight.name}, warm", median_of_processes(repeats[1], replay), "<= 4")
        cache = {"NUMBA_CACHE_DIR": str(Path(folder, "cache"))}
        yield _row("the same, nothing compiled yet", median_of_processes(1, replay, cache))


def _above(spent: Spent, base: Spent) -> Spent:
    return Spent(*(max(ours - bare, 0.0) for ours, bare in zip(spent, base, strict=True)))


def _row(name: str, spent: Spent, asked: str = "-") -> list[str]:
    return [name, f"{spent.wall_s:.3f}", f"{spent.cpu_s:.3f}", f"{spent.least_s:.3f}", asked]
