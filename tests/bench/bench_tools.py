"""What a person waits for with a log of ten minutes, and how sweeps use a second core.

``python -m tests.bench.bench_tools [LOGS]``; LOGS is the number of recordings in the sweep, 24 if not given.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from axialnav.replay.flight_writer import write_flight
from tests.bench.markdown import machine, table
from tests.bench.timing import median_of_processes
from tests.replay.made_recordings import flown

MINUTES, SEEDS, LOGS, REPEATS = 10.0, (1, 2, 3, 4), 24, 3
REPORT_MB, REPLAY_S, DOCTOR_S, EFFICIENCY = 8.0, 5.0, 2.0, 0.9
TIME_HEAD = ("verb", "wall [s]", "processor [s]", "asked", "verdict")
SWEEP_HEAD = ("sweep", "recordings", "wall [s]", "a recording [s]", "of twice as fast", "asked", "reached", "verdict")


def make_logs(folder: Path, minutes: float = MINUTES, seeds: Sequence[int] = SEEDS) -> list[Path]:
    """Flight folders at 200 Hz with image motion, range finder and UWB, and the truth."""
    return [write_flight(flown(seed, 60.0 * minutes), folder / f"log{seed}") for seed in seeds]


def time_rows(log: Path, folder: Path, repeats: int = REPEATS) -> Iterator[list[str]]:
    """Replay and doctor as processes, from start to end, with everything compiled; and the size of the report."""
    run = folder / "run"
    replay = ["-m", "axialnav", "replay", str(log), "--out", str(run)]
    median_of_processes(1, replay)
    for name, words, limit in (
        ("replay", replay, REPLAY_S),
        ("doctor", ["-m", "axialnav", "doctor", str(log)], DOCTOR_S),
    ):
        spent = median_of_processes(repeats, words)
        asked = f"<= {limit:g} s"
        yield [name, f"{spent.wall_s:.2f}", f"{spent.cpu_s:.2f}", asked, "ok" if spent.wall_s <= limit else "SHORT"]
    size = (run / "report.html").stat().st_size / 1e6
    yield ["report.html", f"{size:.1f} MB", "", f"<= {REPORT_MB:g} MB", "ok" if size <= REPORT_MB else "SHORT"]


def sweep_rows(logs: Sequence[Path], folder: Path, count: int = LOGS) -> Iterator[list[str]]:
    """One sweep with one worker, two such sweeps side by side with half of the work each, one sweep with two workers.

    The second is what the machine gives two programs that have nothing to do with each other: threads of one core, and
    processes that share its memory, are slower than one alone.
    """
    copies = []
    for k in range(count):
        copies.append(folder / f"copy{k:03d}")
        shutil.copytree(logs[k % len(logs)], copies[-1])
    alone = _sweeps([copies], 1, folder / "alone")
    apart = _sweeps([copies[::2], copies[1::2]], 1, folder / "apart")
    both = _sweeps([copies], 2, folder / "both")
    share = apart / both
    rows = (
        ("one worker", alone, 1, "", ""),
        ("two sweeps of one worker, half of it each", apart, 2, "", ""),
        ("two workers", both, 2, f">= {EFFICIENCY:.0%} of the row above", f"{share:.0%}"),
    )
    for name, wall, cores, asked, reached in rows:
        verdict = ("ok" if share >= EFFICIENCY else "SHORT") if asked else ""
        cells = [f"{wall:.1f}", f"{wall / count:.2f}", f"{alone / (cores * wall):.0%}"]
        yield [name, str(count), *cells, asked, reached, verdict]


def _sweeps(parts: Sequence[Sequence[Path]], workers: int, out: Path) -> float:
    """Wall time of sweeps that run side by side [s]."""
    began = time.perf_counter()
    running = []
    for k, part in enumerate(parts):
        words = ["sweep", *map(str, part), "--workers", str(workers), "--out", str(out / str(k))]
        running.append(subprocess.Popen([sys.executable, "-m", "axialnav", *words], stdout=subprocess.DEVNULL))
    codes = [process.wait() for process in running]
    if any(codes):
        raise RuntimeError(f"a sweep ended with exit code {max(codes)}")
    return time.perf_counter() - began


def main(count: int = LOGS) -> None:
    """Print both tables."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        logs = make_logs(folder)
        sys.stdout.write(f"{machine()}; logs of {MINUTES:g} minutes at 200 Hz\n\n")
        sys.stdout.write(table(TIME_HEAD, time_rows(logs[0], folder)) + "\n\n")
        sys.stdout.write(table(SWEEP_HEAD, sweep_rows(logs, folder, count)) + "\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
